"""The one exception of the package: which component, what is the cause, how to fix it."""

from pyomo.common.errors import PyomoException


class FesdError(PyomoException):
    """A model that cannot be transformed or solved as it stands.

    The message has three parts: the component with its index, the cause, and the fix.
    The model is left as it was before the call.
    """

    def __init__(self, component, cause, fix):
        self.component = getattr(component, 'name', component)
        self.cause = cause
        self.fix = fix
        super().__init__(f"{self.component}: {cause}\n    Fix: {fix}")

    def __reduce__(self):
        # an exception is pickled with its message alone, which does not make another one
        return type(self), (self.component, self.cause, self.fix)
