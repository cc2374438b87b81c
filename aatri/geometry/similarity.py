"""Similarity in space: X = T + s R x, seven parameters, any rotation.

Closed form (Horn 1987; Umeyama 1991): with weighted centroids x0, X0 and M = sum w (X - X0)(x - x0)' = U D V',

    R = U diag(1, 1, det(U V')) V',   s = sum w (X - X0)'R(x - x0) / sum w |x - x0|^2,   T = X0 - s R x0.

Derivatives belong to the unknowns (T, d, m) of the updates T <- T + dT, R <- exp([d]x) R, s <- s exp(m):

    dX = dT + [s R x]x' d + s R x m.

Callers reduce both systems to their centroids, or the rotation about the origin and the shift are nearly dependent.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float
from aatri.errors import GeometryError
from aatri.geometry.limits import COLLAPSED_SCALE
from aatri.geometry.rotations import exp_rotation, nearest_rotation, skew

UNKNOWNS = 7
"""T (3), rotation increment d (3), logarithm of the scale."""

ITERATIONS = 50
"""At most; they end before where nothing changes."""


@dataclass(frozen=True)
class Similarity:
    """X = translation + scale * rotation @ x."""

    translation: Float
    """(3,), unit of the target."""
    scale: float
    """Target unit per source unit."""
    rotation: Float
    """(3, 3), target from source."""


IDENTITY = Similarity(np.zeros(3), 1.0, np.eye(3))


def transform(similarity: Similarity, x: Float) -> Float:
    """Points in the target system.

    Parameters
    ----------
    x : (n, 3) float64, source unit

    Returns
    -------
    (n, 3) float64, target unit

    Examples
    --------
    >>> transform(Similarity(np.array([10.0, 0.0, 0.0]), 2.0, np.eye(3)), np.array([[1.0, 2.0, 3.0]]))
    array([[12.,  4.,  6.]])
    """
    return np.asarray(similarity.translation + similarity.scale * x @ similarity.rotation.T)


def transform_covariance(similarity: Similarity, covariance: Float) -> Float:
    """Covariances of transformed points, the similarity held: s^2 R C R'.

    Parameters
    ----------
    covariance : (n, 3, 3) float64, source unit squared
    """
    R = similarity.rotation
    return np.asarray(similarity.scale**2 * (R @ covariance @ R.T))


def jacobian(similarity: Similarity, x: Float) -> Float:
    """Derivatives of the transformed points by T, d and the logarithm of the scale.

    Returns
    -------
    (n, 3, 7) float64
    """
    return motions(similarity.scale * x @ similarity.rotation.T)


def motions(arm: Float) -> Float:
    """How shift, rotation and change of scale about the origin move places, (n, 3) -> (n, 3, 7)."""
    J = np.empty((len(arm), 3, UNKNOWNS))
    J[:, :, :3] = np.eye(3)
    J[:, :, 3:6] = -skew(arm)
    J[:, :, 6] = arm
    return J


def motions_about(place: Float) -> Float:
    """Shift, rotation and change of scale about the origin of motions about a place, (3,) -> (7, 7), by columns."""
    about = np.eye(UNKNOWNS)
    about[:3, 3:6], about[:3, 6] = skew(place[None])[0], -place
    return about


def updated(similarity: Similarity, dx: Float) -> Similarity:
    """The similarity after a step (dT, d, m)."""
    return Similarity(
        similarity.translation + dx[:3],
        float(similarity.scale * np.exp(dx[6])),
        exp_rotation(dx[3:6]) @ similarity.rotation,
    )


def compose(outer: Similarity, inner: Similarity) -> Similarity:
    """The similarity `outer(inner(x))`.

    Examples
    --------
    >>> doubled = Similarity(np.array([10.0, 0.0, 0.0]), 2.0, np.eye(3))
    >>> twice = compose(doubled, doubled)
    >>> twice.scale, twice.translation
    (4.0, array([30.,  0.,  0.]))
    """
    return Similarity(
        transform(outer, inner.translation[None])[0],
        outer.scale * inner.scale,
        outer.rotation @ inner.rotation,
    )


def inverse(similarity: Similarity) -> Similarity:
    """The similarity from target to source.

    Examples
    --------
    >>> half = inverse(Similarity(np.array([10.0, 0.0, 0.0]), 2.0, np.eye(3)))
    >>> half.scale, half.translation + 0.0
    (0.5, array([-5.,  0.,  0.]))
    """
    R = similarity.rotation.T
    return Similarity(-R @ similarity.translation / similarity.scale, 1.0 / similarity.scale, R)


def closed_form(x: Float, X: Float, weight: Float | None = None) -> Similarity:
    """Least-squares similarity of points known in both systems, without initial values.

    Parameters
    ----------
    x, X : (n, 3) float64
        Source and target; at least three points that are not on a line.
    weight : (n,) float64, optional
        One weight per point.

    Examples
    --------
    >>> x = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    >>> found = closed_form(x, 2.0 * x + [5.0, 0.0, 0.0])
    >>> round(found.scale, 9), found.translation.round(9) + 0.0
    (2.0, array([5., 0., 0.]))
    """
    w = np.ones(len(x)) if weight is None else weight
    w = w / w.sum()
    x0, X0 = w @ x, w @ X
    dx, dX = x - x0, X - X0
    rotation = nearest_rotation((w[:, None] * dX).T @ dx)
    turned = dx @ rotation.T
    scale = float((w * (dX * turned).sum(1)).sum() / (w * (dx**2).sum(1)).sum())
    return Similarity(X0 - scale * rotation @ x0, scale, rotation)


def centroid_normals(a: Float, weight: Float) -> Float:
    """Normal matrix of shift, rotation and scale for arms reduced to their centroid, (7, 7): it falls apart.

        N = diag( W I,  sum w (|a|^2 I - a a'),  sum w |a|^2 ),      a = s R (x - x0),   W = sum w

    as sum w a = 0 parts the shift from the rest, and a' (a x d) = 0 the scale from the rotation.
    """
    squares = float((weight * (a**2).sum(axis=1)).sum())
    N = np.zeros((UNKNOWNS, UNKNOWNS))
    N[:3, :3] = weight.sum() * np.eye(3)
    N[3:6, 3:6] = squares * np.eye(3) - (weight[:, None] * a).T @ a
    N[6, 6] = squares
    return N


def from_centroids(x: Float, X: Float, start: Similarity, weight: Float | None = None) -> Similarity:
    """Least-squares similarity by the block-diagonal normal equations of centroid-reduced coordinates, iterated.

    Of equal weights in all three coordinates of a point; the shift is found at once, rotation and scale by 3 + 1
    unknowns an iteration.

    Parameters
    ----------
    x, X : (n, 3) float64
        Source and target; at least three points that are not on a line.
    start : Similarity
        Rotation and scale to begin with.
    weight : (n,) float64, optional

    Raises
    ------
    GeometryError
        If the scale falls to nothing, as that of mirrored points does.
    """
    w = np.ones(len(x)) if weight is None else weight
    x0, X0 = w @ x / w.sum(), w @ X / w.sum()
    now = Similarity(np.zeros(3), start.scale, start.rotation)
    for _ in range(ITERATIONS):
        a = transform(now, x - x0)
        v = X - X0 - a
        N = centroid_normals(a, w)
        turn = np.linalg.solve(N[3:6, 3:6], (w[:, None] * np.cross(a, v)).sum(axis=0))
        grown = float((w * (a * v).sum(axis=1)).sum() / N[6, 6])
        now = updated(now, np.concatenate([np.zeros(3), turn, [grown]]))
        if not now.scale > COLLAPSED_SCALE * start.scale:
            raise GeometryError("the points fit no similarity: its scale falls to nothing", remedy="are they mirrored?")
        if max(float(np.abs(turn).max()), abs(grown)) < 1e-15:
            break
    return Similarity(X0 - now.scale * now.rotation @ x0, now.scale, now.rotation)


def robust_closed_form(x: Float, X: Float, iterations: int = ITERATIONS) -> tuple[Similarity, Float]:
    """Similarity with the least sum of distances (not of their squares), by repeated closed forms.

    Weights are divided by the distance of the point in the iteration before (Weiszfeld), so that some wrong points
    among many right ones hardly count.

    Returns
    -------
    distance : (n,) float64, target unit
        Distance of each transformed point from its target.
    """
    # Points that fit exactly would get an infinite weight: distances below this share of the extent count as equal.
    least = 1e-9 * float(np.linalg.norm(X - X.mean(0), axis=1).max()) + np.finfo(float).tiny
    similarity = closed_form(x, X)
    distance = np.linalg.norm(transform(similarity, x) - X, axis=1)
    for _ in range(iterations):
        similarity = closed_form(x, X, 1.0 / np.maximum(distance, least))
        before, distance = distance, np.linalg.norm(transform(similarity, x) - X, axis=1)
        if np.abs(distance - before).max() <= 1e-3 * max(np.median(distance), least):
            break
    return similarity, distance
