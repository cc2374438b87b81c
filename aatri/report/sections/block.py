"""The block as given: cameras with what of them is unknown, and what was set aside."""

import numpy as np

from aatri.artifacts.block import Block
from aatri.report.sections.frames import frame_tables
from aatri.report.sections.parts import PageSection, Surroundings, present
from aatri.report.sections.tables import Columns, PageTable, all_rows, axes, rejects_table
from aatri.units import DASH


def show(made: PageSection, block: Block, _around: Surroundings) -> None:
    """Add what was set aside."""
    made.tables.extend(present(rejects_table(block.rejects)))


def camera_tables(block: Block) -> list[PageTable]:
    """Cameras and frames."""
    cameras = block.cameras
    columns: Columns = {
        "camera": cameras.id,
        "kind": cameras.kind,
        "distortion": cameras.distortion,
        "unknown parameters": [_unknown(block, k) for k in range(len(cameras))],
        "principal distance mm": (cameras.principal_distance_mm, "{:.4f}".format),
        **axes(("principal point x mm", "y mm"), cameras.principal_point_mm, "{:.4f}".format),
        "format": (cameras.format, lambda size: " x ".join(f"{v:g}" for v in size)),
        "images": np.bincount(block.images.camera, minlength=len(cameras)),
    }
    return [*present(all_rows("Cameras", columns)), *frame_tables(block)]


def _unknown(block: Block, k: int) -> str:
    rows = block.camera_parameters
    free = rows.name[(rows.camera == k) & (rows.free | (np.nan_to_num(rows.sigma) > 0))].tolist()
    return ", ".join(free) or DASH
