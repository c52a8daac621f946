"""Draw ``docs/_static/architecture.svg``, the way of the data. Run it from any folder: ``python docs/_figures/architecture.py``."""

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

PICTURE = Path(__file__).parents[1] / '_static' / 'architecture.svg'
STEP, RECORD, READER = '#dbe9f6', '#fdebc8', '#e6f2e1'
EDGE = {STEP: '#3f78b5', RECORD: '#c98a1b', READER: '#5b9a4c'}
WIDTH = {STEP: 3.4, RECORD: 2.4, READER: 2.0}
HEIGHT = 1.2
ARROW = {'arrowstyle': '-|>', 'mutation_scale': 12, 'linewidth': 1.2, 'shrinkA': 0, 'shrinkB': 0}
BUS = (7.3, 4.6)  # where the arrow of MovingGrid joins that of SwitchedSystems
LEFT, MIDDLE, RIGHT = 1.7, 5.5, 9.2  # centres of the three columns
#: centre x, centre y, colour, title, text
BOXES = (
    (LEFT, 8.6, STEP, "a user's Pyomo model", 'Disjunction, Piecewise, Expr_if, abs,\nComplementarity, state_jump, units'),
    (LEFT, 6.6, STEP, 'fesd.dcs', 'switches become Complementarity and\nmultipliers; also smooth_to_complementarity'),
    (LEFT, 4.6, STEP, 'fesd.finite_elements', 'collocation on moving elements,\ncross complementarity'),
    (LEFT, 2.6, STEP, 'mpec_hybrid', 'compile, relaxation, branch NLP,\nLPEC, certificate'),
    (LEFT, 0.6, STEP, 'results', 'values in the model, certificate;\nswitches, trajectory, plot'),
    (MIDDLE, 6.6, RECORD, 'SwitchedSystems', 'modes, multipliers,\nswitching functions, jumps'),
    (MIDDLE, 4.6, RECORD, 'MovingGrid', 'lengths, control stages,\ntime complementarities'),
    (MIDDLE, 2.6, RECORD, 'HomotopyHints', 'decided pairs, penalties,\nneighbouring branches'),
    (RIGHT, 5.3, READER, 'simulate', 'element by element'),
    (RIGHT, 3.7, READER, 'refine', 'grid by grid'),
)
#: corners of each arrow; the first column's steps follow one another, and each writes its records
WRITES = (
    ((LEFT, 8.0), (LEFT, 7.2)),
    ((LEFT, 6.0), (LEFT, 5.2)),
    ((LEFT, 4.0), (LEFT, 3.2)),
    ((LEFT, 2.0), (LEFT, 1.2)),
    ((3.4, 6.6), (4.3, 6.6)),
    ((3.4, 4.6), (4.3, 4.6)),
    ((3.4, 4.2), (4.3, 3.0)),
)
READS = (
    ((4.3, 6.2), (3.4, 5.0)),
    ((4.3, 2.6), (3.4, 2.6)),
    ((6.7, 4.9), (8.2, 5.2)),
    ((6.7, 4.3), (8.2, 3.8)),
    ((6.7, 6.6), (7.3, 6.6), (7.3, 0.6), (3.4, 0.6)),
    ((6.7, 4.6), BUS),
)
LABELS = ((5.6, 'Complementarity\nover time'), (3.6, 'an MPCC,\nwithout time'))
LEGEND = ((9.0, STEP, 'step of a solution'), (8.6, RECORD, 'record, written once'), (8.2, READER, 'beside the three calls'))


def box(axis, x, y, color, title, text):
    """Draw one rounded box with a bold title."""
    corner = (x - WIDTH[color] / 2, y - HEIGHT / 2)
    axis.add_patch(FancyBboxPatch(corner, WIDTH[color], HEIGHT, 'round,pad=0', facecolor=color, edgecolor=EDGE[color]))
    axis.text(x, y + 0.32, title, ha='center', va='center', fontsize=9.5, weight='bold')
    axis.text(x, y - 0.18, text, ha='center', va='center', fontsize=8)


def arrow(axis, corners, color, style):
    """Draw an arrow along ``corners``; only its last piece has a head."""
    for k, (start, end) in enumerate(zip(corners, corners[1:])):
        if k < len(corners) - 2 or end == BUS:
            axis.plot(*zip(start, end), color=color, linestyle=style, linewidth=1.2)
        else:
            axis.annotate('', end, start, arrowprops=ARROW | {'color': color, 'linestyle': style})


def draw():
    """Draw steps on the left, the records that they write in the middle, other readers on the right."""
    figure = Figure(figsize=(9.2, 8.0))
    axis = figure.add_axes((0, 0, 1, 1))
    axis.set(xlim=(-0.1, 10.4), ylim=(-0.1, 9.3))
    axis.axis('off')
    for entry in BOXES:
        box(axis, *entry)
    for corners in WRITES:
        arrow(axis, corners, '0.25', '-')
    for corners in READS:
        arrow(axis, corners, EDGE[RECORD], '--')
    for y, text in LABELS:
        axis.text(LEFT + 0.1, y, text, ha='left', va='center', fontsize=8, style='italic')
    for y, color, text in LEGEND:
        axis.add_patch(FancyBboxPatch((4.4, y - 0.1), 0.4, 0.2, 'round,pad=0', facecolor=color, edgecolor=EDGE[color]))
        axis.text(5.0, y, text, va='center', fontsize=8)
    for y, text, color, style in ((9.0, 'goes on, writes', '0.25', '-'), (8.6, 'reads', EDGE[RECORD], '--')):
        arrow(axis, ((7.3, y), (8.0, y)), color, style)
        axis.text(8.2, y, text, va='center', fontsize=8)
    figure.savefig(PICTURE, metadata={'Date': None})


if __name__ == '__main__':
    draw()
