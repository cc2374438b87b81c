"""The five-point problem, compiled: essential matrices of five pairs of rays, through a polynomial of degree ten.

The five conditions u1'E u2 = 0 leave E = x E1 + y E2 + z E3 + E4. The ten cubic equations det E = 0 and
E E'E - tr(E E') E / 2 = 0 are eliminated (Gauss-Jordan, columns in the order of `_CUBIC`), so that three of the rows
combine to B(z) (x, y, 1)' = 0 with polynomials in z; z is a real root of det B, found between the extrema (roots of the
derivative, found in the same way); x and y follow from B(z).

Source: Nister, PAMI 26 (2004) 756, sections 3.1 and 3.2.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS
from aatri.arrays import Int

Exponents = tuple[int, int, int]

# Exponents of x, y, z: linear, quadratic and cubic monomials; the ten that are eliminated first.
_LINEAR = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)]
_QUADRATIC = [(2, 0, 0), (1, 1, 0), (0, 2, 0), (1, 0, 1), (0, 1, 1), (0, 0, 2), *_LINEAR]
_CUBIC = [
    (3, 0, 0), (0, 3, 0), (2, 1, 0), (1, 2, 0), (2, 0, 1), (2, 0, 0), (0, 2, 1), (0, 2, 0), (1, 1, 1), (1, 1, 0),
    (1, 0, 2), (1, 0, 1), (1, 0, 0), (0, 1, 2), (0, 1, 1), (0, 1, 0), (0, 0, 3), (0, 0, 2), (0, 0, 1), (0, 0, 0),
]  # fmt: skip


def _products(a: list[Exponents], b: list[Exponents], of: list[Exponents]) -> Int:
    return np.array([[of.index((m[0] + n[0], m[1] + n[1], m[2] + n[2])) for n in b] for m in a], dtype=np.int64)


_LINEAR_LINEAR = _products(_LINEAR, _LINEAR, _QUADRATIC)
_QUADRATIC_LINEAR = _products(_QUADRATIC, _LINEAR, _CUBIC)

REAL_ROOTS = 10
"""Most solutions of a sample."""

SINGULAR = 1e-12
"""Pivots below this are those of a sample that determines nothing."""


@njit("void(float64[:,::1], float64[:,::1], int64[::1], float64[:,::1])", **OPTIONS)
def null_space(left, right, sample, X):
    """Fill X (4, 9) with orthonormal matrices E of which all fulfil the conditions of five points (Householder)."""
    A, beta = np.empty((9, 5)), np.empty(5)
    for k in range(5):
        for i in range(3):
            for j in range(3):
                A[3 * i + j, k] = left[sample[k], i] * right[sample[k], j]
    for k in range(5):
        square = 0.0
        for i in range(k, 9):
            square += A[i, k] * A[i, k]
        root = np.sqrt(square) * (1.0 if A[k, k] >= 0.0 else -1.0)
        A[k, k] += root
        beta[k] = 1.0 / (root * A[k, k]) if square > 0.0 else 0.0
        for j in range(k + 1, 5):
            s = 0.0
            for i in range(k, 9):
                s += A[i, k] * A[i, j]
            for i in range(k, 9):
                A[i, j] -= beta[k] * s * A[i, k]
    for column in range(4):
        for i in range(9):
            X[column, i] = 1.0 if i == 5 + column else 0.0
        for k in range(4, -1, -1):
            s = 0.0
            for i in range(k, 9):
                s += A[i, k] * X[column, i]
            for i in range(k, 9):
                X[column, i] -= beta[k] * s * A[i, k]


@njit("void(float64[::1], float64[::1], float64, float64[::1])", **OPTIONS)
def add_quadratic(a, b, factor, to):
    """Add the product of two linear polynomials."""
    for i in range(4):
        for j in range(4):
            to[_LINEAR_LINEAR[i, j]] += factor * a[i] * b[j]


@njit("void(float64[::1], float64[::1], float64, float64[::1])", **OPTIONS)
def add_cubic(a, b, factor, to):
    """Add the product of a quadratic and a linear polynomial."""
    for i in range(10):
        for j in range(4):
            to[_QUADRATIC_LINEAR[i, j]] += factor * a[i] * b[j]


@njit("void(float64[:,::1], float64[:,::1])", **OPTIONS)
def cubic_equations(X, M):
    """Fill M (10, 20) with the coefficients of the ten equations."""
    E, S, trace, minor = np.empty((9, 4)), np.zeros((9, 10)), np.zeros(10), np.empty(10)
    for e in range(9):
        for k in range(4):
            E[e, k] = X[k, e]
    M[:] = 0.0
    for i in range(3):
        for j in range(i, 3):
            for k in range(3):
                add_quadratic(E[3 * i + k], E[3 * j + k], 1.0, S[3 * i + j])
            S[3 * j + i] = S[3 * i + j]
        trace += S[4 * i]
    for i in range(3):
        S[4 * i] -= 0.5 * trace
    for i in range(3):
        for j in range(3):
            for k in range(3):
                add_cubic(S[3 * i + k], E[3 * k + j], 1.0, M[3 * i + j])
    for j in range(3):
        a, b = (j + 1) % 3, (j + 2) % 3
        minor[:] = 0.0
        add_quadratic(E[3 + a], E[6 + b], 1.0, minor)
        add_quadratic(E[3 + b], E[6 + a], -1.0, minor)
        add_cubic(minor, E[j], 1.0, M[9])


@njit("boolean(float64[:,::1])", **OPTIONS)
def eliminate(M):
    """Gauss-Jordan of the first ten columns, with row pivots; False if they are dependent."""
    for k in range(10):
        pivot = k
        for i in range(k + 1, 10):
            if abs(M[i, k]) > abs(M[pivot, k]):
                pivot = i
        if not abs(M[pivot, k]) > SINGULAR:
            return False
        if pivot != k:
            for j in range(k, 20):
                M[k, j], M[pivot, j] = M[pivot, j], M[k, j]
        factor = 1.0 / M[k, k]
        for j in range(k, 20):
            M[k, j] *= factor
        for i in range(10):
            if i != k and M[i, k] != 0.0:
                factor = M[i, k]
                for j in range(k, 20):
                    M[i, j] -= factor * M[k, j]
    return True


@njit("void(float64[:,::1], float64[:,:,::1])", **OPTIONS)
def in_z(M, B):
    """Fill B (3, 3, 5), polynomials in z, lowest power first: rows 4, 6, 8 less z times rows 5, 7, 9."""
    B[:] = 0.0
    for r in range(3):
        upper, lower = 4 + 2 * r, 5 + 2 * r
        for column in range(2):  # x z^2, x z, x and the same of y
            for k in range(3):
                B[r, column, 2 - k] += M[upper, 10 + 3 * column + k]
                B[r, column, 3 - k] -= M[lower, 10 + 3 * column + k]
        for k in range(4):  # z^3, z^2, z, 1
            B[r, 2, 3 - k] += M[upper, 16 + k]
            B[r, 2, 4 - k] -= M[lower, 16 + k]


@njit("void(float64[:,:,::1], float64[::1])", **OPTIONS)
def determinant(B, p):
    """Fill p (11,) with det B, lowest power first."""
    minor = np.empty(8)
    p[:] = 0.0
    for j in range(3):
        a, b = (j + 1) % 3, (j + 2) % 3
        minor[:] = 0.0
        for m in range(5):
            for n in range(5):
                if m + n < 8:
                    minor[m + n] += B[1, a, m] * B[2, b, n] - B[1, b, m] * B[2, a, n]
        for m in range(5):
            for n in range(8):
                if m + n < 11:
                    p[m + n] += B[0, j, m] * minor[n]


@njit("float64(float64[::1], int64, float64)", **OPTIONS)
def value(p, degree, x):
    """A polynomial at x."""
    s = p[degree]
    for k in range(degree - 1, -1, -1):
        s = s * x + p[k]
    return s


@njit("float64(float64[::1], float64[::1], int64, float64, float64, float64)", **OPTIONS)
def root_between(p, slope, degree, a, b, at_a):
    """The root of p between a and b, where its sign changes: Newton's steps, halving where these leave the interval."""
    x = 0.5 * (a + b)
    for _ in range(60):
        f = value(p, degree, x)
        if f == 0.0:
            return x
        if (f > 0.0) == (at_a > 0.0):
            a = x
        else:
            b = x
        d = value(slope, degree - 1, x)
        following = x - f / d if d != 0.0 else 0.5 * (a + b)
        if following != x and not (a < following < b):
            following = 0.5 * (a + b)
        if abs(following - x) <= 1e-15 * (1.0 + abs(x)):
            return following
        x = following
    return x


@njit("int64(float64[::1], int64, float64[::1])", **OPTIONS)
def roots_within_one(p, degree, roots):
    """Fill in the real roots of p in [-1, 1], ascending; returns how many."""
    chain, extrema, found = np.zeros((degree + 1, degree + 1)), np.empty(degree + 2), 0
    for k in range(degree + 1):
        chain[degree, k] = p[k]
    for d in range(degree - 1, 0, -1):
        for k in range(d + 1):
            chain[d, k] = (k + 1) * chain[d + 1, k + 1]
    constant = np.zeros(degree + 1)
    constant[0] = chain[1, 1]
    for d in range(1, degree + 1):
        extrema[0] = -1.0
        for k in range(found):
            extrema[k + 1] = roots[k]
        extrema[found + 1] = 1.0
        many, found = found + 1, 0
        at_a = value(chain[d], d, extrema[0])
        for k in range(many):
            at_b = value(chain[d], d, extrema[k + 1])
            if (at_a > 0.0) != (at_b > 0.0):
                roots[found] = root_between(
                    chain[d], chain[d - 1] if d > 1 else constant, d, extrema[k], extrema[k + 1], at_a
                )
                found += 1
            at_a = at_b
    return found


@njit("int64(float64[:,::1], float64[:,::1], int64[::1], float64[:,:,::1])", **OPTIONS)
def five_point(left, right, sample, E):
    """Essential matrices of a sample.

    Parameters
    ----------
    left, right : (n, 3) float64
        Ray directions.
    sample : (5,) int64
        Rows.
    E : (10, 3, 3) float64
        Filled in, of Frobenius norm sqrt(2).

    Returns
    -------
    int
        How many.
    """
    X, M, B, p, reversed_p = np.empty((4, 9)), np.empty((10, 20)), np.empty((3, 3, 5)), np.empty(11), np.empty(11)
    roots, C, n, many = np.empty(12), np.empty((3, 3)), np.empty(3), 0
    null_space(left, right, sample, X)
    cubic_equations(X, M)
    if not eliminate(M):
        return 0
    in_z(M, B)
    determinant(B, p)
    for k in range(11):
        reversed_p[k] = p[10 - k]
    for turned in range(2):
        found = roots_within_one(reversed_p if turned else p, 10, roots)
        for r in range(found):
            if many == REAL_ROOTS or (turned and abs(roots[r]) >= 1.0) or (turned and roots[r] == 0.0):
                continue
            z = 1.0 / roots[r] if turned else roots[r]
            for i in range(3):
                for j in range(3):
                    C[i, j] = value(B[i, j], 4, z)
            x, y, largest = 0.0, 0.0, 0.0
            for i in range(3):  # the null vector from the two rows that give the longest one
                a, b = (i + 1) % 3, (i + 2) % 3
                for j in range(3):
                    k, m = (j + 1) % 3, (j + 2) % 3
                    n[j] = C[a, k] * C[b, m] - C[a, m] * C[b, k]
                size = abs(n[2])
                if size > largest:
                    x, y, largest = n[0] / n[2], n[1] / n[2], size
            if not largest > 0.0:
                continue
            square = 0.0
            for e in range(9):
                entry = x * X[0, e] + y * X[1, e] + z * X[2, e] + X[3, e]
                E[many, e // 3, e % 3] = entry
                square += entry * entry
            if not (square > 0.0 and square < np.inf):
                continue
            factor = np.sqrt(2.0 / square)
            for e in range(9):
                E[many, e // 3, e % 3] *= factor
            many += 1
    return many
