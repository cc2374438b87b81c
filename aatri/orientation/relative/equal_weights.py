"""Relative orientation by the classical equations of y-parallax with equal weights.

    q            Q = N1 Y1 - By - N2 Y2 = B . (r1 x r2) / D,   D = X1 Z2 - X2 Z1     the y-parallax of the model point
    determinant  F = B . (r1 x r2)                                                    the triple product itself

r1 and r2 are the rays in the frame of the method, B the base with Bx = 1: dependent, the frame of the left image,
turned by a quarter about z where the camera is mounted across (`elements.along_track`: without it D is near zero);
independent, the frame with its X axis along the base (B = (1, 0, 0)). sum Q^2 or sum F^2 over the points is least.
Both are zero where the rays meet; as observations they differ from the rigorous condition by their weights: Q has
the standard deviation s_F / D, the same for all points only in near-vertical images of flat ground. The a-priori
covariance is therefore that of the linear estimator, (A'A)^-1 A' S A (A'A)^-1 with the true variances S; sigma0
compares the residuals with their mean standard deviation. All pairs are adjusted together by Gauss-Newton, from the
rigorous solution and with the points that it did not reject.

Source: docs/formulas.md 3.2; errata E08, E09 (exact derivatives instead of the small-angle coefficients).
"""

from typing import Literal

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.vectors import tangents, unit
from aatri.orientation.relative.elements import along_track, left_rotation, turn_of_left
from aatri.orientation.relative.orientations import ImagePairs, RelativeOrientations, refresh_points

Equation = Literal["rigorous", "q", "determinant"]

ITERATIONS = 20
SETTLED_RAD = 1e-11
"""Largest step at which the iteration ends."""


def equation_rows(
    equation: str, frame: str, R: Float, base: Float, T: Float, rays: RayPairs, axes: Float | None = None
) -> tuple[Float, Float, Float]:
    """Values of the equations, their derivatives to d and t, and standard deviations.

    Parameters
    ----------
    equation : {'q', 'determinant'}
    frame : {'dependent', 'independent'}
    R, base, T : (n, 3, 3), (n, 3), (n, 3, 2) float64
        Orientation of each point's pair, and the tangents of its base.
    rays : RayPairs
        n points.
    axes : (n, 3, 3) float64, optional
        Of the dependent frame, from the left image; default `along_track` of the base.

    Returns
    -------
    v : (n,) float64, mm^2 (determinant) or units of Bx (q)
    J : (n, 5) float64
    sigma : (n,) float64
        Of v, from the image coordinates.
    """
    if axes is None or frame == "independent":
        axes = left_rotation(base) if frame == "independent" else along_track(base)
    G = axes
    by_t = turn_of_left(base) @ T if frame == "independent" else np.zeros_like(T)
    r1 = _times(G, rays.left)
    r2 = _times(G, _times(R, rays.right))
    B = _times(G, base)
    # turns of the right ray by d, of both rays and of the base by t
    by_right = np.concatenate([G, by_t], axis=2)
    by_left = np.concatenate([np.zeros_like(G), by_t], axis=2)
    dr1, dr2 = _turned(by_left, r1), _turned(by_right, r2)
    dB = np.concatenate([np.zeros_like(G), G @ T + _turned(by_t, B)], axis=2)
    cross = np.cross(r1, r2)
    F = np.einsum("ni,ni->n", B, cross)
    dF = np.einsum("niu,ni->nu", dB, cross) + np.einsum("niu,ni->nu", dr1, np.cross(r2, B))
    dF += np.einsum("niu,ni->nu", dr2, np.cross(B, r1))
    scale, d_scale = B[:, 0], dB[:, 0]
    if equation == "q":
        D = r1[:, 0] * r2[:, 2] - r2[:, 0] * r1[:, 2]
        dD = (dr1[:, 0] * r2[:, 2:] + r1[:, :1] * dr2[:, 2]) - (dr2[:, 0] * r1[:, 2:] + r2[:, :1] * dr1[:, 2])
        d_scale = d_scale * D[:, None] + scale[:, None] * dD
        scale = scale * D
    v = F / scale
    J = (dF - v[:, None] * d_scale) / scale[:, None]
    of_left, of_right = _times(G.swapaxes(1, 2), np.cross(r2, B)), _times((G @ R).swapaxes(1, 2), np.cross(B, r1))
    s_F = np.sqrt(((of_left[:, :2] * rays.left_sigma) ** 2 + (of_right[:, :2] * rays.right_sigma) ** 2).sum(axis=1))
    return v, J, s_F / np.abs(scale)


def adjusted_with_equal_weights(
    equation: str, frame: str, R: Float, base: Float, rays: RayPairs, pair: Int
) -> tuple[Float, Float, Float, Float, Int]:
    """Orientations of m pairs by sum v^2 = min.

    Parameters
    ----------
    R, base : (m, 3, 3), (m, 3) float64
        Start.
    rays : RayPairs
        n points, those used.
    pair : (n,) int
        Pair of each, ascending; every pair has five at least.

    Returns
    -------
    R, base : (m, 3, 3), (m, 3) float64
    covariance : (m, 5, 5) float64
    sigma0 : (m,) float64
        NaN without redundancy.
    iterations : (m,) int64
        0 where it did not converge.
    """
    m, first = len(base), np.searchsorted(pair, np.arange(len(base)))
    iterations = np.zeros(m, dtype=np.int64)
    axes = along_track(base)[pair]  # of the start: a base near 45 degrees must not change them from step to step
    for iteration in range(1, ITERATIONS + 1):
        T = tangents(base)
        v, J, sigma = equation_rows(equation, frame, R[pair], base[pair], T[pair], rays, axes)
        N = np.add.reduceat(J[:, :, None] * J[:, None, :], first)
        step = -np.linalg.solve(N, np.add.reduceat(J * v[:, None], first)[:, :, None])[:, :, 0]
        open_ = iterations == 0
        step[~open_] = 0.0
        R = exp_rotation(step[:, :3]) @ R
        base = unit(base + (T @ step[:, 3:, None])[:, :, 0])
        iterations[open_ & (np.abs(step).max(axis=1) < SETTLED_RAD)] = iteration
        if (iterations > 0).all():
            break
    T = tangents(base)
    v, J, sigma = equation_rows(equation, frame, R[pair], base[pair], T[pair], rays, axes)
    inverse = np.linalg.inv(np.add.reduceat(J[:, :, None] * J[:, None, :], first))
    middle = np.add.reduceat((sigma**2)[:, None, None] * J[:, :, None] * J[:, None, :], first)
    redundancy = np.bincount(pair, minlength=m) - 5
    mean = np.add.reduceat(sigma**2, first) / np.bincount(pair, minlength=m)
    ratio = np.add.reduceat(v**2, first) / np.where(redundancy > 0, redundancy, np.nan) / mean
    return R, base, inverse @ middle @ inverse, np.sqrt(ratio), iterations


def with_equal_weights(
    pairs: ImagePairs, orientations: RelativeOrientations, equation: str, frame: str, orients: Bool
) -> None:
    """Put the orientations of a classical equation in the place of the rigorous ones.

    Parameters
    ----------
    equation, frame
        As of `equation_rows`.
    orients : (n,) bool
        Points that orient, if they are active.
    """
    formed = np.flatnonzero(orientations.formed)
    of_row = np.repeat(np.arange(len(pairs.left)), np.diff(pairs.start))
    rows = np.flatnonzero(orientations.active & orients & orientations.formed[of_row])
    place = np.searchsorted(formed, of_row[rows])
    R, base, covariance, sigma0, iterations = adjusted_with_equal_weights(
        equation, frame, orientations.left_from_right[formed], orientations.base[formed], pairs.rays.take(rows), place
    )
    for k, pair in enumerate(formed.tolist()):
        if not iterations[k]:
            orientations.formed[pair] = False
            orientations.reasons[pair] = f"the equation {equation} with equal weights does not converge"
            continue
        orientations.left_from_right[pair], orientations.base[pair] = R[k], base[k]
        orientations.covariance[pair], orientations.sigma0[pair] = covariance[k], sigma0[k]
        orientations.iterations[pair] += iterations[k]
        refresh_points(orientations, pairs, pair)


def _times(matrices: Float, vectors: Float) -> Float:
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def _turned(axes: Float, r: Float) -> Float:
    """Change of r when it turns about each of the columns of `axes` (n, 3, u)."""
    return np.asarray(np.cross(axes, r[:, :, None], axis=1))
