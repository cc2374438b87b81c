"""Criteria of a layout: how well its points are determined, and what one more control point would gain.

No residual enters: the covariances of an adjustment depend on the geometry and the standard deviations alone, so that a
simulated block says of a planned one what it will be worth. With C the covariance of the coordinates of n points,

    weakest point        sqrt(largest eigenvalue of C_jj)
    criterion matrix     K_ij = (1/2 exp(-|X_i - X_j| / D) + 1/2 [i = j]) diag(s_x^2, s_y^2, s_z^2)
    criterion            lambda = largest eigenvalue of K^-1 C

K is what the layout is meant to reach: errors of equal size everywhere and in every direction of the plan, one half of
their variance shared with the neighbours, as the block has it, one half each point's own, as its rays have it. With
lambda <= 1 no function of the coordinates is determined worse than by K. Control with the covariance S at point k would
give

    C - C_.k (C_kk + S)^-1 C_k.

exactly, without another adjustment. The next control point is that which takes most off the sum of all variances, in
units of s (or off the largest); the second is asked for beside the first.

Source: Baarda 1973 (criterion matrices); Grafarend 1974 (optimization of networks); Koch 1999, 3.5 (more observations).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.sparse.linalg import eigsh
from scipy.spatial.distance import cdist

from aatri.arrays import Float, Int

Aim = Literal["mean", "worst"]


@dataclass(frozen=True)
class Gain:
    """Control at one more point."""

    point: int
    """Row of the point."""
    mean: float
    worst: float
    """Share of the sum of all variances, and of the largest, that it takes away."""


def criterion_eigenvalue(xyz_m: Float, covariance_m2: Float, sigma_m: Float, distance_m: float) -> tuple[float, Float]:
    """Largest eigenvalue of K^-1 C.

    Parameters
    ----------
    xyz_m : (n, 3) float64, m
    covariance_m2 : (n, 3, n, 3) float64, m^2
    sigma_m : (3,) float64, m
        Standard deviations of the criterion.
    distance_m : float, m
        At which what errors share has fallen to 1 / e.

    Returns
    -------
    function : (n, 3) float64
        The function of the coordinates, in units of their criterion, that is determined worst.
    """
    n = len(xyz_m)
    L = cholesky(0.5 * np.exp(-cdist(xyz_m, xyz_m) / distance_m) + 0.5 * np.eye(n), lower=True)
    scaled = covariance_m2 / sigma_m[:, None, None] / sigma_m
    half = solve_triangular(L, scaled.reshape(n, -1), lower=True).reshape(n, 3, n, 3)
    B = solve_triangular(L, half.transpose(2, 3, 0, 1).reshape(n, -1), lower=True).reshape(3 * n, 3 * n)
    B = (B + B.T) / 2
    values, vectors = (B[None, 0], np.ones((1, 1))) if len(B) == 1 else eigsh(B, k=1, which="LA", v0=np.ones(len(B)))
    function = solve_triangular(L.T, vectors[:, 0].reshape(n, 3))
    return float(values[0]), function


def gains(covariance_m2: Float, sigma_m: Float, control_sigma_m: Float, candidates: Int) -> list[Gain]:
    """What control at each of the candidates would gain, alone.

    Parameters
    ----------
    covariance_m2 : (n, 3, n, 3) float64, m^2
    sigma_m : (3,) float64, m
        Units of the variances in X, Y, Z.
    control_sigma_m : (3,) float64, m
        Standard deviations of the new control; infinite where a coordinate is not measured.
    candidates : (m,) int
        Rows of the points asked.
    """
    variance = np.einsum("nini->ni", covariance_m2) / sigma_m**2
    made = []
    for k in candidates.tolist():
        left = variance - (_effect(covariance_m2, k, control_sigma_m) ** 2).sum(axis=2) / sigma_m**2
        made.append(Gain(k, 1 - float(left.sum() / variance.sum()), 1 - float(left.max() / variance.max())))
    return made


def next_control(
    covariance_m2: Float, sigma_m: Float, control_sigma_m: Float, candidates: Int, count: int, aim: Aim
) -> list[Gain]:
    """The control points that gain most, one beside the other; each gain is that beside those before it."""
    C, chosen = covariance_m2, list[Gain]()
    while len(chosen) < min(count, len(candidates)):
        left = np.setdiff1d(candidates, [gain.point for gain in chosen])
        best = max(gains(C, sigma_m, control_sigma_m, left), key=lambda gain: getattr(gain, aim))
        chosen.append(best)
        B = _effect(C, best.point, control_sigma_m)
        C = C - np.einsum("nia,mja->nimj", B, B)
    return chosen


def _effect(C: Float, k: int, control_sigma_m: Float) -> Float:
    """B with B B' = C_.k (C_kk + S)^-1 C_k., (n, 3, coordinates measured)."""
    axes = np.flatnonzero(np.isfinite(control_sigma_m))
    M = C[k, :, k][np.ix_(axes, axes)] + np.diag(control_sigma_m[axes] ** 2)
    right = C[:, :, k][:, :, axes]
    return np.asarray(np.linalg.solve(np.linalg.cholesky(M), right.reshape(-1, len(axes)).T).T.reshape(right.shape))
