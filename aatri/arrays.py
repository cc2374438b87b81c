"""The four kinds of arrays of which signatures speak: docstrings say shape and unit, these the kind of number; sums."""

import math
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Float: TypeAlias = npt.NDArray[np.float64]
Int: TypeAlias = npt.NDArray[np.integer[Any]]
"""Rows and counts, of any width."""
Bool: TypeAlias = npt.NDArray[np.bool_]
Text: TypeAlias = npt.NDArray[np.str_]


def sums_of(values: Float, of: Int, n: int) -> Float:
    """Sums of the rows of values (m, ...) that belong to each of n, (n, ...)."""
    columns = values.reshape(len(values), math.prod(values.shape[1:])).T
    sums = np.empty((n, len(columns)))
    for k, column in enumerate(columns):
        sums[:, k] = np.bincount(of, column, n)
    return sums.reshape(n, *values.shape[1:])


def diagonals(matrices: Float) -> Float:
    """Diagonals of matrices (n, k, k), as the variances of covariances, (n, k)."""
    return np.asarray(np.einsum("nii->ni", matrices))


def ranges(first: Int, count: Int) -> Int:
    """Whole numbers from each first one on, `count` of each, one range after the other.

    Examples
    --------
    >>> ranges(np.array([5, 0]), np.array([3, 2]))
    array([5, 6, 7, 0, 1])
    """
    before = np.cumsum(count) - count
    return np.asarray(np.repeat(first - before, count) + np.arange(count.sum()))


def finite_rows(values: npt.ArrayLike) -> Bool:
    """Whether all numbers of each row are given.

    Parameters
    ----------
    values : (n, ...) float64

    Returns
    -------
    (n,) bool
    """
    finite = np.isfinite(np.asarray(values, dtype=np.float64))
    return np.asarray(finite.reshape(len(finite), int(np.prod(finite.shape[1:]))).all(axis=1))


def is_uniform(values: npt.NDArray[Any], at_a_time: int = 100_000) -> bool:
    """Whether all rows are the same bits, of which so many are compared at a time; of a view of one none is."""
    if values.size and values.strides[0] == 0:
        return True
    pieces = (values[first : first + at_a_time] for first in range(0, len(values), at_a_time))
    return values.size > 0 and all(piece.tobytes() == len(piece) * values[:1].tobytes() for piece in pieces)
