"""The block as given: cameras with what of them is unknown, and what was set aside."""

from __future__ import annotations

import numpy as np

from aatri.artifacts.block import Block
from aatri.report.numbers import DASH, number
from aatri.report.sections import tables
from aatri.report.sections.frames import frame_tables
from aatri.report.sections.parts import Section, Surroundings, present


def show(made: Section, block: Block, _around: Surroundings) -> None:
    """Add frames, cameras and rejects."""
    cameras = block.cameras
    columns = {
        "camera": lambda k: str(cameras.id[k]),
        "kind": lambda k: str(cameras.kind[k]),
        "distortion": lambda k: str(cameras.distortion[k]),
        "unknown": lambda k: _unknown(block, k),
        "principal distance mm": lambda k: f"{cameras.principal_distance_mm[k]:.4f}",
        "principal point x mm": lambda k: f"{cameras.principal_point_mm[k, 0]:.4f}",
        "y mm": lambda k: f"{cameras.principal_point_mm[k, 1]:.4f}",
        "format": lambda k: " x ".join(number(float(v)) for v in cameras.format[k]),
        "images": lambda k: number(int((block.images.camera == k).sum())),
    }
    crs = f"{block.frames.crs[0]} {block.frames.vertical[0]}".strip()
    made.notes.append(f"Coordinates are in frame {block.frames.id[0]} ({crs}).")
    made.tables.extend(frame_tables(block))
    made.tables.extend(present(tables.all_rows("Cameras", cameras, columns, 4), tables.rejects_table(block.rejects)))


def _unknown(block: Block, k: int) -> str:
    rows = block.camera_parameters
    free = rows.name[(rows.camera == k) & (rows.free | (np.nan_to_num(rows.sigma) > 0))].tolist()
    return ", ".join(free) or DASH
