"""Stacks of small symmetric matrices, factorised side by side: loops run over the m columns, not over the n matrices.

    C = L L',   T = L^-1,   T C T' = I              M = L D L',   M x = v
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float


def inverse_cholesky(matrix: Float) -> Float:
    """Inverse of the lower Cholesky factor of each matrix.

    Parameters
    ----------
    matrix : (n, m, m) float64
        Positive definite.

    Returns
    -------
    (n, m, m) float64

    Raises
    ------
    numpy.linalg.LinAlgError
        If a matrix is not positive definite.
    """
    n, m = matrix.shape[:2]
    L, T = np.zeros((m, m, n)), np.zeros((m, m, n))
    C = np.ascontiguousarray(np.moveaxis(matrix, 0, -1))
    for j in range(m):
        square = C[j, j] - (L[j, :j] ** 2).sum(axis=0)
        if not (square > 0).all():
            raise np.linalg.LinAlgError("a matrix is not positive definite")
        L[j, j] = np.sqrt(square)
        for i in range(j + 1, m):
            L[i, j] = (C[i, j] - (L[i, :j] * L[j, :j]).sum(axis=0)) / L[j, j]
    for j in range(m):
        T[j, j] = 1.0 / L[j, j]
        for i in range(j + 1, m):
            T[i, j] = -(L[i, j:i] * T[j:i, j]).sum(axis=0) / L[i, i]
    return np.ascontiguousarray(np.moveaxis(T, -1, 0))


def solve_symmetric(matrix: Float, v: Float) -> tuple[Float, Float, Float]:
    """Solutions of M x = v by L D L' without exchange of rows.

    Parameters
    ----------
    matrix : (n, m, m) float64
    v : (n, m) float64

    Returns
    -------
    x : (n, m) float64
    square : (n,) float64
        v'x.
    smallest : (n,) float64
        Smallest pivot; x and the square mean something only where it is positive.
    """
    n, m = v.shape
    M = np.ascontiguousarray(np.moveaxis(matrix, 0, -1))
    L, d, y = np.zeros((m, m, n)), np.ones((m, n)), np.zeros((m, n))
    smallest = np.full(n, np.inf)
    for j in range(m):
        pivot = M[j, j] - (L[j, :j] ** 2 * d[:j]).sum(axis=0)
        smallest = np.minimum(smallest, pivot)
        d[j] = np.where(pivot > 0, pivot, 1.0)
        y[j] = v[:, j] - (L[j, :j] * y[:j]).sum(axis=0)
        for i in range(j + 1, m):
            L[i, j] = (M[i, j] - (L[i, :j] * L[j, :j] * d[:j]).sum(axis=0)) / d[j]
    x = y / d
    square = (y * x).sum(axis=0)
    for j in range(m - 1, -1, -1):
        x[j] -= (L[j + 1 :, j] * x[j + 1 :]).sum(axis=0)
    return np.ascontiguousarray(x.T), square, smallest
