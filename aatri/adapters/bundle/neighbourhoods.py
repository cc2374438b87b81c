"""Image points near each other that are moved together, as a repetitive texture or another object moves them.

Of an image, the k points around each of its points are a neighbourhood. With whitened residuals v of them,

    |sum v|^2 / k  <=  gain

of the score test of a common shift, whatever the covariances: M = H'H - c'Qc is no more than H'H. Where that bound is
largest in an image the test itself is made, of neighbourhoods of all sizes around that point, and of the same points in
the other images: along one line of flight an error in one image looks like one in the next.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aatri.adjustment.records import whitened_residuals
from aatri.arrays import Float, Int
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.groups.effects import NEIGHBOURHOOD, Cause, Effects
from aatri.orientation.bundle.result import AdjustedObservations, BundleResult

SIZES = (3, 4, 6, 8, 12, 16, 24, 32)
"""Points of a neighbourhood."""

MOST_OF_AN_IMAGE = 0.7
"""A larger share of the points of an image is no neighbourhood: the image itself is wrong."""

MOST_OF_A_NEIGHBOURHOOD = 0.6
"""Share of its points that another image must show to be tried instead."""

LARGE, FEWEST_LARGE = 2.5, 3
"""Images with so many residuals beyond so many standard deviations are looked at."""

MOST_IMAGES = 12
"""Images that are looked at, those with the largest bounds."""


def moved_together(
    given: BundleInput, result: BundleResult, place: int, found: AdjustedObservations, rows: Int
) -> Iterator[Effects]:
    """Neighbourhoods of image points, to be tested for a common shift."""
    assert given.rays is not None
    image, records = given.rays.image[rows], found.observed.records
    v = whitened_residuals(records, result.adjusted.state, rows)
    large = np.bincount(image[(np.abs(v) > LARGE).any(axis=1)], minlength=len(given.image_ids))
    worst = []
    tests = 0
    for k in np.flatnonzero(large >= FEWEST_LARGE).tolist():
        mine = np.flatnonzero(image == k)
        near = _nearest(given.rays.xy_mm[rows[mine]])
        if near.shape[1] >= SIZES[0]:
            bound, centre = _largest_bound(v[mine], near)
            worst.append((bound, k, mine[near[centre]]))
            tests += near.size
    worst = sorted(worst, key=lambda one: -one[0])[:MOST_IMAGES]
    point = given.rays.point[rows]
    windows = [
        (j, there)
        for _, _, some in worst
        for size in SIZES
        if size <= len(some)
        for j, there in _elsewhere(image, point, some[:size])
    ]
    if not windows:
        return
    count = [len(some) for _, some in windows]
    chosen = rows[np.concatenate([some for _, some in windows])]
    names = np.array([f"point {given.point_ids[point[some[0]]]} in image {given.image_ids[k]}" for k, some in windows])
    unit = np.repeat(np.arange(len(windows)), count)
    H = np.tile(np.eye(2), (len(chosen), 1, 1))
    yield Effects(place, NEIGHBOURHOOD, names, chosen, unit, H, (Cause("shift", (0, 1)),), True, tests)


def _elsewhere(image: Int, point: Int, some: Int) -> Iterator[tuple[int, Int]]:
    """The points of a neighbourhood in each image that shows most of them: where few images do, any may be wrong."""
    rows = np.flatnonzero(np.isin(point, point[some]))
    rows = rows[np.argsort(~np.isin(rows, some), kind="stable")]
    for j in np.unique(image[rows]).tolist():
        there = rows[image[rows] == j]
        if len(there) >= max(SIZES[0], MOST_OF_A_NEIGHBOURHOOD * len(some)):
            yield j, there


def _nearest(xy_mm: Float) -> Int:
    """Each point and those near it, by distance, (n, k)."""
    from scipy.spatial import cKDTree  # slow to import

    most = min(SIZES[-1], int(MOST_OF_AN_IMAGE * len(xy_mm)))
    if most < SIZES[0]:
        return np.zeros((len(xy_mm), 0), dtype=np.int64)
    return np.asarray(cKDTree(xy_mm).query(xy_mm, k=most)[1], dtype=np.int64)


def _largest_bound(v: Float, near: Int) -> tuple[float, int]:
    """The largest bound of an image, and the point around which it is."""
    total = np.cumsum(v[near], axis=1)
    bound = (total**2).sum(axis=2) / np.arange(1, near.shape[1] + 1)
    sizes = [size - 1 for size in SIZES if size <= near.shape[1]]
    of_point = bound[:, sizes].max(axis=1)
    return float(of_point.max()), int(of_point.argmax())
