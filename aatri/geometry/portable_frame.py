"""A portable frame, marks measured once in axes of their own, as distances between them with their full covariance.

    d_ab = |X_b - X_a|,      C_d = J C_X J',      J = dd/dX

Wherever the frame is set up, its distances stay what they are. n marks that do not lie in one plane have 3n - 6 of
them that determine all others and each mark; observed with C_d they are, to first order, the same as the body itself
with six unknowns of place and direction and its marks observed with C_X: those six move no distance, and of 3n
coordinates no more than 3n - 6 are left without them. With a common scale of the distances it is a body of seven
parameters.

Marks in one plane: no distance sees what leaves it, and marks off it by h see it by h over their distance alone, which
an error of h as large makes worthless. So marks are a solid body where they lie off their plane by more than
`SOLID_SIGMAS` standard deviations; else 2n - 3 distances hold them within, and that they lie in a plane is an
observation of its own, with the standard deviation of the marks across it and how far they were measured off it. Three
marks are a triangle, two a bar.

Chosen are those that are known best independently of each other: by a QR decomposition with column pivoting of (J L)',
C_X = L L', of all distances. Source: Mikhail & Ackermann, Observations and Least Squares, 4 (propagation).
"""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from aatri.arrays import Float, Int
from aatri.errors import GeometryError
from aatri.geometry.limits import FLAT_BODY, SOLID_SIGMAS


@dataclass(frozen=True)
class BodyDistances:
    """Distances that hold the shape and size of a body."""

    pairs: Int
    """(k, 2). Marks of each; k = 3n - 6, of marks in a plane 2n - 3."""
    length_m: Float
    """(k,), m."""
    covariance_m2: Float
    """(k, k), m^2."""
    plane_sigma_m: float = float("nan")
    """Standard deviation of a mark across the plane that four or more of them lie in; NaN where they lie in none."""


def body_distances(xyz_m: Float, covariance_m2: Float) -> BodyDistances:
    """The distances that stand for a portable frame.

    Parameters
    ----------
    xyz_m : (n, 3) float64, m
        Marks, n at least 2, in axes of their own.
    covariance_m2 : (3 n, 3 n) float64, m^2
        Of all their coordinates, positive definite.

    Raises
    ------
    GeometryError
        If there are too few marks, two at one place, or all on a line.
    """
    n = len(xyz_m)
    if n < 2:
        raise GeometryError(f"{n} marks are no body", remedy="give two or more")
    pairs = np.array(list(combinations(range(n), 2)), dtype=np.int64)
    away = xyz_m[pairs[:, 1]] - xyz_m[pairs[:, 0]]
    length = np.linalg.norm(away, axis=1)
    if not length.min() > 0:
        raise GeometryError("two marks are at the same place", remedy="give each mark once")
    u = away / length[:, None]
    by_mark = np.zeros((len(pairs), n, 3))
    by_mark[np.arange(len(pairs)), pairs[:, 0]], by_mark[np.arange(len(pairs)), pairs[:, 1]] = -u, u
    J = by_mark.reshape(len(pairs), 3 * n)
    from scipy.linalg import qr  # its import takes a fifth of a second

    _, R, order = qr((J @ np.linalg.cholesky(covariance_m2)).T, mode="economic", pivoting=True)
    pivot = np.abs(np.diagonal(R))
    count, plane_sigma = 3 * n - 6, float("nan")
    off, own = _across(xyz_m, covariance_m2)
    if n < 4 or not (off**2 > SOLID_SIGMAS**2 * own).any() or not pivot[count - 1] > FLAT_BODY * pivot[0]:
        count, plane_sigma = 2 * n - 3, float(np.sqrt((off**2 + own).mean())) if n > 3 else plane_sigma
    if not pivot[count - 1] > FLAT_BODY * pivot[0]:
        raise GeometryError(
            "the marks lie on a line, or nearly: distances do not hold what leaves it",
            remedy="give marks beside it, or their distances and a `line` of relative control",
        )
    chosen = np.sort(order[:count])
    chosen_rows = J[chosen]
    return BodyDistances(pairs[chosen], length[chosen], chosen_rows @ covariance_m2 @ chosen_rows.T, plane_sigma)


def _across(xyz_m: Float, covariance_m2: Float) -> tuple[Float, Float]:
    """How far marks lie off their plane, (n,) m, and their variances across it, (n,) m^2."""
    normal = np.linalg.svd(xyz_m - xyz_m.mean(axis=0))[2][2]
    own = np.einsum("ninj->nij", covariance_m2.reshape(len(xyz_m), 3, len(xyz_m), 3))
    return (xyz_m - xyz_m.mean(axis=0)) @ normal, np.einsum("i,nij,j->n", normal, own, normal)
