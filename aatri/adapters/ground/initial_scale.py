"""Given slope distances held against a component of images: its scale where control and positions leave it open."""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float, Text
from aatri.artifacts.block import Block
from aatri.ids import rows_of
from aatri.notes import Level, Note
from aatri.orientation.graph.component import Component

USES = ("geodetic:distance", "geodetic:distance_to_image", "relative_control:distance")

OFF = 0.01
"""Given distances that are longer or shorter by this share in the median are warned of."""


def distance_ratios(block: Block, component: Component) -> Float:
    """Given slope distances over those of a component where it holds both ends.

    Distances with instrument heights, of a group with its own scale, or reduced to another surface are left out.
    """
    g, control, members = block.geodetic, block.relative_control, block.relative_control_members
    heights = np.nan_to_num(g.start_height_m) + np.nan_to_num(g.end_height_m)
    row = np.flatnonzero((g.type == "distance") & (g.reduced == "no") & (g.group == "") & g.active & (heights == 0))
    start, end = (_places(block, component, *of) for of in ((g.start[row], g.start_kind[row]),
                                                            (g.end[row], g.end_kind[row])))  # fmt: skip
    condition = np.flatnonzero(control.type == "distance")
    first = np.searchsorted(members.condition, condition)
    kind = np.where(members.part[first] == "images", "image", "point")
    ends = [_places(block, component, members.id[first + k], kind) for k in range(2)]
    length = np.linalg.norm(np.concatenate([end - start, ends[1] - ends[0]]), axis=1)
    value = np.concatenate([g.value[row], control.value[condition]])
    known = (length > 0) & (value > 0)
    return np.asarray(value[known] / length[known])


def _places(block: Block, component: Component, ids: Text, kind: Text) -> Float:
    """Points or projection centres, (n, 3); NaN where the component does not hold them."""
    image = kind == "image"
    found = np.full((len(ids), 3), np.nan)
    for some, table, places in (
        (image, block.images.id, component.poses.position_m),
        (~image, block.points.id, component.xyz),
    ):
        row = rows_of(ids[some], table)
        found[some] = np.where((row >= 0)[:, None], places[row], np.nan)
    return found


def compared(block: Block, number: int, component: Component) -> list[Note]:
    """Distances held against a component that control and positions have oriented."""
    ratio = distance_ratios(block, component)
    if not len(ratio):
        return []
    off = float(np.median(ratio)) - 1.0
    level: Level = "warning" if abs(off) > OFF else "note"
    text = f"component {number}: given distances ({len(ratio)}) are longer than in it by {off:.2%} in the median"
    return [Note(level, text)]
