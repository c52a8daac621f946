"""Write the multipliers nu_i of a system of modes as complementarity conditions.

Read ``core/step.py`` (the step function of one expression), ``heaviside.py`` (products of steps), ``stewart.py`` (a linear program
over the modes), ``hysteresis.py`` (the last mode goes on where regions overlap).  Each form is a module with the same functions:
``applies`` and ``why_not``; ``size`` and ``count``; ``declare`` at the first time and ``add`` at each time; ``start`` (values of
copies, but for hysteresis, which is not copied); ``weight`` (sums of nu_i); ``owners`` and ``equations``, by which generated
components lead back to their sources.
"""

from pyomo_fesd.dcs.forms import heaviside, hysteresis, stewart
