"""Find the variables that the modes of one Disjunction define.

These are the derivatives that appear, then the algebraic variables that make the equations solvable in every mode; among several
choices, the variables alone on one side of an equation, as definitions are usually written.
"""

from itertools import combinations
from math import comb

from pyomo.common.collections import ComponentMap, ComponentSet

from pyomo_fesd.core import FesdError, is_generated
from pyomo_fesd.dcs.reading.linear_equations import matching, solvable

#: With more ways than this to choose the defined variables, only those alone on one side are considered.
MOST_CHOICES = 5000


def find_defined_variables(disjunction, disjuncts, modes, variables, cache) -> list:
    """Return the variables that the ``modes`` (lists of ``LinearEquation``) define.

    Parameters
    ----------
    variables : TimeVariables
        with the Vars that the user says they define, which are taken where they can be
    cache : dict
        the choice made before, by position and component

    Raises
    ------
    FesdError
        naming the missing, surplus or ambiguous variable
    """
    _require_equal_counts(disjunction, disjuncts, modes, variables)
    derivatives = _derivatives(disjunction, disjuncts, modes, variables)
    number = len(modes[0]) - len(derivatives)
    if number < 0:
        raise FesdError(
            disjunction,
            f"{len(modes[0])} equation(s) a mode cannot define {len(derivatives)} derivatives: {_names(derivatives)}",
            "give every derivative its own equation in every disjunct",
        )
    return derivatives + (_algebraic(disjunction, modes, derivatives, number, variables, cache) if number else [])


def _names(variables):
    return ', '.join(sorted(v.name for v in variables)) or 'none'


def _require_equal_counts(disjunction, disjuncts, modes, variables):
    counts = [len(equations) for equations in modes]
    if not any(counts):
        raise FesdError(
            disjunction,
            "no disjunct defines anything: there is no equality constraint in them",
            "write the equations of each mode, e.g. m.dx[t] == ..., beside its region",
        )
    full, lacking = (counts.index(count) for count in (max(counts), min(counts)))
    if counts[full] == counts[lacking]:
        return
    candidates, present = (
        ComponentSet(v for e in modes[i] for v in e.linear if variables.is_derivative(v) or v in e.alone) for i in (full, lacking)
    )
    raise FesdError(
        disjuncts[lacking],
        f"this mode has {counts[lacking]} equation(s) where '{disjuncts[full].name}' has {counts[full]}; "
        f"defined there and not here: {_names(candidates - present)}",
        "let every disjunct of a Disjunction define the same variables",
    )


def _derivatives(disjunction, disjuncts, modes, variables):
    """The derivatives that the modes define; each mode must mention each of them."""
    mentioned = [ComponentSet(v for e in equations for v in e.variables() if variables.is_derivative(v)) for equations in modes]
    found = ComponentSet(v for in_mode in mentioned for v in in_mode)
    for disjunct, in_mode in zip(disjuncts, mentioned):
        for v in found:
            if v not in in_mode:
                raise FesdError(
                    disjunct,
                    f"this mode does not define '{v.name}', which other modes of '{disjunction.name}' do",
                    f"add the equation for '{v.name}' (for a frozen state: == 0), or take it out of the other disjuncts",
                )
    return list(found)


def _algebraic(disjunction, modes, derivatives, number, variables, cache):
    """The algebraic variables, ``number`` of them, for which every mode's equations can be solved."""
    candidates = _named(_candidates(modes, derivatives, variables), number, variables)
    usual = _chosen_before(candidates, cache)
    if len(usual) == number and _fitting(solvable, modes, derivatives, [usual]):
        return usual
    choices = _choices(candidates, modes, number)
    explicit = _fitting(solvable, modes, derivatives, choices)
    possible = explicit or _fitting(matching, modes, derivatives, choices)
    if not possible:
        raise FesdError(
            disjunction,
            "the modes do not define the same variables: no choice of "
            f"{number} of the variables that all of them mention ({_names(candidates)}) can be solved for in every disjunct",
            "let every disjunct define the same variables, one equation each",
        )
    chosen = _preferred(disjunction, modes, possible)
    order = ComponentMap((v, k) for k, v in enumerate(candidates))
    cache['chosen'] = [(order[v], v.parent_component()) for v in chosen] if explicit else ()
    return list(chosen)


def _chosen_before(candidates, cache):
    """The variables that were chosen at another time, as far as they are candidates."""
    return [v for k, component in cache.get('chosen', ()) for v in candidates[k : k + 1] if v.parent_component() is component]


def _fitting(fits, modes, derivatives, choices):
    """The choices that fit the equations of every mode."""
    return [choice for choice in choices if all(fits(equations, [*derivatives, *choice]) for equations in modes)]


def _candidates(modes, derivatives, variables):
    """Algebraic variables that every mode mentions, in order of appearance."""
    known = ComponentSet(derivatives)
    mentioned = [ComponentSet(v for e in equations for v in e.variables()) for equations in modes]
    return [
        v
        for v in mentioned[0]
        if v not in known and not variables.is_state(v) and not is_generated(v) and all(v in others for others in mentioned[1:])
    ]


def _named(candidates, number, variables):
    """The candidates that the user named, with others only where these are too few."""
    named = [v for v in candidates if variables.is_named(v)]
    return named if len(named) >= number else candidates


def _choices(candidates, modes, number):
    if comb(len(candidates), number) > MOST_CHOICES:
        candidates = [v for v in candidates if any(v in e.alone for equations in modes for e in equations)]
    return list(combinations(candidates, number))


def _preferred(disjunction, modes, choices):
    """Among possible choices, the variables that are alone on one side most often."""

    def score(choice):
        return sum(any(v in e.alone for e in equations) for equations in modes for v in choice)

    best = max(map(score, choices))
    top = [c for c in choices if score(c) == best]
    if len(top) > 1:
        raise FesdError(
            disjunction,
            "it cannot be told which variable the mode equations define: " + ' or '.join(_names(c) for c in top),
            "put the defined variable alone on one side, e.g. m.F[t] == 0.1*(m.P[t] - 1), or name it: fesd.dcs with defines=[m.F]",
        )
    return top[0]
