"""``fesd.smooth_to_complementarity``: replace absolute values, exact or smoothed, by complementarity pairs (theory, eq. 8).

A source is a Constraint, Objective, Complementarity or named Expression that contains expressions.  Read the files in this order:

transformation.py
    the transformation and its options
sources.py, survey.py, patterns.py
    find the sources, select the absolute values to replace, recognise |z|
rewriting.py, linear_terms.py, rewritten_sources.py
    replace the patterns of one expression and collect like terms; sources that are built alike
generated_blocks.py, summary.py
    hold the new variables and pairs; count the changes

Other rooms use the transformation by its registered name only.
"""

from pyomo_fesd.smoothing.transformation import SmoothToComplementarity
