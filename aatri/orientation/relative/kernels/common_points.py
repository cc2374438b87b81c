"""Common points of pairs of images, compiled: both lists of points are ascending and run through side by side."""

from numba import njit

from aatri.adjustment.kernels.small import OPTIONS


@njit("void(int64, int64, int64[:,::1], int64[::1], int64[::1], int64[::1])", **OPTIONS)
def count_common(first, last, images, begin, point, count):
    """How many points the pairs first ... last - 1 have in common.

    Parameters
    ----------
    images : (m, 2) int64
    begin : (n_images + 1,) int64
        First row of each image in `point`.
    point : (n,) int64
        Ascending within an image.
    count : (m,) int64
        Filled in.
    """
    for pair in range(first, last):
        i, j = begin[images[pair, 0]], begin[images[pair, 1]]
        end_i, end_j = begin[images[pair, 0] + 1], begin[images[pair, 1] + 1]
        found = 0
        while i < end_i and j < end_j:
            if point[i] == point[j]:
                found += 1
                i += 1
                j += 1
            elif point[i] < point[j]:
                i += 1
            else:
                j += 1
        count[pair] = found


@njit("void(int64, int64, int64[:,::1], int64[::1], int64[::1], int64[::1], int64[::1], int64[::1])", **OPTIONS)
def find_common(first, last, images, begin, point, start, left, right):
    """Their rows in `point`, from `start` of each pair on, into left and right."""
    for pair in range(first, last):
        i, j = begin[images[pair, 0]], begin[images[pair, 1]]
        end_i, end_j = begin[images[pair, 0] + 1], begin[images[pair, 1] + 1]
        k = start[pair]
        while i < end_i and j < end_j:
            if point[i] == point[j]:
                left[k], right[k] = i, j
                k += 1
                i += 1
                j += 1
            elif point[i] < point[j]:
                i += 1
            else:
                j += 1
