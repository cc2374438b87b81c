"""Projection centres and points from rays whose directions are known on the ground: all is linear.

    P (X - X0) = v,    P = I - d d'

for every ray of direction d, over its length times its standard deviation, beside what is observed of some X0 and X.
Lengths are those of the solution before, and rays that do not fit weigh less (least absolute deviations). A place is
determined if its standard deviation is below `UNKNOWN_PLACE` of the length of rays; all is solved again without the
others, without rays that are far off, and without points of which half of the rays are.

So a block is placed of which no part is: a control point in each of two strips that share one point, or one that a
single ray shows. Source: Rother & Carlsson 2002, Linear multi view reconstruction and camera recovery.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from aatri.arrays import Float, Int, finite_rows
from aatri.geometry.limits import FAR_OFF_RAYS, FARTHEST_RAD, MOST_CENTRES, UNKNOWN_PLACE
from aatri.geometry.vectors import tangents

STEPS, FAR, EXACT, SHORT = 12, 30.0, 1e-6, 0.1
"""Of reweighting; lengths of rays within which a place lies of which nothing tells; their share known of exact ones,
and that of the shortest: without a scale lengths fall to zero, and their weights would be rounding."""


@dataclass(frozen=True)
class DirectedRays:
    """Rays from centres to points."""

    centre: Int
    point: Int
    """(n,). Among all places."""
    direction: Float
    """(n, 3), of length 1."""
    sigma_rad: Float
    """(n,)."""


@dataclass(frozen=True)
class ObservedPlaces:
    """What is observed of places."""

    place: Int
    """(k,). Among all places."""
    xyz: Float
    sigma: Float
    """(k, 3). Infinite where nothing is known."""


def places_by_rays(rays: DirectedRays, observed: ObservedPlaces, n: int) -> tuple[Float, Float]:
    """Coordinates of n places, (n, 3), NaN where they are not determined, and their covariances, about, (n, 3, 3)."""
    rows = np.arange(len(rays.centre))
    while 0 < len(np.unique(rays.centre[rows])) <= MOST_CENTRES:
        if not np.isin(observed.place, [*rays.centre[rows], *rays.point[rows]]).any():
            break
        taken = DirectedRays(*(getattr(rays, name)[rows] for name in rays.__dataclass_fields__))
        xyz, covariance, off_rad = _solved(taken, observed, n)
        if np.median(off_rad) > FARTHEST_RAD:
            break
        off, firm = off_rad / taken.sigma_rad, finite_rows(xyz[taken.centre]) & finite_rows(xyz[taken.point])
        far = firm & (off > FAR_OFF_RAYS * max(1.0, float(np.median(off))))
        count, most_far = np.bincount(taken.point), np.bincount(taken.point, far)
        far |= (2 * most_far >= count)[taken.point]  # which of two rays is wrong nobody knows
        if (firm & ~far).all():
            return xyz, covariance
        rows = rows[firm & ~far]
    return np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)


def _solved(rays: DirectedRays, observed: ObservedPlaces, n: int) -> tuple[Float, Float, Float]:
    """Places that rays determine, (n, 3), NaN elsewhere, their covariances, about, and what rays are off, rad."""
    centres, points = np.unique(rays.centre), np.unique(rays.point)
    used, column = np.concatenate([centres, points]), np.full(n, -1)
    column[used] = np.arange(len(used))
    centre, point, k, size = column[rays.centre], column[rays.point], len(rays.centre), 3 * len(used)
    at = column[observed.place]
    at, xyz, sigma = at[at >= 0], observed.xyz[at >= 0], observed.sigma[at >= 0]
    of_observed = (3 * at[:, None] + np.arange(3)).ravel()
    values, row = tangents(rays.direction).swapaxes(1, 2).reshape(2 * k, 3), np.arange(2 * k)[:, None]
    entries = [(3 * np.repeat(end, 2)[:, None] + np.arange(3)).ravel() for end in (centre, point)]
    A = csr_array(
        (np.append(-values, values), (np.tile(np.repeat(row, 3), 2), np.concatenate(entries))), shape=(2 * k, size)
    )
    # lengths that are far too long at first: beside such rays all that is known is exact
    length, robust = np.full(k, 10.0 * max(float(np.ptp(xyz, axis=0).max(initial=0.0)), 1.0)), np.ones(k)
    for _ in range(STEPS):
        typical, weight = float(np.quantile(length, 0.9)), np.repeat(robust / (length * rays.sigma_rad) ** 2, 2)
        weight_observed = 1.0 / np.maximum(sigma, EXACT * typical).ravel() ** 2
        diagonal = np.bincount(of_observed, weight_observed, size) + 1.0 / (FAR * typical) ** 2
        N = csc_array(A.T @ diags_array(weight) @ A + diags_array(diagonal))
        factor = splu(N)
        X = factor.solve(np.bincount(of_observed, weight_observed * xyz.ravel(), size)).reshape(-1, 3)
        w = X[point] - X[centre]
        away = np.maximum(np.linalg.norm(w, axis=1), EXACT * typical)
        off_rad = np.arccos(np.clip(np.einsum("ni,ni->n", w, rays.direction) / away, -1.0, 1.0))
        length = np.maximum(away, SHORT * typical)
        off = off_rad / rays.sigma_rad
        robust = 1.0 / np.maximum(off / max(float(np.median(off)), 1.0), 1.0)
    c = len(centres)
    of_centres = factor.solve(np.eye(size, 3 * c))[: 3 * c].reshape(c, 3, c, 3)[np.arange(c), :, np.arange(c)]
    own = N.tobsr((3, 3))
    blocks = own.data[own.indices == np.repeat(np.arange(len(used)), np.diff(own.indptr))]
    C = np.concatenate([of_centres, np.linalg.inv(blocks[c:])])
    share = 1.0 / np.bincount(point, minlength=len(used))[point]
    np.add.at(C, point, of_centres[centre] * share[:, None, None])  # a point moves as its centres do
    C *= max(1.0, float(np.median(off))) ** 2
    ends = np.append(centre, point)
    distance = np.bincount(ends, np.append(length, length)) / np.bincount(ends)
    firm = np.einsum("nii->n", C) < (UNKNOWN_PLACE * distance) ** 2
    places, covariance = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    places[used[firm]], covariance[used[firm]] = X[firm], C[firm]
    return places, covariance, off_rad
