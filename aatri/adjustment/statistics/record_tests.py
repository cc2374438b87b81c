"""Tests of every record of an adjustment, active or not.

With whitened residuals v and the covariance H = J Q J' of the whitened adjusted values (predicted, where not active),

    active:    R = I - H, the cofactor of v; gross error -R^-1 v, statistic sqrt(v'R^-1 v / rows)
    inactive:  P = I + H, that of the prediction error; gross error -v, statistic sqrt(v'P^-1 v / rows)

in standard deviations a priori; for a single residual the statistic is |v| / sqrt(r). Directions whose redundancy is
below `UNCONTROLLED` count for nothing. Of an observation the matrix R is its redundancy: its diagonal are the
redundancy numbers, its trace is the record's share of the redundancy.

Source: Baarda 1968; Foerstner 1980; docs/formulas.md 7.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.kernels.record_tests import test_records
from aatri.adjustment.records import Records
from aatri.adjustment.statistics.reliability import UNCONTROLLED
from aatri.adjustment.threads import in_threads
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float


@dataclass(frozen=True)
class RecordTests:
    """Tests of the records of one observation type.

    Attributes
    ----------
    name : str
    active : (n,) bool
    v : (n, m) float64
        Residuals, computed minus observed, in units of the observation.
    whitened : (n, m) float64
    w : (n, m) float64
        Of single whitened components: v / sqrt(r), or v / sqrt(1 + h) where predicted; NaN where uncontrolled.
    size : (n, m) float64
        Estimated gross error, observed minus what it should be, whitened.
    test : (n,) float64
        Statistic of the record; NaN where uncontrolled or not known.
    redundancy : (n, m, m) float64
        I - H where active; of inactive records P = I + H, the cofactor of the prediction error. Zero for components
        that are not observed, NaN where not known.
    """

    name: str
    active: Bool
    v: Float
    whitened: Float
    w: Float
    size: Float
    test: Float
    redundancy: Float


def tests_of_records(records: Records, state: State, adjusted_covariance: Float) -> RecordTests:
    """Test all records of one type.

    Parameters
    ----------
    records : Records
    state : mapping
        The solution.
    adjusted_covariance : (n, m, m) float64
        Covariance of their whitened adjusted or predicted values, see `marginal_covariances`.
    """
    n, m = len(records.active), records.rows
    v, observed = records.residuals(state), records.observed_components()
    whitener = records.whitener
    whitened = whitener * v if whitener.ndim == 2 else np.einsum("nij,nj->ni", whitener, v)
    sign = np.where(records.active, -1.0, 1.0)[:, None, None]
    both = observed[:, :, None] & observed[:, None, :]
    cofactor = np.where(both, np.eye(m) + sign * adjusted_covariance, 0.0)
    diagonal = np.einsum("nii->ni", cofactor)
    tested = observed & (diagonal > UNCONTROLLED)
    w = np.where(tested, whitened / np.sqrt(np.where(tested, diagonal, 1.0)), np.nan)
    size, test = np.empty((n, m)), np.empty(n)
    arrays = (np.ascontiguousarray(whitened), np.ascontiguousarray(cofactor), observed, records.active)
    in_threads(n, lambda first, last: test_records(first, last, *arrays, UNCONTROLLED, size, test))
    return RecordTests(records.name, records.active, v, whitened, w, size, test, cofactor)
