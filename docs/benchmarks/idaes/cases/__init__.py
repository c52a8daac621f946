"""Dynamic models from idaes-pse's own tests and examples, each with one switch added, by family."""

from benchmarks.idaes.cases import beds, control, reactors, units
from benchmarks.idaes.cases.case import Case as Case

#: Models by their names in the rows.
CASES = reactors.CASES | units.CASES | control.CASES | beds.CASES
