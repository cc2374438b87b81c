"""Matches of the features of two images: mutual nearest neighbours that are clearly nearer than the second.

    d^2 = 2 - 2 a'b,   d_1 < 0.8 d_2,   a, b roots of the histograms, of length 1

Matrix products find all distances: for some thousand features no search tree is faster.

Source: Lowe 2004 (ratio); Arandjelovic & Zisserman 2012 (roots).
"""

import numpy as np
from scipy.spatial import KDTree

from aatri.arrays import Float, Int
from aatri.artifacts.features import Features, Keypoints, MatchedKeypoints, Matches
from aatri.pixels.limits import COARSE_MATCHES, NEXT_RATIO

ROWS = 256
"""Rows of the matrix of likenesses that are looked at while they are in the processor's cache."""
COARSE = 500
"""Largest features of each image that find pairs."""


def matches_of(left: Features, right: Features, ratio: float = NEXT_RATIO) -> Matches:
    """Matches of two images."""
    rows = matched(rooted(left.keypoints), rooted(right.keypoints), ratio)
    return Matches(pairs=MatchedKeypoints(left=rows[:, 0], right=rows[:, 1]))


def rooted(keypoints: Keypoints) -> Float:
    """Descriptors (n, 128) of length 1, the roots of the histograms, single precision."""
    histogram = keypoints.descriptor.astype(np.float32) + 128.0
    return np.asarray(np.sqrt(histogram / np.maximum(histogram.sum(axis=1, keepdims=True), 1e-9)))


def matched(left: Float, right: Float, ratio: float = NEXT_RATIO) -> Int:
    """Rows (m, 2) of descriptors that match.

    Parameters
    ----------
    left, right : (n, 128) float32
        Of length 1.
    ratio : float
        Largest ratio of the distance to that of the second.
    """
    if min(len(left), len(right)) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    n, nearest_of_right = len(left), np.full(len(right), -np.inf, dtype=np.float32)
    to_right, best, second = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.float32), np.empty(n, dtype=np.float32)
    for first in range(0, n, ROWS):
        likeness, part = left[first : first + ROWS] @ right.T, slice(first, first + ROWS)
        np.maximum(nearest_of_right, likeness.max(axis=0), out=nearest_of_right)
        rows, nearest = np.arange(len(likeness)), likeness.argmax(axis=1)
        to_right[part], best[part] = nearest, likeness[rows, nearest]
        likeness[rows, nearest] = -1.0
        second[part] = likeness.max(axis=1)
    clear = np.sqrt(np.maximum(2 - 2 * best, 0)) < ratio * np.sqrt(np.maximum(2 - 2 * second, 0))
    mutual = np.flatnonzero(clear & (best >= nearest_of_right[to_right]))
    kept = np.sort(mutual[np.unique(to_right[mutual], return_index=True)[1]])  # of equal ones the first
    return np.column_stack([kept, to_right[kept]])


def largest(keypoints: Keypoints) -> Float:
    """Descriptors of the largest features of an image."""
    rows = np.argsort(-keypoints.size_px, kind="stable")[:COARSE]
    return rooted(keypoints.take(rows))


def coarse_pairs(largest_of: list[Float]) -> Int:
    """Pairs (m, 2) of images whose largest features match; all against all."""
    n = len(largest_of)
    pairs = [
        (i, j)
        for i in range(n)
        for j in range(i + 1, n)
        if len(matched(largest_of[i], largest_of[j])) >= COARSE_MATCHES
    ]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def near_pairs(position_m: Float, neighbours: int) -> Int:
    """Pairs (m, 2) of images taken near each other in plan: of each the next `neighbours`.

    Parameters
    ----------
    position_m : (n, 2) or (n, 3) float64, m
        NaN where not known: such images pair with none.
    """
    placed = np.flatnonzero(np.isfinite(position_m[:, :2]).all(axis=1))
    if len(placed) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    near = KDTree(position_m[placed, :2]).query(position_m[placed, :2], k=min(neighbours + 1, len(placed)))[1]
    pairs = np.column_stack([np.repeat(placed, near.shape[1]), placed[near.ravel()]])
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    return np.unique(np.sort(pairs, axis=1), axis=0)


def consecutive_pairs(order: Int, neighbours: int) -> Int:
    """Pairs (m, 2) of images that follow each other within `neighbours` places."""
    steps = [np.column_stack([order[:-k], order[k:]]) for k in range(1, min(neighbours, len(order) - 1) + 1)]
    return np.unique(np.sort(np.concatenate([np.zeros((0, 2), np.int64), *steps]), axis=1), axis=0)


def all_pairs(n: int) -> Int:
    """All pairs (m, 2) of n images."""
    return np.column_stack(np.triu_indices(n, 1))
