"""Projection centres and points from rays whose directions are known on the ground: all is linear.

    P (X - X0) = v,    P = I - d d'

for every ray of direction d, over its length times its standard deviation, beside what is observed of some X0 and X.
Lengths are those of the solution before, and rays that do not fit weigh less (least absolute deviations). A place is
determined if its standard deviation is below `UNKNOWN_PLACE` of the length of rays; all is solved again without the
others, without rays that are far off, and without points of which half of the rays are.

So a block is placed of which no part is: a control point in each of two strips that share one point, or one that a
single ray shows. Source: Rother & Carlsson 2002, Linear multi view reconstruction and camera recovery.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import bsr_array

from aatri.arrays import Float, Int, finite_rows, sums_of
from aatri.geometry.limits import FAR_OFF_RAYS, FARTHEST_RAD, MOST_CENTRES, MOST_POINTS, UNKNOWN_PLACE

PASSES, SHARPEST_RAD = 10, 3e-5
"""Without what does not fit: of more the block is no start. Standard deviation of the most exact rays: beside
weights of sharper ones what is open is rounding."""

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

    @property
    def few_enough(self) -> bool:
        """Whether they are solved: at most `MOST_CENTRES` and `MOST_POINTS` are."""
        return 0 < len(np.unique(self.centre)) <= MOST_CENTRES and len(np.unique(self.point)) <= MOST_POINTS


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
    rays = replace(rays, sigma_rad=np.maximum(rays.sigma_rad, SHARPEST_RAD))
    rows = np.argsort(rays.centre, kind="stable")
    for _ in range(PASSES if rays.few_enough else 0):
        if not np.isin(observed.place, np.concatenate([rays.centre[rows], rays.point[rows]])).any():
            break
        taken = DirectedRays(*(getattr(rays, name)[rows] for name in rays.__dataclass_fields__))
        try:
            xyz, covariance, off_rad = _solved(taken, observed, n)
        except np.linalg.LinAlgError:
            break
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
    """Places that rays determine, (n, 3), NaN elsewhere, their covariances, about, and what rays are off, rad.

    Rays are ordered by centre. Points are eliminated: with N_pp = sum of w P = L L', 3 x 3 for each, and Z = L^-1 N_pc
    the centres have N_cc - Z'Z. The inverse of N_pp would be rounding where one ray shows a point.
    """
    centres, centre = np.unique(rays.centre, return_inverse=True)
    points, point = np.unique(rays.point, return_inverse=True)
    c, p, k, used = len(centres), len(points), len(rays.centre), np.concatenate([centres, points])
    column, ends, of_centre = np.full(n, -1), np.append(centre, c + point), np.searchsorted(centre, np.arange(c + 1))
    column[used] = np.arange(c + p)
    at = column[observed.place]
    at, xyz, sigma = at[at >= 0], observed.xyz[at >= 0], observed.sigma[at >= 0]
    P = np.eye(3) - rays.direction[:, :, None] * rays.direction[:, None, :]
    # lengths that are far too long at first: beside such rays all that is known is exact
    length, robust = np.full(k, 10.0 * max(float(np.ptp(xyz, axis=0).max(initial=0.0)), 1.0)), np.ones(k)
    for _ in range(STEPS):
        typical = float(np.quantile(length, 0.9))
        wP = (robust / (length * rays.sigma_rad) ** 2)[:, None, None] * P
        weight = 1.0 / np.maximum(sigma, EXACT * typical) ** 2
        diagonal, right = sums_of(weight, at, c + p) + 1.0 / (FAR * typical) ** 2, sums_of(weight * xyz, at, c + p)
        N = sums_of(np.concatenate([wP, wP]), ends, c + p) + diagonal[:, :, None] * np.eye(3)
        L = np.linalg.cholesky(N[c:])
        Z, y = np.linalg.solve(L[point], wP), np.linalg.solve(L, right[c:, :, None])[:, :, 0]
        eliminated = bsr_array((Z.swapaxes(1, 2), point, of_centre), shape=(3 * c, 3 * p))
        S = -(eliminated @ eliminated.T).toarray().reshape(c, 3, c, 3)
        S[np.arange(c), :, np.arange(c)] += N[:c]
        S = S.reshape(3 * c, 3 * c)
        reduced = right[:c] + sums_of(np.einsum("nji,nj->ni", Z, y[point]), centre, c)
        X_c = cho_solve(cho_factor(S), reduced.ravel()).reshape(c, 3)
        y += sums_of(np.einsum("nij,nj->ni", Z, X_c[centre]), point, p)
        X = np.concatenate([X_c, np.linalg.solve(L.swapaxes(1, 2), y[:, :, None])[:, :, 0]])
        w = X[c + point] - X[centre]
        away = np.maximum(np.linalg.norm(w, axis=1), EXACT * typical)
        off_rad = np.arccos(np.clip(np.einsum("ni,ni->n", w, rays.direction) / away, -1.0, 1.0))
        length = np.maximum(away, SHORT * typical)
        off = off_rad / rays.sigma_rad
        robust = 1.0 / np.maximum(off / max(float(np.median(off)), 1.0), 1.0)
    of_centres = np.linalg.inv(S).reshape(c, 3, c, 3)[np.arange(c), :, np.arange(c)]
    moved = sums_of(of_centres[centre], point, p) / np.bincount(point)[:, None, None]  # a point moves as its centres do
    C = np.concatenate([of_centres, np.linalg.inv(N[c:]) + moved]) * max(1.0, float(np.median(off))) ** 2
    distance = np.bincount(ends, np.append(length, length)) / np.bincount(ends)
    firm = np.einsum("nii->n", C) < (UNKNOWN_PLACE * distance) ** 2
    places, covariance = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    places[used[firm]], covariance[used[firm]] = X[firm], C[firm]
    return places, covariance, off_rad
