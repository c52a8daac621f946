"""Models as idaes-pse's tests build them."""

import contextlib
import inspect


def fixture(owner, name, *arguments):
    """The model of a pytest fixture of a class of tests, or of a module; arguments are other fixtures' models."""
    found = vars(owner)[name]
    function = inspect.unwrap(getattr(found, '_get_wrapped_function', lambda: found)())
    return function(owner(), *arguments) if inspect.isclass(owner) else function(*arguments)


@contextlib.contextmanager
def replaced(module, **members):
    """Other members of a module for a while: a property package, a unit."""
    before = {name: getattr(module, name) for name in members}
    vars(module).update(members)
    try:
        yield
    finally:
        vars(module).update(before)


def made_dynamic(test, owner, end, nfe, name='sapon', complete=None):
    """The model of a fixture of steady tests over time: at rest, inputs held, Radau's scheme with three points in time.

    Parameters
    ----------
    test : module whose ``FlowsheetBlock`` is made dynamic
    owner : class of tests that has the fixture ``name``
    end, nfe : horizon in s, elements
    complete : callable (model), or None
        fixes what a holdup needs besides, such as its volume
    """
    import pyomo.environ as pyo
    from pyomo.dae.flatten import flatten_dae_components

    original = test.FlowsheetBlock
    options = {'dynamic': True, 'time_set': [0, end], 'time_units': pyo.units.s}
    with replaced(test, FlowsheetBlock=lambda **_: original(**options)):
        m = fixture(owner, name)
    if complete is not None:
        complete(m)
    pyo.TransformationFactory('dae.collocation').apply_to(m, wrt=m.fs.time, nfe=nfe, ncp=3)
    for family in flatten_dae_components(m, m.fs.time, pyo.Var)[1]:
        if family[0].fixed:
            for v in family.values():
                v.fix(family[0].value)
    m.fs.fix_initial_conditions('steady-state')
    m.fs.unit.initialize()
    return m


def later(family, value):
    """Another value of an input from the first element on."""
    for t in list(family)[1:]:
        family[t].fix(value)


def finer(nfe):
    """A TransformationFactory that discretises with ``nfe`` elements, for scripts that name a number."""
    import pyomo.environ as pyo

    class Transformation:
        def __init__(self, name):
            self._it = pyo.TransformationFactory(name)

        def apply_to(self, m, **options):
            return self._it.apply_to(m, **(options | {'nfe': nfe}))

    return Transformation


def model_of(test, method):
    """The model that a method of a test builds and solves for itself, taken from its call of ``degrees_of_freedom``."""
    models, count = [], test.degrees_of_freedom

    def counted(m):
        models.append(m)
        return count(m)

    with replaced(test, degrees_of_freedom=counted):
        method()
    return models[-1]
