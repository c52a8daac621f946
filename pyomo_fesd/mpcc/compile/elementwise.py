"""A scalar function evaluated for many instances at once, one operation after the other on columns.

casadi's ``map`` calls the function once for each instance, which takes longer than a short function itself; for long functions of
few instances ``row_classes`` uses it all the same.
"""

import casadi as ca


def elementwise(function, inputs: list, count: int) -> list:
    """Return the outputs of an SX function for ``count`` instances, as columns.

    Parameters
    ----------
    function : casadi Function with one output
    inputs : list of lists of columns (DM, SX or MX), for each input its elements
    """
    work, outputs = {}, [0.0] * function.numel_out(0)
    kind = next(type(column) for columns in inputs for column in columns if columns)
    for k in range(function.n_instructions()):
        code, into, out_of = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if code == ca.OP_OUTPUT:
            outputs[into[1]] = work[out_of[0]]
        elif code == ca.OP_INPUT:
            work[into[0]] = inputs[out_of[0]][out_of[1]]
        elif code == ca.OP_CONST:
            work[into[0]] = kind(function.instruction_constant(k))
        else:
            values = [work[element] for element in out_of]
            work[into[0]] = kind.unary(code, *values) if len(values) == 1 else kind.binary(code, *values)
    return [kind.ones(count, 1) * output if output.numel() != count else output for output in map(kind, outputs)]
