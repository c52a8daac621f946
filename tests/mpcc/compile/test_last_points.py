"""Results at the last points: evaluated once, and again after enough others or for other parameters."""

import numpy as np

from pyomo_fesd.mpcc.compile.last_points import KEPT, LastPoints


def test_a_point_is_evaluated_once_until_others_displace_it():
    seen = []
    function = LastPoints(lambda w, p: seen.append((w[0], p[0])) or w[0] * p[0])
    one, p = np.array([1.0]), np.array([3.0])
    assert function(one, p) == function(one.copy(), p) == 3.0 and len(seen) == 1
    assert function(one, np.array([4.0])) == 4.0 and len(seen) == 2
    for k in range(KEPT):
        function(np.array([10.0 + k]), p)
    assert function(one, p) == 3.0 and len(seen) == 3 + KEPT
