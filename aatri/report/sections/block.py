"""The block as given: cameras with what of them is unknown, and what was set aside."""

import numpy as np

from aatri.artifacts.block import Block
from aatri.report.sections.frames import frame_tables
from aatri.report.sections.parts import PageSection, Surroundings, present
from aatri.report.sections.tables import Columns, all_rows, axes, rejects_table
from aatri.report.view.numbers import DASH, number


def show(made: PageSection, block: Block, _around: Surroundings) -> None:
    """Add frames, cameras and rejects."""
    cameras = block.cameras
    columns: Columns = {
        "camera": cameras.id,
        "kind": cameras.kind,
        "distortion": cameras.distortion,
        "unknown": [_unknown(block, k) for k in range(len(cameras))],
        "principal distance mm": (cameras.principal_distance_mm, "{:.4f}".format),
        **axes(("principal point x mm", "y mm"), cameras.principal_point_mm, "{:.4f}".format),
        "format": (cameras.format, lambda size: " x ".join(number(float(v)) for v in size)),
        "images": np.bincount(block.images.camera, minlength=len(cameras)),
    }
    crs = f"{block.frames.crs[0]} {block.frames.vertical[0]}".strip()
    made.notes.append(f"Coordinates are in frame {block.frames.id[0]} ({crs}).")
    made.tables.extend(frame_tables(block))
    made.tables.extend(present(all_rows("Cameras", columns), rejects_table(block.rejects)))


def _unknown(block: Block, k: int) -> str:
    rows = block.camera_parameters
    free = rows.name[(rows.camera == k) & (rows.free | (np.nan_to_num(rows.sigma) > 0))].tolist()
    return ", ".join(free) or DASH
