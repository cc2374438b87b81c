"""Tests of every record of an adjustment, active or not.

With whitened residuals v and the covariance H = J Q J' of the whitened adjusted values (predicted, where not active),

    active:    R = I - H, the cofactor of v; gross error -R^-1 v, statistic sqrt(v'R^-1 v / rows)
    inactive:  P = I + H, that of the prediction error; gross error -v, statistic sqrt(v'P^-1 v / rows)

in standard deviations a priori; for a single residual the statistic is |v| / sqrt(r). Directions whose redundancy is
below `UNCONTROLLED` count for nothing. Of an observation the matrix R is its redundancy: its diagonal are the
redundancy numbers, axis by axis, its trace is the record's share of the redundancy.

Along a direction that nothing controls a gross error changes no residual at all. The smallest eigenvalue of R is the
redundancy number of the direction that the others control least,

    R d = r_min d,    |d| = 1,        in units of the observation  L^-1 d,   L the whitener.

A point of two rays has one redundant observation for both: R of each ray has rank one, and an error along d (x, where
the base is parallel to x) moves the point and shows nowhere, even where neither axis has the redundancy number 0.

Source: Baarda 1968; Foerstner 1980, 1983 (whole observations instead of single coordinates); docs/formulas.md 7.3.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aatri.adjustment.kernels.record_tests import test_records
from aatri.adjustment.records import Records
from aatri.adjustment.statistics.limits import LEAST_CONTROLLED
from aatri.adjustment.statistics.reliability import UNCONTROLLED
from aatri.adjustment.threads import by_rows, in_threads
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, finite_rows


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


def uncontrolled_directions(redundancy: Float, observed: Bool, whitener: Float) -> tuple[Int, Float, Float]:
    """Records with a direction that is not controlled.

    Parameters
    ----------
    redundancy : (n, m, m) float64
        I - J Q J' of whitened records; NaN where not known.
    observed : (n, m) bool
        Components that are observed.
    whitener : (n, m) or (n, m, m) float64

    Returns
    -------
    rows : (k,) int64
        Of such records.
    least : (k,) float64
        Redundancy number in that direction.
    direction : (k, m) float64
        The direction, of length 1 in units of the observation, its largest component positive; zero where not observed.
    """
    candidates = np.flatnonzero(~(by_rows(_least_bound, redundancy, observed) > LEAST_CONTROLLED))
    values, vectors = np.linalg.eigh(_of_observed(redundancy[candidates], observed[candidates]))
    open_direction = values[:, 0] < LEAST_CONTROLLED
    rows = candidates[open_direction]
    direction = np.where(observed[rows], vectors[open_direction, :, 0], 0.0)
    direction = _in_units(direction, whitener[rows], observed[rows])
    length = np.linalg.norm(direction, axis=1)
    largest = np.take_along_axis(direction, np.abs(direction).argmax(axis=1)[:, None], axis=1)[:, 0]
    return rows, values[open_direction, 0], direction / (np.where(largest < 0, -1.0, 1.0) * length)[:, None]


def _of_observed(redundancy: Float, observed: Bool) -> Float:
    """Redundancy matrices, symmetric, with 1 for what is not observed."""
    R = np.where(observed[:, :, None] & observed[:, None, :], redundancy, np.eye(redundancy.shape[1]))
    return 0.5 * (R + R.swapaxes(1, 2))


def _least_bound(redundancy: Float, observed: Bool) -> Float:
    """A bound of the smallest eigenvalue from below, which is enough for the many records that are well controlled.

    That of matrices without negative ones is at least det ((m - 1) / trace)^(m - 1).
    Infinite where nothing is observed or known.
    """
    is_tested = finite_rows(redundancy) & observed.any(axis=1)
    R = _of_observed(np.where(is_tested[:, None, None], redundancy, np.eye(redundancy.shape[1])), observed)
    m, trace = R.shape[1], np.einsum("nii->n", R)
    det = R[:, 0, 0] * R[:, 1, 1] - R[:, 0, 1] ** 2 if m == 2 else np.linalg.det(R)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(is_tested, det * ((m - 1) / trace) ** (m - 1), np.inf)


def _in_units(direction: Float, whitener: Float, observed: Bool) -> Float:
    if whitener.ndim == 2:
        return np.asarray(direction / np.where(observed, whitener, 1.0))
    m = whitener.shape[1]
    both = observed[:, :, None] & observed[:, None, :]
    return np.asarray(np.linalg.solve(np.where(both, whitener, np.eye(m)), direction[:, :, None])[:, :, 0])
