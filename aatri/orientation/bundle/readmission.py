"""Re-admission: observations that an earlier stage rejected are held against the adjusted block.

A record is taken back where its test, of the prediction from everything else (`adjustment.statistics.record_tests`), is
within a limit. So it is with every kind of observation: each record predicts itself.
"""

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.residuals import whitened_residuals
from aatri.adjustment.statistics.record_tests import record_tests
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool


def readmitted(adjusted: AdjustedObservations, state: State, limit: float = 3.0) -> Bool:
    """Which of the rejected rows fit the adjusted block after all; what cannot be predicted does not.

    Parameters
    ----------
    adjusted : AdjustedObservations
    state : mapping
        The adjusted block.
    limit : float
        In standard deviations.

    Returns
    -------
    (n,) bool
    """
    fits = np.zeros(len(adjusted.observed), dtype=bool)
    rejected = adjusted.observed.rejected
    if rejected is None:
        return fits
    rows = adjusted.rows[rejected[adjusted.rows]]
    covariance = adjusted.covariance[rows]
    if not np.isfinite(adjusted.covariance[adjusted.rows]).any():
        covariance = np.zeros_like(covariance)  # adjusted without: held against the measurement's own alone
    records = adjusted.observed.records.take(rows)
    tests = record_tests(records, state, covariance, whitened_residuals(records, state, np.arange(len(rows))))
    fits[rows[tests.test <= limit]] = True
    return fits
