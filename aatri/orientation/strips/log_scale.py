"""Observation equations of the scale between two models: l = log r_a - log r_b of their common points.

r_a is the distance from the right projection centre of the first model, r_b that from the left one of the second, of
the same image. A turn of a ray in its plane with the base changes log r by cot and 1 / sin of the angle g at the point;
the ray of the common image changes both distances, so that they are correlated. See `scale_transfer`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float
from aatri.geometry.vectors import tangents, unit


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


def root_of(orientation_covariance: Float) -> Float:
    """Matrices (..., 5, 5) that turn unit-variance unknowns into errors of an orientation."""
    values, vectors = np.linalg.eigh(orientation_covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])


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
