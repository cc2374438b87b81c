"""Test statistic and estimated gross error of every record, from whitened residuals and their cofactors."""

from __future__ import annotations

import numpy as np
from numba import njit

from aatri.adjustment.kernels.eliminate import OPTIONS

_SIGNATURE = (
    "void(int64, int64, float64[:,::1], float64[:,:,::1], boolean[:,::1], boolean[::1], float64, float64[:,::1], "
    "float64[::1])"
)


@njit(_SIGNATURE, **OPTIONS)
def test_records(first, last, v, cofactor, observed, active, uncontrolled, size, test):
    """Statistics of the records first ... last - 1.

    Parameters
    ----------
    v : (n, m) float64
        Whitened residuals, computed minus observed.
    cofactor : (n, m, m) float64
        Of these residuals, or of the prediction errors; NaN not known.
    observed : (n, m) bool
        Other components count for nothing.
    active : (n,) bool
    uncontrolled : float
        Directions with a smaller eigenvalue of the cofactor are not tested.
    size : (n, m) float64
        Filled in: estimated gross error, observed minus what it should be, in standard deviations.
    test : (n,) float64
        Filled in: root of the mean square of the controlled directions; NaN without any.
    """
    m = v.shape[1]
    at, R, e, projected = np.empty(m, dtype=np.int64), np.empty((m, m)), np.empty(m), np.empty(m)
    for r in range(first, last):
        n, known = 0, True
        for i in range(m):
            size[r, i] = 0.0
            if observed[r, i]:
                at[n] = i
                n += 1
        test[r] = np.nan
        for a in range(n):
            e[a] = v[r, at[a]]
            known = known and np.isfinite(e[a])
            for b in range(n):
                R[a, b] = cofactor[r, at[a], at[b]]
                known = known and np.isfinite(R[a, b])
        if n == 0:
            continue
        if not known:
            for a in range(n):
                size[r, at[a]] = np.nan
            continue
        values, vectors = np.linalg.eigh(R[:n, :n].copy())
        rows, total = 0, 0.0
        for c in range(n):
            s = 0.0
            for a in range(n):
                s += vectors[a, c] * e[a]
            projected[c] = 0.0
            if values[c] > uncontrolled:
                projected[c] = s / values[c]
                total += s * projected[c]
                rows += 1
        for a in range(n):
            s = 0.0
            for c in range(n):
                s += vectors[a, c] * projected[c]
            size[r, at[a]] = -s if active[r] else -e[a]
        if rows > 0:
            test[r] = np.sqrt(total / rows)
