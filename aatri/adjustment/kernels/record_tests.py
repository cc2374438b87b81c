"""Test statistic and estimated gross error of every record, from whitened residuals and their cofactors."""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS

_SIGNATURE = (
    "void(int64, int64, float64[:,::1], float64[:,:,::1], boolean[:,::1], boolean[::1], float64, float64[:,::1], "
    "float64[::1])"
)


@njit("boolean(int64, float64[:,::1], float64[::1], float64, float64[:,::1], float64[::1])", **OPTIONS)
def well_controlled(n, R, e, uncontrolled, L, y):
    """Whether no eigenvalue of R (n, n) can be below a limit; then y = R^-1 e, by Cholesky.

    Of a positive definite matrix the smallest eigenvalue is at least det R / (trace R / (n - 1))^(n - 1), since the
    product of the others is at most the power of their mean.
    """
    determinant, trace = 1.0, 0.0
    for i in range(n):
        trace += R[i, i]
        for j in range(i + 1):
            s = R[i, j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            if i == j:
                if not s > 0.0:
                    return False
                determinant *= s
                L[i, i] = np.sqrt(s)
            else:
                L[i, j] = s / L[j, j]
    least = determinant
    for _ in range(n - 1):
        least *= (n - 1) / trace
    if not least > uncontrolled:
        return False
    for i in range(n):
        s = e[i]
        for k in range(i):
            s -= L[i, k] * y[k]
        y[i] = s / L[i, i]
    for i in range(n - 1, -1, -1):
        s = y[i]
        for k in range(i + 1, n):
            s -= L[k, i] * y[k]
        y[i] = s / L[i, i]
    return True


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
    L, y = np.empty((m, m)), np.empty(m)
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
        if well_controlled(n, R, e, uncontrolled, L, y):
            total = 0.0
            for a in range(n):
                total += y[a] * e[a]
                size[r, at[a]] = -y[a] if active[r] else -e[a]
            test[r] = np.sqrt(total / n)
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
