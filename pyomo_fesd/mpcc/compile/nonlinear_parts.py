"""Nonlinear parts of expressions, as Pyomo's NL template: prefix notation with a place for each variable.

    2.5 x exp(y)  is  'o2 n2.5 o2 %s o44 %s' with the variables (x, y)

Takes: templates of ``AMPLRepnVisitor``, whose arguments are ids of variables and of named expressions.
Leaves: casadi expressions, and a canonical form that is equal where parts differ in variables and in constants only.
"""

import re
from dataclasses import dataclass
from functools import partial, reduce
from itertools import accumulate
from math import isfinite

import casadi as ca


def _unary(code):
    return partial(ca.SX.unary, code)


def _binary(code):
    return partial(ca.SX.binary, code)


#: casadi's methods take a sixth of the time of Python's operators, which try to convert their arguments first.
_PLUS = _binary(ca.OP_ADD)
#: Operations of NL files and their number of arguments; None: the line before the arguments tells it.
OPERATIONS = {
    'o0': (2, _PLUS),
    'o1': (2, _binary(ca.OP_SUB)),
    'o2': (2, _binary(ca.OP_MUL)),
    'o3': (2, _binary(ca.OP_DIV)),
    'o5': (2, _binary(ca.OP_POW)),
    'o13': (1, _unary(ca.OP_FLOOR)),
    'o14': (1, _unary(ca.OP_CEIL)),
    'o15': (1, _unary(ca.OP_FABS)),
    'o16': (1, _unary(ca.OP_NEG)),
    'o37': (1, _unary(ca.OP_TANH)),
    'o38': (1, _unary(ca.OP_TAN)),
    'o39': (1, _unary(ca.OP_SQRT)),
    'o40': (1, _unary(ca.OP_SINH)),
    'o41': (1, _unary(ca.OP_SIN)),
    'o42': (1, ca.log10),
    'o43': (1, _unary(ca.OP_LOG)),
    'o44': (1, _unary(ca.OP_EXP)),
    'o45': (1, _unary(ca.OP_COSH)),
    'o46': (1, _unary(ca.OP_COS)),
    'o49': (1, _unary(ca.OP_ATAN)),
    'o51': (1, _unary(ca.OP_ASIN)),
    'o53': (1, _unary(ca.OP_ACOS)),
    'o54': (None, lambda *terms: reduce(_PLUS, terms)),
}
#: Operations of if-then-else, whose conditions are inequalities.
CONDITIONAL = {
    'o21': (2, _binary(ca.OP_AND)),
    'o22': (2, _binary(ca.OP_LT)),
    'o23': (2, _binary(ca.OP_LE)),
    'o35': (3, ca.if_else),
}
#: An if-then-else whose condition is no inequality.
OTHER_CONDITION = re.compile(r'o35\n(?!o2[123]\n)')
#: A number in a template, and what stands in its place where it may differ.
NUMBER, MARK = re.compile(r'n([^\n]+)\n'), 'c\n'
#: Halves up to this size are structure, such as exponents and signs; all other numbers are data.
STRUCTURE = 4.0
#: Named expressions in one part; those with more are not compared with others.
LONGEST = 50


class Unsupported(Exception):
    """A function or a number that cannot be evaluated."""


@dataclass(frozen=True)
class Canonical:
    """A nonlinear part by its ``form`` (hashable), ids of its ``variables``, each once, and its ``constants``."""

    form: tuple
    variables: list
    constants: list


class NonlinearParts:
    """Forms and values of nonlinear parts.

    Parameters
    ----------
    named : dict, named expressions by id, the cache of ``AMPLRepnVisitor``
    conditions : bool, whether if-then-else is accepted
    """

    def __init__(self, named, conditions=False):
        self._operations = OPERATIONS | (CONDITIONAL if conditions else {})
        self._named, self._split, self._templates = named, {}, {}

    def canonical(self, template, arguments) -> Canonical | None:
        """Return the canonical form of a part, None if it contains too many named expressions."""
        form, places, constants, waiting = [], {}, [], [(template, arguments)]
        inner = 0
        for text, ids in waiting:
            structure, numbers = self._structure(text)
            constants += numbers
            for k in ids:
                if k not in places:
                    if k in self._named:
                        inner += 1
                        if inner > LONGEST:
                            return None
                        places[k] = -inner
                        waiting.append(self._template(k))
                    else:
                        places[k] = len(places) - inner
            form.append((structure, tuple([places[k] for k in ids])))
        return Canonical(tuple(form), [k for k, place in places.items() if place >= 0], constants)

    def variables(self, parts) -> set:
        """Return the ids of the variables of some parts, each a template with its arguments."""
        found = {k for _, arguments in parts for k in arguments}
        waiting = list(found)
        while waiting:
            k = waiting.pop()
            if k in self._named:
                new = set(self._template(k)[1]) - found
                found |= new
                waiting += new
        return {k for k in found if k not in self._named}

    def value(self, template, arguments, values):
        """Return a part at ``values`` (casadi, by id), which gets those of its named expressions as well."""
        for k in self._inner(arguments, values):
            text, ids = self._template(k)
            values[k] = evaluate(text, [values[i] for i in ids], self._operations)
        return evaluate(template, [values[k] for k in arguments], self._operations)

    def of_form(self, form, variables, constants):
        """Return the value of a canonical form at its variables and constants (lists of casadi scalars).

        Raises
        ------
        Unsupported
            for functions without a counterpart
        """
        ends, known = list(accumulate(structure.count(MARK) for structure, _ in form)), {}

        def part(k):
            if k not in known:
                structure, places = form[k]
                own = constants[ends[k] - structure.count(MARK) : ends[k]]
                values = [variables[i] if i >= 0 else part(-i) for i in places]
                known[k] = evaluate(structure, values, self._operations, own)
            return known[k]

        return part(0)

    def _structure(self, text):
        """The template with marks in place of the numbers that are data, and these numbers."""
        if text not in self._split:
            numbers = []

            def replaced(match):
                number = float(match[1])
                if abs(number) <= STRUCTURE and (2 * number).is_integer():
                    return match[0]
                numbers.append(number)
                return MARK

            self._split[text] = NUMBER.sub(replaced, text), numbers
        return self._split[text]

    def _template(self, k):
        """Template and arguments of a named expression."""
        if k not in self._templates:
            repn = self._named[k][1].duplicate()
            repn.nl = None
            self._templates[k] = repn.compile_repn()[:2]
        return self._templates[k]

    def _inner(self, arguments, known):
        """The named expressions among ``arguments`` and among theirs that are not ``known``, those that others need first."""
        found, waiting = set(), [k for k in arguments if k in self._named and k not in known]
        while waiting:
            k = waiting.pop()
            if k not in found:
                found.add(k)
                waiting += [i for i in self._template(k)[1] if i in self._named and i not in known]
        return self._in_order(found)

    def _in_order(self, found):
        """By the visitor's order, in which inner ones are first."""
        if len(found) < 2:
            return list(found)
        if len(self._order) != len(self._named):
            self._order = {k: i for i, k in enumerate(self._named)}
        return sorted(found, key=self._order.__getitem__)

    _order = {}


def _finite(text):
    number = float(text)
    if not isfinite(number):
        raise Unsupported(text)
    return number


def evaluate(text, values, operations, constants=()):
    """Return the value of a template at the ``values`` of its arguments and the ``constants`` of its marks.

    ``operations`` are those that are accepted.

    Raises
    ------
    Unsupported
        for functions without a counterpart
    """
    if OTHER_CONDITION.search(text):
        raise Unsupported('o35')
    values, constants, stack = list(values), list(constants), []
    for line in reversed(text.replace('%s', 'v\n').splitlines()):
        if line == 'v':
            stack.append(values.pop())
        elif line == 'c':
            stack.append(constants.pop())
        elif line[0] == 'n':
            stack.append(ca.SX(_finite(line[1:])))
        elif line.isdecimal():
            stack.append(int(line))
        elif line in operations:
            count, operation = operations[line]
            count = stack.pop() if count is None else count
            stack.append(operation(*(stack.pop() for _ in range(count))))
        else:
            raise Unsupported(line)
    return stack.pop()
