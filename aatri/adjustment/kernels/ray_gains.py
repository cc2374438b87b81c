"""Gains of rays of eliminated blocks: covariance of the unknowns a ray touches with its whitened value.

With the front's covariance S, the block's covariance Q and X, minus that of the kept unknowns with the block,

    K_k = S A' - X B',    K_p = Q B' - X'A'
"""

from numba import njit

from aatri.adjustment.kernels.small import OPTIONS

_SIGNATURE = (
    "void(float64[:,:,::1], float64[:,:,::1], int64[:,::1], float64[::1,:], float64[:,:,::1], int64[::1], "
    "float64[:,:,::1], float64[:,:,::1], float64[:,:,::1])"
)


@njit(_SIGNATURE, **OPTIONS)
def ray_gains(A, B, row, S, X, block, Q, kept, own):
    """Gains of n rays.

    Parameters
    ----------
    A, B : (n, m, k), (n, m, 3) float64
        Whitened Jacobians, zero for unknowns that are held.
    row : (n, k) int64
        Row of the front of each column of A, -1 where held.
    S : (size, size) float64, column-major
    X : (n, k, 3) float64
    block : (n,) int64
        Row in Q.
    Q : (n_blocks, 3, 3) float64
    kept, own : (n, k, m), (n, 3, m) float64
        Filled in: of the kept unknowns, zero where held, and of the block.
    """
    n, m, k = A.shape
    for r in range(n):
        for e in range(m):
            for a in range(3):
                s = 0.0
                for c in range(3):
                    s += Q[block[r], a, c] * B[r, e, c]
                own[r, a, e] = s
        for b in range(k):
            at = row[r, b]
            for e in range(m):
                if at < 0:
                    kept[r, b, e] = 0.0
                    continue
                s = 0.0
                for c in range(3):
                    s -= X[r, b, c] * B[r, e, c]
                kept[r, b, e] = s
            if at < 0:
                continue
            for a in range(k):
                other = row[r, a]
                if other >= 0:
                    s = S[other, at]
                    for e in range(m):
                        kept[r, b, e] += s * A[r, e, a]
            for e in range(m):
                for c in range(3):
                    own[r, c, e] -= X[r, b, c] * A[r, e, b]
