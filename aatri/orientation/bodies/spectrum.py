"""Eigenvalues and eigenvectors of the covariances of points."""

import numpy as np

from aatri.arrays import Float
from aatri.orientation.bodies.kernels.eigen import eigen


def spectrum_of(covariance: Float) -> tuple[Float, Float]:
    """Eigenvalues (n, 3), none negative, and eigenvectors by columns (n, 3, 3) of covariances (n, 3, 3)."""
    values, vectors = np.empty(covariance.shape[:2]), np.empty(covariance.shape)
    eigen(0, len(values), np.require(covariance, np.float64, ["C", "W"]), values, vectors)
    return np.maximum(values, 0.0), vectors
