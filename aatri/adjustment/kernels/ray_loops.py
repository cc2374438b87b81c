"""Inner loops over the unknowns that a ray touches, as parts of `eliminate` and of `block_covariances`.

Rays of images and of models have a single part with few unknowns; for them the loops have constant lengths (`SIZES`),
which is up to 3 times as fast at 7 unknowns, and no faster at 12 and 15 (measured). Only these loops are compiled for
each size; the functions around them, which Numba's front end takes seconds to read, once for all.

Numba counts negative indices from the end. Where the first index of a loop is tested not to be negative, as none is, the
compiler knows it of all that follow, and the loop is faster by a fifth.
"""

from collections.abc import Callable
from typing import Any

from numba import njit

from aatri.adjustment.kernels.small import OPTIONS

SIZES = ((2, 6), (3, 7), (0, 0))
"""Residuals and unknowns of a part that have loops of constant length: images, models; zeros: any."""

INNER: dict[str, Any] = {**OPTIONS, "forceinline": True}
"""Of inner loops that become part of each function that calls them."""


def _sized(of_k: int) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """The loop of a size under a name of its own.

    Numba tells symbols apart by name, signature and a number that each process counts by itself. Loops of one name that
    two processes have compiled side by side may have one symbol, and the linker takes either for both.
    """

    def named(loop: Callable[..., Any]) -> Callable[..., Any]:
        loop.__qualname__ += f"_{of_k}"
        return loop

    return named


def _adder(of_m: int, of_k: int) -> Callable[..., Any]:
    """Y += L^-1 B'A, N += A'A and gradient += A'(v - B L^-T y) for a part of a ray."""

    @njit("void(int64, int64, int64, int64, int64, int64, int64, float64, float64, float64, float64, float64, float64, "
          "float64, float64, float64, float64, float64, float64[:,::1], float64[:,:,::1], float64[:,:,::1], "
          "float64[:,::1], float64[:,::1], float64[::1])", **INNER)  # fmt: skip
    @_sized(of_k)
    def add(m, k, r, s, row, o, c, f0, f1, f2, i1, i2, l1, l2, l4, y0, y1, y2, v, A, B, Y, N, g):
        m, k = of_m if of_m else m, of_k if of_k else k
        if s < 0 or o < 0 or c < 0 or row < 0 or r < 0:  # never so, see above
            return
        for i in range(m):
            # a row of B L^-T, and what is left of v
            u0 = B[r, i, 0] * f0
            u1 = (B[r, i, 1] * f1 - l1 * u0) * i1
            u2 = (B[r, i, 2] * f2 - l2 * u0 - l4 * u1) * i2
            e = v[r, i] - u0 * y0 - u1 * y1 - u2 * y2
            for a in range(k):
                Y[row, o + a] += u0 * A[r, i, s + a]
            for a in range(k):
                Y[row + 1, o + a] += u1 * A[r, i, s + a]
            for a in range(k):
                Y[row + 2, o + a] += u2 * A[r, i, s + a]
            for a in range(k):
                g[c + a] += e * A[r, i, s + a]
            for a in range(k):
                x = A[r, i, s + a]
                for b in range(k):
                    N[o + a, b] += x * A[r, i, s + b]

    compiled: Callable[..., Any] = add
    return compiled


def _into_front(of_k: int) -> Callable[..., Any]:
    """Front += N - S, and the diagonal, for the places of a group, of k unknowns each."""

    @njit("void(int64, int64[:,::1], float64[:,::1], float64[:,::1], float64[::1,:], float64[::1])", **INNER)
    @_sized(of_k)
    def group(n, places, S, N, F, diagonal):
        for q in range(n):
            k = of_k if of_k else places[1, q + 1] - places[1, q]
            c, o = places[0, q], of_k * q if of_k else places[1, q]
            for b in range(k):
                diagonal[c + b] += N[o + b, b]
                for a in range(k):
                    S[o + b, o + a] -= N[o + b, a]
                for other in range(q, n):
                    d, first = places[0, other], of_k * other if of_k else places[1, other]
                    for a in range(of_k if of_k else places[1, other + 1] - first):
                        F[d + a, c + b] -= S[o + b, first + a]

    compiled: Callable[..., Any] = group
    return compiled


def _onto(of_m: int, of_k: int) -> Callable[..., Any]:
    """Z += A'B L^-T for a part of a ray."""

    @njit("void(int64, int64, int64, int64, int64, int64, float64, float64, float64, float64, float64, float64, float64, "
          "float64, float64[:,:,::1], float64[:,:,::1], float64[:,::1])", **INNER)  # fmt: skip
    @_sized(of_k)
    def onto(m, k, r, s, o, j, f0, f1, f2, i1, i2, l1, l2, l4, A, B, Z):
        m, k = of_m if of_m else m, of_k if of_k else k
        if s < 0 or o < 0 or r < 0 or j < 0:  # never so, see above
            return
        for i in range(m):
            u0 = B[r, i, 0] * f0
            u1 = (B[r, i, 1] * f1 - l1 * u0) * i1
            u2 = (B[r, i, 2] * f2 - l2 * u0 - l4 * u1) * i2
            for a in range(k):
                x, y, z, w = Z[o + a, j], Z[o + a, j + 1], Z[o + a, j + 2], A[r, i, s + a]
                Z[o + a, j] = x + w * u0
                Z[o + a, j + 1] = y + w * u1
                Z[o + a, j + 2] = z + w * u2

    compiled: Callable[..., Any] = onto
    return compiled


def _product(of_m: int, of_k: int) -> Callable[..., Any]:
    """Rows of A S for a pair of parts of a ray: set where there is but one part, added up for others."""

    @njit("void(int64, int64, int64, int64, int64, int64, int64, int64, float64[:,::1], float64[:,:,::1], float64[:,::1])",
          **INNER)  # fmt: skip
    @_sized(of_k)
    def multiply(m, k, of_other, r, s, o, e, t, S, A, half):
        m, k, of_other = of_m if of_m else m, of_k if of_k else k, of_k if of_k else of_other
        if s < 0 or o < 0 or r < 0 or e < 0 or t < 0:  # never so, see above
            return
        for i in range(m):
            for a in range(k):
                x = 0.0 if of_k else half[i, s + a]
                for b in range(of_other):
                    x += S[o + a, t + b] * A[r, i, e + b]
                half[i, s + a] = x

    compiled: Callable[..., Any] = multiply
    return compiled


def _gatherer(of_k: int) -> Callable[..., Any]:
    """The part of S of a group's places, of k unknowns each."""

    @njit("void(int64, int64[:,::1], float64[::1,:], float64[:,::1])", **INNER)
    @_sized(of_k)
    def copy(n, places, S, part_S):
        for q in range(n):
            for b in range(of_k if of_k else places[1, q + 1] - places[1, q]):
                o = of_k * q + b if of_k else places[1, q] + b
                for other in range(n):
                    t = of_k * other if of_k else places[1, other]
                    for a in range(of_k if of_k else places[1, other + 1] - t):
                        part_S[o, t + a] = S[places[0, other] + a, places[0, q] + b]

    compiled: Callable[..., Any] = copy
    return compiled


add_image_ray, add_model_ray, add_ray = (_adder(*size) for size in SIZES)
images_into_front, models_into_front, into_front = (_into_front(k) for _, k in SIZES)
image_ray_onto, model_ray_onto, ray_onto = (_onto(*size) for size in SIZES)
image_product, model_product, product = (_product(*size) for size in SIZES)
gather_images, gather_models, gather = (_gatherer(k) for _, k in SIZES)


@njit("int64(int64, int64, int64)", **INNER)
def size_of(m, parts, k):
    """Which of `SIZES` are those of a ray of some parts."""
    if parts == 1 and m == 2 and k == 6:
        return 0
    return 1 if parts == 1 and m == 3 and k == 7 else 2
