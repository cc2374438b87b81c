"""Adding into fronts: the update of a child, and records of kept unknowns alone."""

import numpy as np
from numba import njit


@njit(
    "void(float64[::1,:], float64[::1], float64[::1], int64, int32[::1], float64[::1,:], float64[::1], float64[::1])",
    nogil=True,
    cache=True,
)
def extend_add(child, child_g, child_d, panel, row, F, g, d):
    """Add the updated boundary of a child's front to its parent's.

    Parameters
    ----------
    child : (n, n) float64, column-major
        Front of the child after its panel of `panel` columns has been eliminated.
    child_g, child_d : (n,) float64
        Gradient and diagonal of the child.
    row : (n - panel,) int32
        Ascending rows of the parent's front.
    F, g, d
        Front, gradient and diagonal of the parent.
    """
    n, runs = len(row), 0
    first = np.empty(n + 1, dtype=np.int64)  # rows that follow each other in both fronts are added as one run
    for j in range(n):
        if j == 0 or row[j] != row[j - 1] + 1:
            first[runs] = j
            runs += 1
    first[runs] = n
    for own in range(runs):
        for j in range(first[own], first[own + 1]):
            column = row[j]
            g[column] += child_g[panel + j]
            d[column] += child_d[panel + j]
            for run in range(own, runs):
                i0 = max(first[run], j)
                count, a, b = first[run + 1] - i0, row[i0], panel + i0
                for i in range(count):
                    F[a + i, column] += child[b + i, panel + j]


@njit("void(float64[::1,:])", nogil=True, cache=True)
def clear_lower(F):
    """Set the lower triangle of a front to zero; nothing else of it is ever read."""
    n = F.shape[0]
    for j in range(n):
        for i in range(j, n):
            F[i, j] = 0.0


@njit(
    "float64(int64, int64, float64[:,::1], float64[:,:,::1], int32[:,::1], int32[::1], int32[::1], float64[::1,:], float64[::1], float64[::1])",
    nogil=True,
    cache=True,
)
def add_records(r0, r1, v, A, loc, part_size, part_start, F, g, diagonal):
    """Add records r0 ... r1 - 1 of kept unknowns to a front; returns the sum of squares of v.

    Parameters
    ----------
    v : (n, m) float64
    A : (n, m, k) float64
    loc : (n, parts) int32
        Row of each part in the front, -1 where it is held.
    part_size, part_start : (parts,) int32
    F : (k, k) float64, column-major; g, diagonal : (k,) float64
    """
    m, parts, cost = v.shape[1], len(part_size), 0.0
    for r in range(r0, r1):
        for i in range(m):
            cost += v[r, i] * v[r, i]
        for part in range(parts):
            c = loc[r, part]
            if c < 0:
                continue
            first = part_start[part]
            for a in range(part_size[part]):
                s, d = 0.0, 0.0
                for i in range(m):
                    s += A[r, i, first + a] * v[r, i]
                    d += A[r, i, first + a] ** 2
                g[c + a] += s
                diagonal[c + a] += d
            for other in range(parts):
                o = loc[r, other]
                if o < 0 or o > c or (o == c and other > part):
                    continue
                twice = o == c and other < part
                for b in range(part_size[other]):
                    for a in range(part_size[part]):
                        s = 0.0
                        for i in range(m):
                            s += A[r, i, first + a] * A[r, i, part_start[other] + b]
                        F[c + a, o + b] += s
                        if twice:
                            F[c + b, o + a] += s
    return cost
