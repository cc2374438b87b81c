"""Unit vectors, their tangents, and lengths."""

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float


def unit(v: npt.ArrayLike) -> Float:
    """Vectors of length 1.

    Parameters
    ----------
    v : (..., 3) float64

    Examples
    --------
    >>> unit([3.0, 0.0, 4.0])
    array([0.6, 0. , 0.8])
    """
    v = np.asarray(v, dtype=np.float64)
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def tangents(direction: npt.ArrayLike) -> Float:
    """Two unit vectors orthogonal to a direction and to each other.

    For a direction near +x they are near +y and +z, so that the turn of a base along them is by/bx and bz/bx.

    Parameters
    ----------
    direction : (..., 3) float64, unit vectors

    Returns
    -------
    (..., 3, 2) float64
    """
    b = np.asarray(direction, dtype=np.float64)
    main = np.argmax(np.abs(b), axis=-1)[..., None]
    following = (main + 1) % 3
    axis = (np.arange(3) == following).astype(np.float64)
    first = unit(axis - b * np.take_along_axis(b, following, axis=-1))
    second = np.cross(b, first) * np.sign(np.take_along_axis(b, main, axis=-1))
    return np.stack([first, second], axis=-1)


def largest_length(xy: Float) -> float:
    """Largest length of vectors (n, 2), in their unit; 0 of none."""
    return float(np.hypot(*xy.T).max(initial=0.0))
