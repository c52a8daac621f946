"""Refuse keywords that a caller does not have, and values outside of their domains, before anything is changed.

Pyomo's ConfigDict holds names, defaults, domains and descriptions; its own errors name neither the caller nor the remedy, and its
domains accept NaN.
"""

import math
from difflib import get_close_matches

from pyomo.common.config import ConfigDict, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from pyomo_fesd.core.errors import KeywordError

#: Domain of numbers -> its name.
NUMBERS = {
    PositiveInt: "a positive integer",
    NonNegativeInt: "an integer that is not negative",
    PositiveFloat: "a positive number",
    NonNegativeFloat: "a number that is not negative",
}


def read_keywords(declared: ConfigDict, given: dict, caller: str) -> ConfigDict:
    """Return the options ``declared`` with the values ``given``, after ``check_keywords``.

    Parameters
    ----------
    declared : ConfigDict
    given : dict
        keywords of a transformation; Pyomo's keyword ``options`` gives more of them in a dictionary
    caller : str
        for the error
    """
    more = given.pop('options', None) or {}
    if not isinstance(more, dict):
        raise KeywordError(caller, f"options={more!r} is not a dictionary", "give the keywords one by one")
    given = {**more, **given}
    check_keywords(declared, given, caller)
    return declared(given)


def check_keywords(declared: ConfigDict, given: dict, caller: str) -> None:
    """Refuse names and values that ``declared`` does not accept.

    Raises
    ------
    KeywordError
        names the caller, the keyword and its value, and gives the description of the keyword
    """
    for name, value in given.items():
        if name not in declared:
            raise _unknown(declared, name, caller)
        entry = declared.get(name)
        reason = _reason(entry, value)
        if reason is not None:
            raise KeywordError(caller, f"{name}={_shown(value)}{reason}", _remedy(entry, name))


def _shown(value):
    return getattr(value, 'name', None) or repr(value)


def _unknown(declared, name, caller):
    near = get_close_matches(name, list(declared), n=1) or [f"one of {', '.join(declared)}"]
    return KeywordError(
        caller, f"it has no keyword '{name}'", f"did you mean {near[0]}?" if len(near[0]) < 40 else f"give {near[0]}"
    )


def _reason(entry, value):
    """Why ``entry`` does not accept ``value``; None if it does."""
    if isinstance(entry, ConfigDict):
        return None if value is None or isinstance(value, (dict, ConfigDict)) else " is not a dictionary"
    if value is None:
        # None would pass every domain
        return None if entry._default is None else ""
    if entry.name() == 'timer' and not hasattr(value, 'start'):
        return " is not a HierarchicalTimer"
    name = NUMBERS.get(entry._domain)
    if name is not None and isinstance(value, bool):
        return f" is not {name}"
    try:
        found = entry(value).value()
    except ValueError as error:
        return _explained(name, str(error))
    return _not_finite(entry, found)


def _explained(name, message):
    if name is not None:
        return f" is not {name}"
    # Pyomo's message ends with that of the domain
    reason = message.rpartition('Error: ')[2].splitlines()[0]
    _, is_choice, choices = reason.partition(' not in domain ')
    return f" is not one of {choices.strip('[]')}" if is_choice else f": {reason}"


def _not_finite(entry, found):
    if isinstance(found, float) and (math.isnan(found) or (math.isinf(found) and entry._default is not None)):
        return " is not a finite number"
    return None


def _remedy(entry, name):
    described = ' '.join((entry._description or '').split()).rstrip('.')
    default = entry._default
    left_out = f" (default: {default!r})" if isinstance(default, (str, int, float)) else ""
    return f"{name}: {described}{left_out}" if described else f"leave {name} out"
