"""The block as given: cameras with what of them is unknown, what was set aside, and the frames.

These are the declared ones, and that of the adjustment, with scale and convergence of the map there:

scale = sqrt(|det D_plan|),    convergence = from true north to grid north, clockwise        (`aatri.frames.tangent`)
"""

import numpy as np

from aatri.adapters.frame.adjustment_frame import frame_of, geodesy_of
from aatri.artifacts.block import Block
from aatri.errors import AatriError
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


LOCAL = "local"


def frame_tables(block: Block) -> list[PageTable]:
    """The declared frames, and the frame of the adjustment where there is an Earth."""
    frames = block.frames
    columns: Columns = {"frame": frames.id, "axes": frames.axes, "CRS": frames.crs, "vertical": frames.vertical}
    of_block = all_rows("Coordinate frames of the input; results are in the first", columns)
    return present(of_block, _of_adjustment(block))


def _of_adjustment(block: Block) -> PageTable | None:
    if not len(block.frames) or str(block.frames.crs[0]) == LOCAL:
        return None
    try:
        frame = frame_of(block)
    except AatriError as error:
        return PageTable("Frame of the adjustment", ("", ""), [("none", str(error))], 2)
    geodesy = geodesy_of(block, frame)
    rows = [
        ("adjusted in", "a tangent frame of the ellipsoid" if frame is not None else "the block's own frame"),
        ("earth_curvature", block.earth_curvature),
    ]
    if geodesy is not None:
        origin = np.zeros((1, 3))
        place = ", ".join(f"{value:.0f}" for value in geodesy.to_block(origin)[0])
        rows.append(("origin" if frame is not None else "middle of the block", place))
        if not geodesy.geocentric:
            D = geodesy.derivatives_at(origin)[0]
            true, grid = geodesy.true_axes_at(origin)[0], geodesy.axes_at(origin)[0]
            turn = np.degrees(np.arctan2(grid[:, 1] @ true[:, 0], grid[:, 1] @ true[:, 1]))
            rows += [
                ("scale of the map there", f"{np.sqrt(abs(np.linalg.det(D[:2, :2]))):.7f}"),
                ("convergence of the map there, deg", f"{turn:.5f}"),
            ]
    if np.isfinite(block.undulation_m):
        rows.append(("undulation, m", f"{block.undulation_m:g}"))
    return PageTable("Frame of the adjustment", ("", ""), rows, 2)
