"""Scale of a model from the one before it: both share an image, seen from which common points are equally far.

Model a (images i, j) and model b (images j, k) each have the unit of their own base. With r_a and r_b the distances of
a common point from the projection centre of j in either model, every point gives the scale of b in units of a:

    l = log r_a - log r_b = s + J_a x_a + J_b x_b + e,   scale = exp(s)

e is the error of the image coordinates with the orientations held. Part of it is the same for both models, the ray of
image j: turned towards i by an angle d it shortens r_a by d / tan(g_a) and, mostly, lengthens r_b; g is the angle of
the rays at the point. x_a and x_b are the errors of the two relative orientations, latent unknowns with their
covariance as prior: common to all points of a model, they bend it and are not gross errors. s is the weighted mean
that follows, after data snooping from the median.

Rotations need no common points: they are chained through the common image. The observation equations are those of
`log_scale`; this is the way of a single joint, `strips.joints` sends many through a compiled loop.

Source: docs/formulas.md 3.5 (of the textbook k = (Z2a - Bza) / Z1b, the mean of three points).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.dense import DenseResult, adjust
from aatri.adjustment.statistics.snooping import snoop
from aatri.arrays import Bool, Float, Int
from aatri.orientation.strips.log_scale import ModelRows, log_scales, root_of


@dataclass(frozen=True)
class Model:
    """A model in the frame of its left image, base 1.

    Attributes
    ----------
    left_from_right : (3, 3) float64
    base : (3,) float64
    orientation_covariance : (5, 5) float64, rad^2
        Of the rotation increment and the turn of the base along its tangents.
    point : (n,) int, ascending
    xyz : (n, 3) float64
    covariance : (n, 3, 3) float64
        From the image coordinates, orientation held.
    """

    left_from_right: Float
    base: Float
    orientation_covariance: Float
    point: Int
    xyz: Float
    covariance: Float


@dataclass(frozen=True)
class Joint:
    """Scale of a model in the unit of the one before.

    Attributes
    ----------
    scale, sigma : float
    point : (n,) int
        Common points.
    log_scale : (n,) float64
        Logarithm of each point's own scale minus that of `scale`.
    active : (n,) bool
        Points used.
    size, size_sigma, test : (n,) float64
        Estimated gross error of log_scale, its standard deviation and |size| / size_sigma; NaN where uncontrolled.
    spread : float
        Extent of the used points across the track over that of all points of both models.
    """

    scale: float
    sigma: float
    point: Int
    log_scale: Float
    active: Bool
    size: Float
    size_sigma: Float
    test: Float
    spread: float


def common_points(first: Model, second: Model) -> tuple[Int, Int]:
    """Rows of the common points in either model, by point."""
    _, a, b = np.intersect1d(first.point, second.point, assume_unique=True, return_indices=True)
    return a, b


def scale_transfer(first: Model, second: Model, *, snooping_limit: float = 4.0) -> Joint:
    """Scale of the second model in the unit of the first; the right image of the first is the left of the second.

    Parameters
    ----------
    first, second : Model
        At least one common point.
    snooping_limit : float
        Points whose scale is wrong by more than this many standard deviations are rejected, where three or more
        points allow to tell which.

    Returns
    -------
    Joint
    """
    a, b = common_points(first, second)
    observed, sigma, J = log_scales(_rows(first, a), _rows(second, b))
    result, active = _adjusted(observed, sigma, J, snooping_limit)
    v = (J @ result.state - observed) / sigma
    r = _cofactor(J / sigma[:, None], result, active)
    scale = float(np.exp(result.state[-1]))
    return Joint(
        scale=scale, sigma=scale * float(np.sqrt(result.covariance[-1, -1])), point=first.point[a],
        log_scale=observed - result.state[-1], active=active,
        size=np.where(active, -v / r, -v) * sigma, size_sigma=sigma * np.where(active, r**-0.5, r**0.5),
        test=np.abs(v) / np.sqrt(r), spread=_spread(first, second, b[active]),
    )  # fmt: skip


def _rows(model: Model, rows: Int) -> ModelRows:
    n = len(rows)
    return ModelRows(
        model.xyz[rows], model.covariance[rows],
        np.broadcast_to(model.base, (n, 3)), np.broadcast_to(model.left_from_right, (n, 3, 3)),
        np.broadcast_to(root_of(model.orientation_covariance), (n, 5, 5)),
    )  # fmt: skip


def _adjusted(observed: Float, sigma: Float, J: Float, limit: float) -> tuple[DenseResult[Float], Bool]:
    """Weighted mean with latent orientation errors; one or two points are all used."""
    n, u = J.shape
    start = np.zeros(u)
    start[-1] = np.median(observed)
    prior = np.eye(u)[:-1]

    def linearise(state: Float) -> tuple[Float, Float]:
        v, rows = (J @ state - observed) / sigma, J / sigma[:, None]
        return v[:, None], rows[:, None]

    def solve(active: Bool, state: Float) -> DenseResult[Float]:
        def of_active(x: Float) -> tuple[Float, Float]:
            v, rows = linearise(x)
            return np.concatenate([v[active, 0], x[:-1]]), np.concatenate([rows[active, 0], prior])

        return adjust(of_active, lambda x, step: x + step, state, what="scale transfer")

    everything = np.ones(n, dtype=bool)
    if n < 3:
        return solve(everything, start), everything
    deviation = np.abs(observed - start[-1])
    total = np.sqrt(sigma**2 + (J[:, :-1] ** 2).sum(axis=1))
    near = deviation <= np.maximum(2 * limit * total, 5 * np.median(deviation))
    snooped = snoop(solve, linearise, start, n, limit=limit, max_share=min(0.5, (n - 2.5) / n),
                    active=near if near.sum() > n / 2 else everything)  # fmt: skip
    return snooped.result, snooped.active


def _cofactor(J: Float, result: DenseResult[Float], active: Bool) -> Float:
    """Redundancy number of each used point, variance factor of the prediction of the others; NaN if uncontrolled."""
    leverage = np.einsum("ni,ij,nj->n", J, result.covariance, J)
    r = np.where(active, 1.0 - leverage, 1.0 + leverage)
    return np.asarray(np.where(r > 1e-6, r, np.nan))


def _spread(first: Model, second: Model, used: Int) -> float:
    """Extent across the track of the connection points, over that of all points, as seen from the common image."""
    b = second.base
    across = np.array([-b[1], b[0], 0.0])
    seen = np.concatenate([(first.xyz - first.base) @ first.left_from_right, second.xyz])
    of_all = (seen @ across) / np.abs(seen[:, 2])
    of_used = (second.xyz[used] @ across) / np.abs(second.xyz[used, 2])
    extent = float(np.ptp(of_all))
    return float(np.ptp(of_used)) / extent if extent > 0 and len(used) else 0.0
