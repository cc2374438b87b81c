"""Observations as records: m rows each, an m x m covariance, the blocks of unknowns they touch.

An observation type gives `evaluate(state) -> v, (J, ...)`: residuals computed minus observed (n, m) and one Jacobian
(n, m, k) per touched group, both in units of the observation. The covariance enters by its inverse Cholesky factor:
`whitener @ v` has unit covariance. Rejection and robust weights change `active` and `factor`, never the structure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.adjustment.unknowns import State

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int32]
Bool = npt.NDArray[np.bool_]

Evaluate = Callable[[State], tuple[Float, tuple[Float, ...]]]


@dataclass(frozen=True)
class Records:
    """All records of one observation type.

    Attributes
    ----------
    name : str
    touches : tuple of (str, (n,) int32)
        Name of the group of unknowns and the block each record touches.
    evaluate : callable
        state -> v (n, m), one J (n, m, k) per touched group.
    whitener : (n, m, m) float64
        Inverse Cholesky factor of the covariance; a zero row switches off a component that was not observed.
    active : (n,) bool
    """

    name: str
    touches: tuple[tuple[str, Int], ...]
    evaluate: Evaluate
    whitener: Float
    active: Bool

    @property
    def observations(self) -> int:
        """Number of scalar observations in use."""
        rows = (np.abs(self.whitener).max(axis=2) > 0)[self.active]
        return int(rows.sum())


def whitened(records: Records, state: State) -> tuple[Float, tuple[Float, ...]]:
    """Whitened residuals and Jacobians of all records; zero where inactive.

    Returns
    -------
    v : (n, m) float64
    jacobians : tuple of (n, m, k) float64
    """
    v, jacobians = records.evaluate(state)
    L = np.where(records.active[:, None, None], records.whitener, 0.0)
    v = np.where(records.active[:, None], v, 0.0)
    jacobians = tuple(np.where(records.active[:, None, None], J, 0.0) for J in jacobians)
    return np.einsum("nij,nj->ni", L, v), tuple(L @ J for J in jacobians)


def whitener_of_sigmas(sigma: Float) -> Float:
    """Whitener of independent components.

    Parameters
    ----------
    sigma : (n, m) float64
        NaN or infinite where not observed.

    Returns
    -------
    (n, m, m) float64
    """
    usable = np.isfinite(sigma)
    inverse = np.where(usable, 1.0 / np.where(usable, sigma, 1.0), 0.0)
    return np.asarray(inverse[:, :, None] * np.eye(sigma.shape[1]))


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
