"""Stacks of small symmetric matrices, factorised side by side: loops run over the m columns, not over the n matrices.

C = L L',   T = L^-1,   T C T' = I
"""

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
