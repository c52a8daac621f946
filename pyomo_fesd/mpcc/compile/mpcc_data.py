"""The data of an MPCC besides its functions."""

from dataclasses import dataclass

import numpy as np


@dataclass
class MpccData:
    """The bounds, start values and facts of an MPCC besides its functions.

    Attributes
    ----------
    lbx, ubx : arrays (n), the variables' bounds with the signs that plain-variable sides imply
    lbg, ubg : arrays (m)
    side_of : int array (2q), equal numbers for equal sides among G (first q) and H
    guided : bool array (n), variables with guide bounds, whose own bounds belong to the method
    guide_lbx, guide_ubx : arrays (n), bounds in the homotopy, tighter for these variables
    x0 : array (n), the model's values projected to the bounds
    parameters : array (l), values of the parameters that a new solve may change
    missing : int, number of variables without a value
    sign : +1.0, or -1.0 for a model that maximises (f is always minimised)
    has_objective : bool
    scale : Scale
    neighbours : list of NeighbourIndices
    coincidences : list of CoincidenceIndices
    arrivals : list of ArrivalIndices
    parts : list of PartIndices
    followers : FollowerIndices
    fillings : list of FillingIndices
    impacts : list of ImpactIndices
    stickings : list of StickingIndices
    drifts : list of DriftIndices
    tentative : bool array, decisions that are dropped where they leave no solution
    """

    lbx: np.ndarray
    ubx: np.ndarray
    lbg: np.ndarray
    ubg: np.ndarray
    side_of: np.ndarray
    guided: np.ndarray
    guide_lbx: np.ndarray
    guide_ubx: np.ndarray
    x0: np.ndarray
    parameters: np.ndarray
    missing: int
    sign: float
    has_objective: bool
    scale: object
    neighbours: list
    coincidences: list
    arrivals: list
    parts: list
    followers: object
    fillings: list
    impacts: list
    stickings: list
    drifts: list
    tentative: np.ndarray
