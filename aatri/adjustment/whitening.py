"""Whiteners, inverse Cholesky factors of covariances; residuals and Jacobians in units of their standard deviations.

C = L L',   T = L^-1,   T C T' = I
"""

import numpy as np

from aatri.arrays import Bool, Float


def whitener_of_sigmas(sigma: Float) -> Float:
    """Whitener of independent components.

    Parameters
    ----------
    sigma : (n, m) float64
        NaN or infinite where not observed.

    Returns
    -------
    (n, m) float64
    """
    usable = np.isfinite(sigma)
    return np.where(usable, 1.0 / np.where(usable, sigma, 1.0), 0.0)


def whitener_of_covariances(covariance: Float, observed: Bool | None = None) -> Float:
    """Whitener of full covariances, of the observed components only.

    Parameters
    ----------
    covariance : (n, m, m) float64
    observed : (n, m) bool, optional

    Returns
    -------
    (n, m, m) float64
    """
    n, m = covariance.shape[:2]
    used = np.ones((n, m), dtype=bool) if observed is None else observed
    both = used[:, :, None] & used[:, None, :]
    filled = np.where(both, covariance, np.eye(m))
    inverse = np.linalg.inv(np.linalg.cholesky(filled)) if n else np.zeros((0, m, m))
    return np.asarray(np.where(both, inverse, 0.0))


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


def times_whitener(whitener: Float, v: Float, jacobians: tuple[Float, ...]) -> tuple[Float, tuple[Float, ...]]:
    """Residuals and Jacobians in units of their standard deviations."""
    with np.errstate(invalid="ignore", over="ignore"):  # of records that are not active; else refused by the cost
        if whitener.ndim == 2:
            return whitener * v, tuple(whitener[:, :, None] * J for J in jacobians)
        return np.einsum("nij,nj->ni", whitener, v), tuple(whitener @ J for J in jacobians)
