"""A Block that is there already as a source beside others: its tables by ids again."""

from pathlib import Path
from typing import Any

import numpy as np

from aatri.artifacts.block import TRUTH, Block, Frames
from aatri.formats.parts.block_parts import KINDS, LOCAL, BlockParts
from aatri.frames.conversion import Frame
from aatri.frames.heights import is_tangent_frame
from aatri.geometry.rotations import rotation_from_angles
from aatri.tables.schema import columns_of, tables_of

BY_IDS = {*KINDS, "files", "frames", "strips", "points", "rejects"}


def parts_of(block: Block, format: str) -> BlockParts:
    """The parts of a Block.

    Angles become rotations, unless they are those of a carrier, which hang on mount and boresight.
    """
    tables: dict[str, Any] = {name: _by_ids(block, name) for name in KINDS if len(getattr(block, name))}
    if "exterior" in tables and block.rotation != "roll-pitch-heading":
        angles = tables["exterior"].pop("angles_rad")
        tables["exterior"]["ground_from_image"] = rotation_from_angles(angles, block.rotation)
    others: dict[str, Any] = {
        name: getattr(block, name)
        for name in tables_of(Block)
        if name not in BY_IDS | TRUTH and len(getattr(block, name) or ())
    }
    for name in ("geodetic_covariances", "ground_point_covariances"):  # `block_of` takes them as columns
        if name in others:
            others[name] = {column: getattr(others[name], column) for column in columns_of(type(others[name]))}
    others |= {n: getattr(block, n) for n in ("heading", "terrain_height_m", "undulation_m")}
    if block.rotation == "roll-pitch-heading":
        others["rotation"] = block.rotation
    return BlockParts(
        format,
        [Path(path) for path in block.files.path.tolist()],
        name=block.name,
        frame=frame_of(block),
        others=others,
        **tables,
    )


def frame_of(block: Block) -> Frame:
    """The frame of the coordinates of a Block, axes as they stand in it."""
    crs, axes = str(block.frames.crs[0]), str(block.frames.axes[0]).split(",")
    if crs == "local":
        return LOCAL
    right_handed = tuple(axes) if set(axes) == {"x", "y", "z"} else ("east", "north", "up")
    return Frame(str(block.frames.id[0]), right_handed, crs, str(block.frames.vertical[0]))


def columns_of_frame(frame: Frame) -> dict[str, Any]:
    """What a Block says of its frame."""
    cartesian = frame.crs == "local" or is_tangent_frame(frame.crs) or set(frame.axes) == {"x", "y", "z"}
    frames = Frames.of(id=frame.name, axes=",".join(frame.axes), crs=frame.crs, vertical=frame.vertical)
    return {"frames": frames, "earth_curvature": "ignore" if cartesian else "frame"}


def _by_ids(block: Block, table: str) -> dict[str, Any]:
    rows = getattr(block, table)
    columns: dict[str, Any] = {}
    for name, declared in columns_of(type(rows)).items():
        values = getattr(rows, name)
        if declared.refers and declared.refers != "files":
            ids = np.append(getattr(block, declared.refers).id, "").astype(np.str_)
            values = ids[values]
        columns[name] = values
    return columns
