"""Relative orientation with the condition of model connection: the scale of a model is an unknown of its orientation.

Model a (images i, j) is oriented already, model b (images j, k) is to be. Its unknowns are the rotation and base of k
(d, t as in `pairs`) and the logarithm s of its scale in units of model a. Two equations for a point of both models,

    Q: the rays are coplanar with the base                          (Sampson distance)
    P: log r_a = s + log r_b(d, t) + J_a x_a                        r: distance from the projection centre of image j

and Q alone for the others. P has the standard deviation of both distances from the image coordinates; x_a, the error of
model a's own orientation, is a latent unknown with its covariance as prior, so that a bent model a does not bend model
b. Points whose P does not fit are rejected there, the largest test statistic first; they stay in the orientation.

With error-free coordinates this is the dependent method with the scale of `strips.joints`; with errors the
connection points, nearly all of which lie across the strip, strengthen the orientation a little.

Source: docs/formulas.md 3.5; errata E08 (the scale's column belongs to the whole base, in P and in Q).
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.coplanarity import RayPairs, sampson
from aatri.geometry.intersection import intersect_pair
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.vectors import tangents, unit
from aatri.orientation.relative.distance_derivatives import log_distances
from aatri.orientation.relative.limits import FEWEST_CONNECTION_POINTS
from aatri.orientation.strips.joints import ModelTable, observed_scales

ITERATIONS = 30
SETTLED = 1e-6
"""Newton decrement that ends the iteration."""


@dataclass(frozen=True)
class Before:
    """The model before, in its own unit and in the frame of its left image."""

    left_from_right: Float
    base: Float
    covariance: Float
    """(3, 3), (3,), (5, 5)."""
    row: Int
    """(c,). Points of the new pair that the model before has."""
    xyz: Float
    point_covariance: Float
    """(c, 3), (c, 3, 3). Of these points, there."""


@dataclass(frozen=True)
class Connected:
    """An orientation connected with the model before."""

    left_from_right: Float
    base: Float
    """(3, 3), (3,)."""
    covariance: Float
    """(5, 5). Of d and t."""
    scale: float
    scale_sigma: float
    """In units of the model before."""
    sigma0: float
    """Of Q and P together."""
    redundancy: int
    iterations: int
    connects: Bool
    """(c,). Connection points used in P."""
    size: Float
    size_sigma: Float
    test: Float
    """(c,). Error of P as logarithm of the scale, its standard deviation and their ratio; NaN where uncontrolled."""


def connected_orientation(
    rays: RayPairs, active: Bool, R: Float, base: Float, before: Before, *, limit: float = 4.0
) -> Connected | None:
    """Adjust a pair together with its scale.

    Parameters
    ----------
    rays : RayPairs
        n points of the pair.
    active : (n,) bool
        Those used in Q.
    R, base : (3, 3), (3,) float64
        Start: the dependent orientation.
    limit : float
        A connection point with a larger test statistic is rejected in P.

    Returns
    -------
    Connected or None
        None where fewer than `FEWEST_CONNECTION_POINTS` connection points remain, or it does not converge.
    """
    use = active[before.row].copy()
    while use.sum() >= FEWEST_CONNECTION_POINTS:
        connected = _adjusted(rays, active, R, base, before, use)
        if connected is None:
            return None
        test = np.where(use, np.nan_to_num(connected.test), 0.0)
        worst = int(test.argmax())
        if test[worst] <= limit or use.sum() <= FEWEST_CONNECTION_POINTS:
            return connected
        use[worst] = False
    return None


def _adjusted(rays: RayPairs, active: Bool, R: Float, base: Float, before: Before, use: Bool) -> Connected | None:
    part, latent, s = rays.take(active), np.zeros(5), 0.0
    for iteration in range(1, ITERATIONS + 1):
        T = tangents(base)
        v_q, J_q = sampson(R, base, T, part)
        observed, sigma, by_latent = _connection(rays, R, base, before)
        if iteration == 1:
            s = float(np.median(observed[use]))
        v_p = (s - observed) / sigma + by_latent @ latent
        by_pair = log_distances(R, base, rays.take(before.row))[1]
        J_p = np.column_stack([by_pair / sigma[:, None], 1.0 / sigma, by_latent])
        A = np.zeros((len(v_q) + int(use.sum()) + 5, 11))
        A[: len(v_q), :5] = J_q
        A[len(v_q) : -5] = J_p[use]
        A[-5:, 6:] = np.eye(5)
        v = np.concatenate([v_q, v_p[use], latent])
        N = A.T @ A
        if not np.isfinite(N).all() or np.linalg.cond(N) > 1e14:
            return None
        inverse = np.linalg.inv(N)
        step = -inverse @ (A.T @ v)
        if np.sqrt(max(step @ N @ step, 0.0)) <= SETTLED:
            break
        R, base = exp_rotation(step[:3]) @ R, unit(base + T @ step[3:5])
        s, latent = s + float(step[5]), latent + step[6:]
    else:
        return None
    leverage = np.einsum("ni,ij,nj->n", J_p, inverse, J_p)
    r = np.where(use, 1.0 - leverage, 1.0 + leverage)
    r = np.asarray(np.where(r > 1e-6, r, np.nan), dtype=np.float64)
    redundancy = len(v) - 11
    squares = float(v @ v)
    sigma0 = float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan")
    covariance = np.asarray(inverse[:5, :5], dtype=np.float64)
    scale, size = float(np.exp(s)), np.where(use, -v_p / r, -v_p) * sigma
    size_sigma = np.asarray(sigma * np.where(use, r**-0.5, r**0.5))
    return Connected(
        R,
        base,
        covariance,
        scale,
        scale * float(np.sqrt(inverse[5, 5])),
        sigma0,
        redundancy,
        iteration,
        use,
        size,
        size_sigma,
        np.abs(v_p) / np.sqrt(r),
    )


def _connection(rays: RayPairs, R: Float, base: Float, before: Before) -> tuple[Float, Float, Float]:
    """log r_a - log r_b, its sigma, and its derivatives over sigma by the latent errors of the model before, (c, 5)."""
    points, c = intersect_pair(R, base, rays.take(before.row)), np.arange(len(before.row))
    both = ModelTable(
        np.stack([before.left_from_right, R]),
        np.stack([before.base, base]),
        np.stack([before.covariance, np.eye(5)]),
        np.array([0, len(c), 2 * len(c)]),
        np.tile(c, 2),
        np.concatenate([before.xyz, points.xyz]),
        np.concatenate([before.point_covariance, points.covariance]),
    )
    observed, sigma, A = observed_scales(both, c, len(c) + c)
    return observed, sigma, A[:, :5]
