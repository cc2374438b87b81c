"""Members of the conditions of relative_control.yaml: points, or projection centres of images."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aatri.arrays import Int, Text
from aatri.observations.geodetic.sights import rows_of_ends

if TYPE_CHECKING:
    from aatri.artifacts.block import Block


def conditions(block: Block, *types: str) -> Int:
    """Rows of relative_control of some types."""
    return np.flatnonzero(np.isin(block.relative_control.type, types))


def members_of(block: Block, row: int) -> tuple[Int, Text, Text]:
    """Members of a condition in their order: rows in points or images, their ids, and `point` or `image`."""
    m = block.relative_control_members
    mine = m.condition == row
    kind = np.where(m.part[mine] == "images", "image", "point")
    return rows_of_ends(block, m.id[mine], kind), m.id[mine], kind
