"""Images with each other's position: where a start finds image a at the position given for b, and b at that of a.

Such a pair is left out before anything is adjusted, with all that is observed of its images, positions and attitudes:
metres of contradiction in a start would bend everything else. What the search for gross errors says of it, and whether
it comes back, follows from the adjustment without. A start that was made of the positions themselves says nothing.
"""

from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics.exchanged import exchanged_at_start
from aatri.arrays import Bool
from aatri.observations.observed import Observed
from aatri.observations.poses import POSE
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bundle.block import BundleInput, start_of


def without_exchanged_images(block: BundleInput) -> BundleInput:
    """The block without positions and attitudes of exchanged images, as if an earlier stage had rejected them."""
    at_start, seen = np.full((2, len(block.image_ids), 3), np.nan)
    state = start_of(block)
    for o in block.observed:
        image = dict(o.records.touches).get(POSE)
        if o.kind == POSITION and image is not None and o.records.rows == 3:
            rows = np.flatnonzero(o.records.active & o.records.observed_components().all(axis=1))
            v, (by_pose, *_) = o.records.evaluate(state, rows)
            at_start[image[rows]] = block.poses.position_m[image[rows]]
            seen[image[rows]] = at_start[image[rows]] - np.linalg.solve(by_pose[:, :, :3], v[:, :, None])[:, :, 0]
    exchanged = np.zeros(len(block.image_ids), dtype=bool)
    for pair in exchanged_at_start(at_start, seen):
        exchanged[[pair.first, pair.second]] = True
    if not exchanged.any():
        return block
    return replace(block, observed=tuple(_without(o, exchanged) for o in block.observed))


def _without(o: Observed, images: Bool) -> Observed:
    """Without the rows that touch one of the images and no ground point."""
    groups = dict(o.records.touches)
    if POSE not in groups or o.exact or o.components or "point" in groups:
        return o
    rejected = images[groups[POSE]]
    return o.again().without(rejected if o.rejected is None else rejected | o.rejected)
