"""Geodetic observations that say nothing: from a station to itself, or a distance that is not positive.

Seen: a blank line of a form, a station that was not changed; an adjustment would divide by a length of zero.
Test: none; they are set aside by name.
"""

from dataclasses import replace

import numpy as np

from aatri.artifacts.block import Block
from aatri.checks.as_read.rejects import rejected

DISTANCES = ("distance", "horizontal_distance")

TO_ITSELF = "from a station to itself"
NOT_POSITIVE = "distance not positive"


def without_unusable_sights(block: Block) -> Block:
    """The block with such observations switched off, each listed in its rejects."""
    rows = block.geodetic
    itself = (rows.start == rows.end) & (rows.start_kind == rows.end_kind)
    short = np.isin(rows.type, DISTANCES) & (rows.value <= 0)
    unusable = np.flatnonzero((itself | short) & rows.active).tolist()
    reasons = [TO_ITSELF if itself[k] else NOT_POSITIVE for k in unusable]
    block = rejected(block, "geodetic", rows, unusable, [rows.called(k) for k in unusable], reasons)
    return replace(block, geodetic=replace(rows, active=rows.active & ~itself & ~short))
