"""Small dense normal equations: solution, covariance and condition of one problem of some unknowns, compiled.

For a symmetric N with D = diag(N)^1/2 and the Cholesky factor L of D^-1 N D^-1,

    W = L^-1 D^-1,   N^-1 = W'W,   N dx = -g:  y = W g,  dx = -W'y,  sqrt(dx'N dx) = |y|

Many problems of one shape (images, pairs, joints) call these in a loop of their own, each with the residuals of its
kind; nothing is shared between problems, so that results do not depend on how they are shared out among threads.

Condition: the smallest eigenvalue of D^-1 N D^-1 is at least 1 / |L^-1|_F^2, and at most u times that for u unknowns.
"""

from typing import Any

import numpy as np
from numba import njit

OPTIONS: dict[str, Any] = {"nogil": True, "cache": True, "error_model": "numpy"}
"""Of the compiled functions: a division by zero gives inf, not an exception. Products are not fused with sums: which are,
would depend on what the compiler makes part of the caller, and that on what a process has compiled before."""

DETERMINED = 1e-13
"""Normal equations with a bound of the smallest eigenvalue below this are singular to rounding: sums of some 1,000
products are good to 1e-14 or so of their diagonal."""


@njit("float64(float64[:,::1], float64[:,::1])", **OPTIONS)
def inverse_root(N, W):
    """Fill W, lower triangular, with N^-1 = W'W; only the lower triangle of N is read.

    Returns
    -------
    float
        Lower bound of the smallest eigenvalue of N scaled to unit diagonal; 0 or NaN where N is not positive definite
        or not finite, and W is then not to be used.
    """
    n = len(N)
    L, root = np.empty((n, n)), np.empty(n)
    for j in range(n):
        for k in range(j):
            W[k, j] = 0.0
        if not N[j, j] > 0.0:
            return 0.0
        root[j] = np.sqrt(N[j, j])
    for j in range(n):
        pivot = 1.0
        for k in range(j):
            pivot -= L[j, k] * L[j, k]
        if not pivot > 0.0:
            return 0.0
        L[j, j] = np.sqrt(pivot)
        for i in range(j + 1, n):
            s = N[i, j] / (root[i] * root[j])
            for k in range(j):
                s -= L[i, k] * L[j, k]
            L[i, j] = s / L[j, j]
    square = 0.0
    for j in range(n):
        for i in range(j, n):
            s = 1.0 if i == j else 0.0
            for k in range(j, i):
                s -= L[i, k] * W[k, j]
            W[i, j] = s / L[i, i]
            square += W[i, j] * W[i, j]
    for j in range(n):
        for i in range(j, n):
            W[i, j] /= root[j]
    return 1.0 / square


@njit("float64(float64[:,::1], float64[::1], float64[::1])", **OPTIONS)
def newton_step(W, g, dx):
    """Fill dx = -W'W g; returns the Newton decrement sqrt(dx'N dx)."""
    n, square = len(g), 0.0
    for j in range(n):
        dx[j] = 0.0
    for i in range(n):
        y = 0.0
        for j in range(i + 1):
            y += W[i, j] * g[j]
        square += y * y
        for j in range(i + 1):
            dx[j] -= W[i, j] * y
    return np.sqrt(square)


@njit("void(float64[:,::1], float64[:,::1])", **OPTIONS)
def inverse(W, Q):
    """Fill Q = W'W = N^-1."""
    n = len(W)
    for i in range(n):
        for j in range(i + 1):
            s = 0.0
            for k in range(i, n):
                s += W[k, i] * W[k, j]
            Q[i, j] = s
            Q[j, i] = s


@njit("float64(float64[:,::1], float64[::1])", **OPTIONS)
def leverage(W, row):
    """row' N^-1 row."""
    square = 0.0
    for i in range(len(row)):
        y = 0.0
        for j in range(i + 1):
            y += W[i, j] * row[j]
        square += y * y
    return square


@njit("float64(float64[::1], int64, int64)", **OPTIONS)
def select(a, n, k):
    """The k-th smallest (from 0) of the first n numbers, none of them NaN; they are rearranged: a[:k] <= a[k] <= a[k:n]."""
    low, high = 0, n - 1
    while low < high:
        pivot = a[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while a[i] < pivot:
                i += 1
            while a[j] > pivot:
                j -= 1
            if i <= j:
                a[i], a[j] = a[j], a[i]
                i += 1
                j -= 1
        if k <= j:
            high = j
        elif k >= i:
            low = i
        else:
            break
    return a[k]


@njit("float64(float64[::1], int64)", **OPTIONS)
def median(a, n):
    """Median of the first n numbers, none of them NaN; the mean of the middle two for an even n. They are rearranged."""
    upper = select(a, n, n // 2)
    if n % 2 == 1:
        return upper
    lower = a[0]
    for k in range(1, n // 2):
        lower = max(lower, a[k])
    return 0.5 * (lower + upper)
