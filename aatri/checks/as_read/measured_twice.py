"""A point measured twice in an image, with different results.

Seen: two objects under one number, or a pointing that slipped; a mean of the two is neither.
Test: the two differ by more than `SAME_POINT_SIGMAS` standard deviations of their difference in a coordinate.
"""

import numpy as np

from aatri.arrays import Bool, Int
from aatri.artifacts.block import Block
from aatri.checks.as_read.rejects import name_of_image_point
from aatri.checks.finding import Finding
from aatri.checks.limits import MOST_LISTED, SAME_POINT_SIGMAS


def measured_twice(block: Block) -> list[Finding]:
    """Errors for points measured twice in an image with different results."""
    rows, cameras = block.image_points, block.cameras
    order, first = _by_image_and_point(block, rows.active)
    leader = order[np.maximum.accumulate(np.where(first, np.arange(len(order)), 0))]
    pixel = (cameras.image_coordinates == "pixel")[:, None]
    mm_per_unit = np.where(pixel, cameras.pixel_size_mm, 1.0)[block.images.camera[rows.image[order]]].reshape(-1, 2)
    sigma = np.hypot(rows.sigma_mm[order], rows.sigma_mm[leader]) / mm_per_unit
    apart = (np.abs(rows.xy[order] - rows.xy[leader]) > SAME_POINT_SIGMAS * sigma).any(axis=1)
    findings = []
    for k in np.flatnonzero(apart)[:MOST_LISTED]:
        a, b = int(leader[k]), int(order[k])
        gap = np.abs(rows.xy[b] - rows.xy[a]).max()
        unit = "px" if pixel[block.images.camera[rows.image[b]], 0] else "mm"
        text = f"image point {name_of_image_point(block, b)} measured twice, {gap:g} {unit} apart"
        text = f"{text} (first: {block.read_at(rows, a)})"
        remedy = "remove the wrong one; or two points have one name, as markers and tie points may: rename one"
        findings.append(Finding("measured_twice", "error", text, remedy, where=block.read_at(rows, b)))
    return findings


def of_image_and_point(block: Block, active: Bool) -> Int:
    """Rows of the active image points, one for each image and point."""
    order, first = _by_image_and_point(block, active)
    return order[first]


def _by_image_and_point(block: Block, active: Bool) -> tuple[Int, Bool]:
    """Active image points by image and point, and which of them begin a pair."""
    rows = np.flatnonzero(active)
    points = block.image_points
    key = (points.image.astype(np.int64) * max(1, len(block.points)) + points.point)[rows]
    order = np.argsort(key, kind="stable")  # the rows are sorted already, which makes this cheap
    key = key[order]
    return rows[order], np.concatenate([[True], key[1:] != key[:-1]])[: len(key)]
