"""Threads: work that uses state of the whole process is done by one at a time, and Pyomo's walkers of expressions are their own."""

from threading import RLock

from pyomo.common.multithread import MultiThreadWrapper
from pyomo.core.expr import visitor

#: Held by the thread that transforms a model, and by one that redirects the output of the process or replaces log handlers.
TRANSFORMATION, REDIRECTION = RLock(), RLock()

# Pyomo has one walker for all threads, which would yield the variables of the expression that another thread walks
visitor.identify_variables.visitor = MultiThreadWrapper(visitor.IdentifyVariableVisitor)
visitor.identify_mutable_parameters.visitor = MultiThreadWrapper(visitor.IdentifyMutableParamVisitor)
