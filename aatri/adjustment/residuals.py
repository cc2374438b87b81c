"""Residuals of many records, by their compiled lane where there is one."""

import numpy as np

from aatri.adjustment.records import Records, times_whitener
from aatri.adjustment.threads import in_threads
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int

CHUNK = 4096
"""Records at once: their Jacobians, which the lane makes too, stay in the cache."""


def residuals(records: Records, state: State, rows: Int) -> Float:
    """Residuals of some records, computed minus observed, in units of the observation, (n, m)."""
    n, m = len(rows), records.rows
    if records.compiled is None or n < CHUNK:
        return records.evaluate(state, rows)[0]
    widths = [J.shape[2] for J in records.evaluate(state, rows[:1])[1]]
    unit = np.ones((n, m)) if records.whitener.ndim == 2 else np.tile(np.eye(m), (n, 1, 1))
    fill, v = records.compiled(rows)(unit)(state), np.empty((n, m))

    def part(first: int, last: int) -> None:
        J = [np.empty((min(CHUNK, last - first), m, k)) for k in widths]
        for a in range(first, last, CHUNK):
            b = min(a + CHUNK, last)
            fill(a, b, v[a:b], tuple(j[: b - a] for j in J))

    in_threads(n, part)
    return v


def whitened_residuals(records: Records, state: State, rows: Int) -> Float:
    """The same in units of their standard deviations, of inactive records too."""
    return times_whitener(records.whitener[rows], residuals(records, state, rows), ())[0]
