"""Images with each other's position and control points with each other's number, as a start shows them.

It finds image a at the position given for b, and b at that of a; or the rays of two control points meet where the other
is given. Such a pair is left out before anything is adjusted, of images with all that is observed of them, positions
and attitudes: metres of contradiction would bend everything else, or come to no end. What the search for gross errors
says of it, and whether it comes back, follows from the adjustment without. A start that was made of the positions
themselves says nothing.
"""

from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics.exchanged import exchanged_at_start
from aatri.arrays import Bool, Float, Int
from aatri.geometry.intersection import intersect_rays
from aatri.observations.control import KIND as CONTROL
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bundle.block import BundleInput, start_of


def without_exchanged(block: BundleInput) -> BundleInput:
    """The block without exchanged positions, attitudes of their images, and control, as if these had been rejected."""
    images = _exchanged(*_positions(block), len(block.image_ids))
    points = _exchanged(*_control(block), len(block.point_ids))
    if not (images.any() or points.any()):
        return block
    return replace(block, observed=tuple(_without(o, images, points) for o in block.observed))


def _exchanged(number: Int, at_start_m: Float, given_m: Float, count: int) -> Bool:
    exchanged = np.zeros(count, dtype=bool)
    for pair in exchanged_at_start(at_start_m, given_m):
        exchanged[number[[pair.first, pair.second]]] = True
    return exchanged


def _positions(block: BundleInput) -> tuple[Int, Float, Float]:
    """Images with an observed position in full, their projection centres at the start, and as observed."""
    given_m = np.full((len(block.image_ids), 3), np.nan)
    for o in block.observed:
        image = dict(o.records.touches).get(POSE)
        if o.kind == POSITION and image is not None and o.records.rows == 3:
            rows = np.flatnonzero(o.records.active & o.records.observed_components().all(axis=1))
            v, (by_pose, *_) = o.records.evaluate(start_of(block), rows)
            off = np.linalg.solve(by_pose[:, :, :3], v[:, :, None])[:, :, 0]
            given_m[image[rows]] = block.poses.position_m[image[rows]] - off
    number = np.flatnonzero(np.isfinite(given_m).all(axis=1))
    return number, block.poses.position_m[number], given_m[number]


def _control(block: BundleInput) -> tuple[Int, Float, Float]:
    """Points with control that is not exact, where their rays meet at the start, and where they are given."""
    of = [
        (o, np.flatnonzero(o.records.active))
        for o in block.observed
        if o.kind == CONTROL
        and o.holds is None
        and not o.exact
        and [group for group, _ in o.records.touches] == [POINT]
    ]
    nothing, rays = np.zeros((0, 3)), block.rays
    number = np.concatenate([np.zeros(0, dtype=np.int64), *(o.records.touches[0][1][rows] for o, rows in of)])
    if rays is None or not len(number):
        return number[:0], nothing, nothing
    place = np.full(len(block.point_ids), -1)
    place[number] = np.arange(len(number))
    rows = np.flatnonzero(rays.active & block.poses.oriented[rays.image] & (place[rays.point] >= 0))
    X0, direction = block.poses.position_m[rays.image[rows]], rays.directions(block.poses, rows)
    seen_m = intersect_rays(X0, direction, place[rays.point[rows]], len(number))
    xyz = np.zeros((len(block.point_ids), 3))
    xyz[number] = np.nan_to_num(seen_m)
    off = np.concatenate([o.records.evaluate({POINT: xyz}, some)[0] for o, some in of])
    observed = np.concatenate([o.records.observed_components()[some] for o, some in of])
    return number, seen_m, np.where(observed, xyz[number] - off, np.nan)


def _without(o: Observed, images: Bool, points: Bool) -> Observed:
    """Without what is observed of one of the images or of one of the points alone."""
    groups = dict(o.records.touches)
    if o.exact or o.components or len({POSE, POINT} & set(groups)) != 1 or (POINT in groups and o.kind != CONTROL):
        return o
    rejected = images[groups[POSE]] if POSE in groups else points[groups[POINT]]
    return o.again().without(rejected if o.rejected is None else rejected | o.rejected)
