"""Re-admission: observations that an earlier stage rejected are held against the adjusted block.

A rejected record with the whitened prediction error w has the covariance S = I + R, R that of its whitened prediction
from everything else. It is re-admitted if w'S^-1 w / m is within `limit` squared, m its components. So it is with
every kind of observation: each record predicts itself.
"""

from __future__ import annotations

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool


def readmitted(found: AdjustedObservations, state: State, limit: float = 3.0) -> Bool:
    """Which of the rejected rows fit the adjusted block after all; what cannot be predicted does not.

    Parameters
    ----------
    found : AdjustedObservations
    state : mapping
        The adjusted block.
    limit : float
        In standard deviations.

    Returns
    -------
    (n,) bool
    """
    fits = np.zeros(len(found.observed), dtype=bool)
    rejected = found.observed.rejected
    if rejected is None:
        return fits
    rows = found.rows[rejected[found.rows]]
    R = found.covariance[rows]
    if not np.isfinite(found.covariance[found.rows]).any():
        R = np.zeros_like(R)  # adjusted without standard deviations: held against the measurement's alone
    known = np.isfinite(R).all(axis=(1, 2))
    rows, R = rows[known], R[known]
    records = found.observed.records
    v = records.evaluate(state, rows)[0]
    L = records.whitener[rows]
    w = L * v if L.ndim == 2 else np.einsum("nij,nj->ni", L, v)
    used = records.observed_components()[rows]
    size = np.einsum("ni,nij,nj->n", w, np.linalg.inv(np.eye(records.rows) + R), w) / np.maximum(used.sum(axis=1), 1)
    fits[rows[(size <= limit**2) & used.any(axis=1)]] = True
    return fits
