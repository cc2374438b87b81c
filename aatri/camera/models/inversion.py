"""Inversion of forward distortion models by Newton's method.

A forward model gives the distorted image of an ideal one, in normalised coordinates (principal distance 1):
u_d = f(u). Here f(u) = u_d is solved, u <- u - F^-1 (f(u) - u_d) with the derivative F, from u = u_d. A root counts
only if f has not folded between the axis and it.

A distortion folds where two places of the ideal image come to lie at one place of the measured one. A map of the plane
has not folded between the axis and a point as long as the determinant of its derivative is positive on the way. It is
tested at all points, and all along the way to the outermost ones, which pass where the others lie.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.errors import ConvergenceError, InputError

Forward = Callable[[npt.NDArray[Any]], tuple[npt.NDArray[Any], npt.NDArray[Any]]]
"""u (n, 2) -> f (n, 2), derivative (n, 2, 2)."""

TOLERANCE = 1e-14
"""Largest remaining misfit, as a share of 1 + |u|."""


MOST_ITERATIONS = 50

OUTERMOST = 1000
"""Number of points the way to which is tested."""

CHUNK = 10_000
"""Points at a time, whose derivatives stay in the cache."""


def invert(forward: Forward, distorted: Float, *, what: str) -> Float:
    """Ideal normalised coordinates of distorted ones.

    Parameters
    ----------
    forward : callable
        The distortion, with its derivative.
    distorted : (n, 2) float64
    what : str
        The model, for messages.

    Raises
    ------
    InputError
        If the model folds between the axis and a point.
    ConvergenceError
        If the iteration does not converge.
    """
    ideal = distorted.copy()
    for _ in range(MOST_ITERATIONS):
        value, derivative = forward(ideal)
        misfit = value - distorted
        size = np.abs(misfit).max(axis=1)
        bound = TOLERANCE * (1.0 + np.abs(distorted).max(axis=1))
        if not (size > bound).any() and np.isfinite(size).all():
            _refuse_folds(forward, ideal, distorted, what)
            return ideal
        ideal = ideal - _bounded_step(derivative, misfit, ideal)
    worst = int(np.nanargmax(np.where(np.isfinite(size), size, np.inf)))
    _refuse_folds(forward, distorted, distorted, what)
    raise ConvergenceError(
        f"{what} distortion cannot be inverted at normalised image coordinates "
        f"({distorted[worst, 0]:.4f}, {distorted[worst, 1]:.4f})",
        remedy="check the distortion parameters and their model",
    )


def _bounded_step(derivative: Float, misfit: Float, ideal: Float) -> Float:
    determinant = np.linalg.det(derivative)
    usable = np.abs(determinant) > 1e-12
    safe = np.where(usable[:, None, None], derivative, np.eye(2))
    step = np.linalg.solve(safe, misfit[..., None])[..., 0]
    length = np.linalg.norm(step, axis=1)
    most = 0.5 * (1.0 + np.linalg.norm(ideal, axis=1))
    return np.asarray(step * np.minimum(1.0, most / np.maximum(length, 1e-300))[:, None])


def _refuse_folds(forward: Forward, ideal: Float, distorted: Float, what: str) -> None:
    row = first_folded(lambda uv: forward(uv)[1], ideal)
    if row is not None:
        raise InputError(
            f"{what} distortion folds inside the format: normalised image coordinates "
            f"({distorted[row, 0]:.4f}, {distorted[row, 1]:.4f}) lie beyond the fold",
            remedy="check the distortion parameters, their signs and their model",
        )


def first_folded(derivative: Callable[[Float], Float], points: Float) -> int | None:
    """The first point that lies beyond a fold, or None.

    Parameters
    ----------
    derivative : callable
        (n, 2) -> (n, 2, 2)
    points : (n, 2) float64
        From the axis.

    Returns
    -------
    int or None
        Row of the point.
    """
    every, most = np.arange(len(points)), min(OUTERMOST, len(points))
    outermost = np.argpartition(-(points**2) @ np.ones(2), most - 1)[:most] if most else every
    chunks = [every[first : first + CHUNK] for first in range(0, len(every), CHUNK)]
    for rows, share in [*((chunk, 1.0) for chunk in chunks), *((outermost, s) for s in np.linspace(0.1, 0.9, 9))]:
        J = derivative(share * points[rows])
        folded = ~(J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0] > 0)
        if folded.any():
            return int(rows[folded].min())
    return None
