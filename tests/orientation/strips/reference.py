"""The scale between two models in NumPy, one joint at a time: the reference of the compiled form (`strips.joints`).

Observation equations, data snooping from the median and statistics as in `strips.joints`; rank by the dense adjustment.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.vectors import tangents, unit
from aatri.orientation.strips.model_errors import root_of
from tests.adjustment.dense import DenseResult, adjust
from tests.adjustment.statistics.snooping import snoop


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
        scale=scale,
        sigma=scale * float(np.sqrt(result.covariance[-1, -1])),
        point=first.point[a],
        log_scale=observed - result.state[-1],
        active=active,
        size=np.where(active, -v / r, -v) * sigma,
        size_sigma=sigma * np.where(active, r**-0.5, r**0.5),
        test=np.abs(v) / np.sqrt(r),
        spread=_spread(first, second, b[active]),
    )


def _rows(model: Model, rows: Int) -> ModelRows:
    n = len(rows)
    return ModelRows(
        model.xyz[rows],
        model.covariance[rows],
        np.broadcast_to(model.base, (n, 3)),
        np.broadcast_to(model.left_from_right, (n, 3, 3)),
        np.broadcast_to(root_of(model.orientation_covariance), (n, 5, 5)),
    )


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
    snooped = snoop(
        solve,
        linearise,
        start,
        n,
        limit=limit,
        max_share=min(0.5, (n - 2.5) / n),
        active=near if near.sum() > n / 2 else everything,
    )
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


@dataclass(frozen=True)
class ModelRows:
    """Points of models, each with what it needs of its model.

    Attributes
    ----------
    xyz : (n, 3) float64
    covariance : (n, 3, 3) float64
        From the image coordinates, orientation held.
    base : (n, 3) float64
    left_from_right : (n, 3, 3) float64
    root : (n, 5, 5) float64
        Root of the covariance of the orientation, `root_of`.
    """

    xyz: Float
    covariance: Float
    base: Float
    left_from_right: Float
    root: Float


def log_scales(first: ModelRows, second: ModelRows) -> tuple[Float, Float, Float]:
    """Observed logarithms of the scale.

    Parameters
    ----------
    first, second : ModelRows
        The same points in both models.

    Returns
    -------
    observed, sigma : (n,) float64
    J : (n, 11) float64
        Derivatives by the latent errors of both orientations, of unit variance, and by the scale's logarithm.
    """
    w_a, X_b = first.xyz - first.base, second.xyz
    observed = np.log(np.linalg.norm(w_a, axis=1) / np.linalg.norm(X_b, axis=1))
    J = np.ones((len(observed), 11))
    J[:, :5] = _times(_from_right(first), first.root)
    J[:, 5:10] = _times(_from_left(second), second.root)
    return observed, np.sqrt(_variances(first, second)), J


def _times(derivatives: Float, root: Float) -> Float:
    return np.asarray((derivatives[:, None, :] @ root)[:, 0])


def _variances(first: ModelRows, second: ModelRows) -> Float:
    """Variance of log r_a - log r_b from the image coordinates, with the correlation through the common image."""
    w_a, X_b = first.xyz - first.base, second.xyz
    variance_a, variance_b = _log_variance(w_a, first.covariance), _log_variance(X_b, second.covariance)
    slope_a, other_a = _ray_slopes(w_a, first.xyz)
    slope_b, other_b = _ray_slopes(X_b, X_b - second.base)
    angle_a = variance_a / (slope_a**2 + other_a**2)
    angle_b = variance_b / (slope_b**2 + other_b**2)
    away_a = (_across(-first.base, w_a)[:, None, :] @ first.left_from_right)[:, 0]
    away_b = _across(second.base, X_b)
    covariance = slope_a * slope_b * _dot(away_a, away_b) * np.sqrt(angle_a * angle_b)
    return np.asarray(variance_a + variance_b - 2 * covariance)


def _dot(a: Float, b: Float) -> Float:
    return np.asarray(np.einsum("ni,ni->n", a, b))


def _log_variance(ray: Float, covariance: Float) -> Float:
    return np.asarray(_dot((covariance @ ray[:, :, None])[:, :, 0], ray) / _dot(ray, ray) ** 2)


def _ray_slopes(ray: Float, other: Float) -> tuple[Float, Float]:
    """Change of log |ray| by a turn of the ray itself and of the other image's ray, in their plane."""
    sine = np.linalg.norm(np.cross(ray, other), axis=1)
    return _dot(ray, other) / sine, _dot(other, other) / sine


def _across(base: Float, ray: Float) -> Float:
    """Direction in which a turn of the ray opens its angle with the base."""
    along = unit(ray)
    return -unit(base - along * _dot(along, base)[:, None])


def _displacement(model: ModelRows) -> tuple[Float, Float, Float, Float]:
    """Derivatives (n, 5) of the way of a point along its left ray, by d and t; left direction; right ray; tangents."""
    X = model.xyz
    w = X - model.base
    T = tangents(model.base)
    across = np.cross(np.cross(X, w), w)
    u = unit(X)
    of_ray = np.concatenate([np.cross(w, across), np.einsum("ni,nik->nk", across, T)], axis=1)
    return of_ray / _dot(across, u)[:, None], u, w, T


def _from_left(model: ModelRows) -> Float:
    """Derivatives (n, 5) of the logarithm of the distance from the left projection centre."""
    along, _, _, _ = _displacement(model)
    return np.asarray(along / np.linalg.norm(model.xyz, axis=1)[:, None])


def _from_right(model: ModelRows) -> Float:
    """Derivatives (n, 5) of the logarithm of the distance from the right projection centre."""
    along, u, w, T = _displacement(model)
    moved = _dot(w, u)[:, None] * along
    moved[:, 3:] -= np.einsum("ni,nik->nk", w, T)
    return np.asarray(moved / _dot(w, w)[:, None])
