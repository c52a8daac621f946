"""An event-located reference for a flowsheet with Disjunctions over time, which uses nothing of pyomo_fesd.

``equations`` reads the equations of one time from the model before any transformation, by their indices and Pyomo's NL file;
``radau`` integrates them by steps of Radau's scheme (order 5) of controlled length and ends a step where a mode ends.
"""

from benchmarks.idaes.reference.equations import Equations as Equations
from benchmarks.idaes.reference.radau import Failure as Failure
from benchmarks.idaes.reference.radau import Path as Path
from benchmarks.idaes.reference.radau import integrate as integrate
