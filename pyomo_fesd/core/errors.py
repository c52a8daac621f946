"""The exception of the package: its message names the component, the cause and the fix."""

from pyomo.common.errors import PyomoException


class FesdError(PyomoException):
    """A model that cannot be transformed or solved.

    The message has three parts: the component with its index, the cause, and the fix.
    The model is left as it was before the call.
    """

    def __init__(self, component, cause: str, fix: str):
        self.component = getattr(component, 'name', component)
        self.cause = cause
        self.fix = fix
        super().__init__(f"{self.component}: {cause}\n    Fix: {fix}")

    def __reduce__(self):
        # by default an exception is pickled with its message alone, from which it cannot be made again
        return type(self), (self.component, self.cause, self.fix)


class KeywordError(FesdError, ValueError):
    """A keyword that is unknown, or has a value that it cannot have; a ValueError too, as in Pyomo."""
