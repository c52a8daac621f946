"""``refine``: discretise and solve with as many elements as a tolerance needs.

Files in the order of the data's way: ``refine`` (entry, the loop over rounds), ``checks`` (arguments and models that are refused),
``mesh`` (what a round is discretised by), ``trial_round`` (undoes a round that is not kept), ``round_solver`` (discretises and
solves; ``interpolated_start`` begins at the round before), ``dense_output`` (the solution as numbers that outlive its grid),
``assessment`` (error and next numbers of elements, by ``error_estimate`` and ``element_density``), ``grading`` (fixed points of the
next mesh), ``refinement_result`` (the table).
"""

from pyomo_fesd.refinement.refine import refine
