"""Model predictive control with switches, on Pyomo's ``contrib.mpc``: values move on, a deadline holds, every step has an answer.

Read in this order: ``moving_interface`` (``MovingModelInterface``: data into and out of a model on a moving grid), ``shift``
(where each value goes when the horizon moves on), ``first_modes`` and ``states`` (what is given at the first time),
``controller`` (one step: the shifted branch, a simulated one, the full run) with ``step_search`` (its attempts) and
``held_controls`` (other starts), ``prepared_plan`` (solved before the measurement) and ``control_step`` (its answer), ``plant``
and ``receding_horizon`` (the closed loop).
"""

from pyomo_fesd.control.control_step import ControlStep
from pyomo_fesd.control.controller import Controller
from pyomo_fesd.control.moving_interface import MovingModelInterface
from pyomo_fesd.control.plant import Plant
from pyomo_fesd.control.receding_horizon import receding_horizon
