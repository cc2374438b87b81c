"""Whether so many points fit one orientation by chance.

Five points fit any orientation, each further one with the probability alpha that a wrong one lies as near as the limit
to its epipolar line. There are C(n, k) choices of k out of n points, C(k, 5) of five of these that orient them, and
n - 5 numbers k: of n wrong points

    (n - 5) C(n, k) C(k, 5) alpha^(k - 5)

choices of k fit in the mean. Where this is one and more, k points that fit are no evidence.

Source: Moisan & Stival 2004, A probabilistic criterion to detect rigid point matches between two images.
"""

import numpy as np
from scipy.special import gammaln

from aatri.arrays import Bool, Int
from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.relative.orientations import rows_of_pairs


def fit_by_chance(rays: RayPairs, start: Int, used: Int, limit: float) -> Bool:
    """Pairs of whose points some are left out, while as many as are used would fit by chance, (m,).

    Parameters
    ----------
    start : (m + 1,) int
        First point of each pair.
    used : (m,) int
        Points that fit.
    limit : float
        In standard deviations of a y-parallax.
    """
    chance = (used >= 5) & (used < np.diff(start))
    pairs = np.flatnonzero(chance)
    if not len(pairs):
        return chance
    n, k, rows = np.diff(start)[pairs], used[pairs], rows_of_pairs(start, pairs)
    first, xy = np.cumsum(n) - n, rays.right[rows, :2]
    width = (np.maximum.reduceat(xy, first) - np.minimum.reduceat(xy, first)).min(axis=1)
    variance = np.add.reduceat((rays.left_sigma[rows] ** 2 + rays.right_sigma[rows] ** 2).mean(axis=1), first) / n
    alpha = np.minimum(2.0 * limit * np.sqrt(variance) / np.maximum(width, 1e-300), 1.0)
    choices = np.log(n - 5) + gammaln(n + 1) - gammaln(n - k + 1) - gammaln(k - 4) - gammaln(6)
    chance[pairs] = choices + (k - 5) * np.log(alpha) >= 0.0
    return np.asarray(chance)
