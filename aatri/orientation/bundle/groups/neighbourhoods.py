"""Image points near each other that are moved together, as a repetitive texture or another object moves them.

Of an image, the k points around each of its points are a neighbourhood. With whitened residuals v of them,

    |sum v|^2 / k  <=  gain

of the score test of a common shift, whatever the covariances: M = H'H - c'Qc is no more than H'H. Images are compared
by that bound around their points with a large residual. Where it is largest the point is looked for around which it is
largest of all, and the test itself is made, of neighbourhoods of all sizes around that point, and of the same points in
the other images: along one line of flight an error in one image looks like one in the next.
"""

from collections.abc import Iterator

import numpy as np
from scipy.special import chdtri

from aatri.adjustment.unknowns import Ids
from aatri.arrays import Bool, Float, Int
from aatri.observations.image_point_rows import ImagePointRows
from aatri.orientation.bundle.groups.candidates import NEIGHBOURHOOD, Candidates, Cause, dispersion_of
from aatri.orientation.bundle.groups.limits import (
    FEWEST_LARGE,
    LARGE_RESIDUAL,
    LEAST_LEFT,
    MOST_IMAGES_TESTED,
    MOST_OF_A_NEIGHBOURHOOD,
    MOST_OF_AN_IMAGE,
    MOST_TYPICAL,
)

SIZES = (3, 4, 6, 8, 12, 16, 24, 32)
"""Points of a neighbourhood."""


def moved_together(
    rays: ImagePointRows, image_ids: Ids, point_ids: Ids, place: int, rows: Int, v: Float
) -> Iterator[Candidates]:
    """Neighbourhoods of image points, to be tested for a common shift; v (n, 2), the whitened residuals of the rows."""
    image, point, xy_mm = rays.image[rows], rays.point[rows], rays.xy_mm[rows]
    large: Bool = np.asarray((np.abs(v) > LARGE_RESIDUAL).any(axis=1))
    order, count = np.argsort(image, kind="stable"), np.bincount(image, minlength=len(image_ids))
    last = np.cumsum(count)
    searched = [
        order[last[k] - count[k] : last[k]]
        for k in np.flatnonzero(np.bincount(image[large], minlength=len(count)) >= FEWEST_LARGE)
        if _most(count[k]) >= SIZES[0]
    ]
    bounds = [_largest(xy_mm[those], v[those], np.flatnonzero(large[those]))[0] for those in searched]
    worst = []
    for k in np.argsort(bounds)[: -2 * MOST_IMAGES_TESTED - 1 : -1].tolist():
        those = searched[k]
        bound, near = _largest(xy_mm[those], v[those], np.arange(len(those)))
        worst.append((bound, those[near]))
    worst = sorted(worst, key=lambda one: -one[0])[:MOST_IMAGES_TESTED]
    if not worst:
        return
    seen = np.isin(np.arange(len(point_ids)), point[np.concatenate([those for _, those in worst])])[point]
    candidates = np.flatnonzero(seen)
    windows = [
        (j, there, size)
        for _, those in worst
        for size in SIZES
        if size <= len(those)
        for j, there in _elsewhere(image, point, candidates, those[:size])
    ]
    chosen = rows[np.concatenate([those for _, those, _ in windows])]
    names = [f"point {point_ids[point[those[0]]]} in image {image_ids[k]}" for k, those, _ in windows]
    unit = np.repeat(np.arange(len(windows)), [len(those) for _, those, _ in windows])
    H = np.tile(np.eye(2), (len(chosen), 1, 1))
    tests = sum(len(those) * _most(len(those)) for those in searched)
    of_size = _dispersions(xy_mm, v, [order[last[k] - count[k] : last[k]] for k in np.flatnonzero(count)])
    yield Candidates(
        place,
        NEIGHBOURHOOD,
        np.array(names),
        chosen,
        unit,
        H,
        (Cause("shift", (0, 1)),),
        removable=True,
        tests=tests,
        least_left=LEAST_LEFT,
        dispersion=np.array([of_size[size] for _, _, size in windows]),
    )


def _elsewhere(image: Int, point: Int, candidates: Int, near: Int) -> Iterator[tuple[int, Int]]:
    """The points of a neighbourhood in each image that shows most of them: where few images do, any may be wrong."""
    rows = candidates[np.isin(point[candidates], point[near])]
    rows = rows[np.argsort(~np.isin(rows, near), kind="stable")]
    for j in np.unique(image[rows]).tolist():
        there = rows[image[rows] == j]
        if len(there) >= max(SIZES[0], MOST_OF_A_NEIGHBOURHOOD * len(near)):
            yield j, there


def _most(points: int) -> int:
    """Points of the largest neighbourhood in an image of so many."""
    return min(SIZES[-1], int(MOST_OF_AN_IMAGE * points))


def _largest(xy_mm: Float, v: Float, centres: Int) -> tuple[float, Int]:
    """The largest bound around some points of an image, and the points near the one where it is, by distance."""
    near, bound = _bounds(xy_mm, v, centres)
    of_point = bound[:, [size - 1 for size in SIZES if size <= near.shape[1]]].max(axis=1)
    return float(of_point.max()), near[of_point.argmax()]


def _bounds(xy_mm: Float, v: Float, centres: Int) -> tuple[Int, Float]:
    """Points near some points of an image, by distance, and the bounds of as many of them, (n, most) both."""
    from scipy.spatial import cKDTree  # slow to import

    near = np.asarray(cKDTree(xy_mm).query(xy_mm[centres], k=_most(len(xy_mm)))[1], dtype=np.int64)
    total = np.cumsum(v[near], axis=1)
    return near, (total**2).sum(axis=2) / np.arange(1, near.shape[1] + 1)


def _dispersions(xy_mm: Float, v: Float, of_images: list[Int]) -> dict[int, float]:
    """What neighbourhoods of each size have in common over the block, in images that are chosen evenly of all."""
    large = [one for one in of_images if _most(len(one)) >= SIZES[0]]
    chosen = [large[k] for k in np.unique(np.linspace(0, len(large) - 1, min(MOST_TYPICAL, len(large))).astype(int))]
    bounds = [_bounds(xy_mm[one], v[one], np.arange(len(one)))[1] for one in chosen]
    squares = {size: [b[:, size - 1] for b in bounds if b.shape[1] >= size] for size in SIZES}
    variance = float(np.median(np.concatenate([v[one].ravel() for one in chosen]) ** 2)) / float(chdtri(1.0, 0.5))
    return {
        size: dispersion_of(np.concatenate(of_size), 2, variance) if of_size else 1.0
        for size, of_size in squares.items()
    }
