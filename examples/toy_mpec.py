"""
Toy MPEC: where relaxation alone can fail
=========================================

The smallest problem in which a relaxation can end at a point that is not a solution.
The solutions are (1, 0) and (0, 1). The relaxed problem x y <= eps also has the
stationary point (sqrt(eps), sqrt(eps)), for eps < 1/4 a local maximum along the curve
x y = eps; for eps -> 0 it ends at the origin, where both axes still lead downhill.
``mpec_hybrid`` certifies its answers, and refuses a certificate at the origin. ::

    min (x - 1)^2 + (y - 1)^2   s.t.  0 <= x  perp  y >= 0

Every method starts from the origin and from 20 random points. ``mpec_hybrid`` is
compared with relaxation alone: Ipopt at its default options, eps from 1 to 1e-9, each
solution the next initial value, for ::

    Scholtes:            x y <= eps,   x, y >= 0
    Fischer-Burmeister:  x + y - sqrt(x^2 + y^2 + 2 eps) = 0,  with/without x, y >= 0

Nearly all paths follow the diagonal first, and rounding decides where they leave it,
if they do: counts may differ between machines.

Source: paper, eq. (14) and (15) and Fig. 1; Leyffer and Munson (2007).

**Why the answer is right.** Both solutions can be seen: on each axis the other variable
is 0, and 1 is the best value. All 21 answers of ``mpec_hybrid`` are one of them to
1e-11, with a certificate. At the origin the certificate is refused, with the direction
that descends.
"""

import casadi as ca
import numpy as np
import pyomo.environ as pyo
from matplotlib.figure import Figure
from pyomo.contrib.solver.common.factory import SolverFactory
from pyomo.mpec import Complementarity, complements

import pyomo_fesd

STARTS = np.vstack([np.zeros((1, 2)), np.random.default_rng(0).uniform(0, 2, (20, 2))])
ENDS = {'(1, 0)': (1.0, 0.0), '(0, 1)': (0.0, 1.0), 'the origin': (0.0, 0.0)}
REACHED = 1e-3  # distance at which a path counts as arrived
SCHEDULE = 10.0 ** -np.arange(10)  # eps
PICTURE = 'toy_mpec.png'

#: Relaxations: constraint, its lower bound (the upper is 0), lower bound of x, y.
RELAXATIONS = {
    'Scholtes': (lambda x, y, eps: x * y - eps, -np.inf, 0.0),
    'Fischer–Burmeister': (
        lambda x, y, eps: x + y - ca.sqrt(x**2 + y**2 + 2 * eps),
        0.0,
        -np.inf,
    ),
    'Fischer–Burmeister with x, y ≥ 0': (
        lambda x, y, eps: x + y - ca.sqrt(x**2 + y**2 + 2 * eps),
        0.0,
        0.0,
    ),
}


def build(start=(0.0, 0.0)):
    """Build the problem with its variables at ``start``."""
    m = pyo.ConcreteModel()
    m.x = pyo.Var(initialize=start[0])
    m.y = pyo.Var(initialize=start[1])
    m.pair = Complementarity(expr=complements(m.x >= 0, m.y >= 0))
    m.distance = pyo.Objective(expr=(m.x - 1) ** 2 + (m.y - 1) ** 2)
    return m


def hybrid(start, **options):
    """Solve with ``mpec_hybrid``; returns the results and the path (k, 2)."""
    m = build(start)
    results = SolverFactory('mpec_hybrid').solve(m, **options)
    column = {v.name: j for j, v in enumerate(results.solution_loader.get_vars())}
    steps = [step.w[[column['x'], column['y']]] for step in results.extra_info.steps]
    return results, np.array([start, *steps, (m.x.value, m.y.value)])


def relaxation(row, row_lower, lower):
    """Return a function start -> (path, whether Ipopt succeeded) for one relaxation."""
    w, eps = ca.SX.sym('w', 2), ca.SX.sym('eps')
    problem = {'x': w, 'p': eps, 'f': ca.sumsqr(w - 1), 'g': row(w[0], w[1], eps)}
    ipopt = ca.nlpsol(
        'ipopt',
        'ipopt',
        problem,
        {'print_time': False, 'ipopt': {'print_level': 0, 'sb': 'yes'}},
    )

    def solve(start):
        path = [start]
        for now in SCHEDULE:
            result = ipopt(x0=path[-1], p=now, lbx=lower, lbg=row_lower, ubg=0)
            path.append(np.array(result['x']).ravel())
        return np.array(path), ipopt.stats()['success']

    return solve


def count(paths):
    """Count the paths by their end points."""
    at = {
        name: sum(np.abs(path[-1] - end).max() < REACHED for path in paths)
        for name, end in ENDS.items()
    }
    return at | {'elsewhere': len(paths) - sum(at.values())}


def sentence(title, paths, verdict):
    """Describe the end points of one method."""
    ends = ', '.join(
        f'{number} at {name}' if name in ENDS else f'{number} {name}'
        for name, number in count(paths).items()
    )
    error = max(
        min(np.abs(path[-1] - end).max() for end in ENDS.values()) for path in paths
    )
    return f'{title}: {ends}, at most {error:.0e} off; {verdict}.'


def refuse_origin():
    """Evaluate the certificate at the origin and print it."""
    certificate = pyomo_fesd.certify(build())
    direction = ', '.join(f'{d:g}' for d in certificate.direction.values())
    print(
        f'The origin is {certificate.grade.value}, ({direction}), with slope '
        f'{certificate.value:g}.'
    )


def draw(panels, trapped):
    """Draw all paths with counted ends; ``trapped`` in red in the first panel."""
    figure = Figure(figsize=(9, 9), layout='constrained')
    axes = figure.subplots(2, 2, sharex=True, sharey=True).flat
    x, y = np.meshgrid(*2 * [np.linspace(-0.2, 2.1, 100)])
    for axis, (title, paths) in zip(axes, panels.items()):
        axis.contour(
            x,
            y,
            (x - 1) ** 2 + (y - 1) ** 2,
            10,
            colors='0.9',
            linewidths=0.8,
            zorder=0,
        )
        axis.plot([0, 0, 2.1], [2.1, 0, 0], color='0.6', linewidth=3, zorder=1)
        for path in paths:
            axis.plot(*path.T, '.-', color='C0', linewidth=0.8, markersize=5, alpha=0.6)
        axis.plot(*STARTS.T, 'o', color='C0', markersize=5, markerfacecolor='white')
        for end, number in zip(ENDS.values(), count(paths).values()):
            axis.annotate(
                number,
                end,
                (-10, -10),
                textcoords='offset points',
                ha='center',
                va='center',
                weight='bold',
            )
        axis.set(title=title, aspect='equal', xlim=(-0.2, 2.1), ylim=(-0.2, 2.1))
    figure.axes[0].plot(*trapped.T, '.-', color='C3')
    figure.axes[0].text(0.45, -0.14, 'led into the trap', color='C3', ha='center')
    figure.supxlabel('x')
    figure.supylabel('y')
    figure.savefig(PICTURE, dpi=150)


def main():
    """Run every method from every start, print where it ends, draw the paths."""
    runs = [hybrid(start) for start in STARTS]
    panels = {'mpec_hybrid': [path for _, path in runs]}
    certified = sum(results.extra_info.stationarity == 'B' for results, _ in runs)
    print(sentence('mpec_hybrid', panels['mpec_hybrid'], f'{certified} certified'))
    for title, form in RELAXATIONS.items():
        panels[title], solved = zip(*map(relaxation(*form), STARTS))
        print(sentence(title, panels[title], f'Ipopt calls {sum(solved)} solved'))
        diagonal = sum(np.ptp(path[2]) < REACHED for path in panels[title])
        print(
            f'    At eps = {SCHEDULE[1]} it is still on the diagonal from {diagonal} '
            'starts.'
        )
    refuse_origin()
    results, trapped = hybrid(STARTS[0], eps_init=SCHEDULE[-1])
    points = ' -> '.join(
        f'{s.kind} ({s.w[0]:.2g}, {s.w[1]:.2g})' for s in results.extra_info.steps
    )
    print(f'mpec_hybrid, led into the trap by eps_init = {SCHEDULE[-1]}: {points}.')
    draw(panels, trapped)
    print(f'The paths, that one in red: {PICTURE}')


if __name__ == '__main__':
    main()
