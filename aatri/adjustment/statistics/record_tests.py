"""Tests of every record of an adjustment, active or not.

With whitened residuals v and the covariance H = J Q J' of the whitened adjusted values (predicted, where not active),

    active:    R = I - H, the cofactor of v; gross error -R^-1 v, statistic sqrt(v'R^-1 v / rows)
    inactive:  P = I + H, that of the prediction error; gross error -v, statistic sqrt(v'P^-1 v / rows)

in standard deviations a priori; for a single residual the statistic is |v| / sqrt(r). Directions whose redundancy is
below `UNCONTROLLED` count for nothing. Of an observation the matrix R is its redundancy: its diagonal are the
redundancy numbers, its trace is the record's share of the redundancy.

Source: Baarda 1968; Foerstner 1980; docs/formulas.md 7.3.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aatri.adjustment.kernels.record_tests import test_records
from aatri.adjustment.records import Records
from aatri.adjustment.statistics.reliability import UNCONTROLLED
from aatri.adjustment.threads import in_threads
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float


@dataclass(frozen=True)
class RecordTests:
    """Tests of the records of one observation type."""

    records: Records
    state: State
    """The solution."""
    whitened: Float
    """(n, m). Whitened residuals, computed minus observed."""
    redundancy: Float
    """(n, m, m). I - H where active; of inactive records P = I + H, the cofactor of the prediction error. Zero for
    components that are not observed, NaN where not known."""

    @property
    def name(self) -> str:
        """Of the observation type."""
        return self.records.name

    @property
    def active(self) -> Bool:
        """(n,)."""
        return self.records.active

    @cached_property
    def v(self) -> Float:
        """Residuals, computed minus observed, in units of the observation, (n, m)."""
        return self.records.residuals(self.state)

    @property
    def size(self) -> Float:
        """Estimated gross error, observed minus what it should be, whitened, (n, m)."""
        return self._size_and_test[0]

    @property
    def test(self) -> Float:
        """Statistic of the record, (n,); NaN where uncontrolled or not known."""
        return self._size_and_test[1]

    @cached_property
    def _size_and_test(self) -> tuple[Float, Float]:
        n, m = self.whitened.shape
        size, test = np.empty((n, m)), np.empty(n)
        arrays = (self.whitened, self.redundancy, self.records.observed_components(), self.active)
        in_threads(n, lambda first, last: test_records(first, last, *arrays, UNCONTROLLED, size, test))
        return size, test


def record_tests(records: Records, state: State, adjusted_covariance: Float, whitened: Float) -> RecordTests:
    """The same with the whitened residuals given, (n, m), as `Covariances` has them."""
    cofactor = -adjusted_covariance
    inactive = np.flatnonzero(~records.active)
    cofactor[inactive] = adjusted_covariance[inactive]
    np.einsum("nii->ni", cofactor)[:] += 1.0
    observed = records.observed_components()
    if not observed.all():
        cofactor[~(observed[:, :, None] & observed[:, None, :])] = 0.0
    return RecordTests(records, state, np.ascontiguousarray(whitened), np.ascontiguousarray(cofactor))
