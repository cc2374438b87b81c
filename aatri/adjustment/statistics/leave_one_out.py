"""Which one of a kind is wrong, and whether that can be told: each record is left out in turn.

One record too many is in the adjustment. To leave out record j lets the sum of squares fall by

    gain_j = v_j' R_j^-1 v_j        with R_j = I - H_j, v_j whitened: what its own estimated gross error explains

in the linear model exactly, whatever the start, the path and the order. Several gains that differ by less than
`SEPARABLE` explain the same (two contradicting bars; the four corners of a stretched sheet): nothing tells which is
wrong, all are named, and all go or none.

Source: Baarda 1968; Foerstner 1983, Reliability and discernability of extended Gauss-Markov models.
"""

import numpy as np

from aatri.adjustment.statistics.limits import AS_GOOD_GAIN, CONTROLLED_DIRECTION, SEPARABLE
from aatri.arrays import Bool, Float


def gains_of_leaving_out(v: Float, H: Float) -> Float:
    """What the sum of squares falls by without each record alone, (n,).

    Parameters
    ----------
    v : (n, m) float64
        Whitened residuals, of an adjustment with all of them; zero for components that are not observed.
    H : (n, m, m) float64
        Covariances of the whitened adjusted values.

    Examples
    --------
    A mean of three values, of which the last is off:

    >>> v = np.array([[1.0], [1.0], [-2.0]])
    >>> gains_of_leaving_out(v, np.full((3, 1, 1), 1 / 3)).round(9)
    array([1.5, 1.5, 6. ])
    """
    values, vectors = np.linalg.eigh(np.eye(v.shape[1]) - H)
    along = np.einsum("nji,nj->ni", vectors, v)
    controlled = values > CONTROLLED_DIRECTION
    return np.asarray(np.where(controlled, along**2 / np.where(controlled, values, 1.0), 0.0).sum(axis=1))


def as_good(gain: Float) -> Bool:
    """Records whose leaving out explains as much as that of the best, (n,): one of them is wrong.

    Parameters
    ----------
    gain : (n,) float64
        NaN where a record is not to be left out.
    """
    finite_gain = np.where(np.isfinite(gain), gain, -np.inf)
    most = float(finite_gain.max(initial=0.0))
    return np.asarray(finite_gain >= most - max(SEPARABLE, AS_GOOD_GAIN * most))
