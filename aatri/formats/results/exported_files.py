"""What is common to all exports: their options, and what of a block they had no place for.

A model whose own form has no place for the coordinate system has it beside it: `crs.txt`, a line a fact.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.codes import CHECK, CONTROL, OBSERVED_VALUE
from aatri.formats.parts.format import Content
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import write_files
from aatri.ids import shown
from aatri.progress import Reporter

WRITTEN_SIGMA_M = 1e-4
"""Standard deviation of what is exact, for programs that have no zero: Metashape, MicMac."""


class ControlPoint(NamedTuple):
    """A control or check point: coordinates, standard deviations (0: exact), and which coordinates are known."""

    id: str
    row: int
    xyz_m: Float
    sigma_m: Float
    known: tuple[bool, bool, bool]
    is_check: bool

    @property
    def exact(self) -> bool:
        """Whether a known coordinate has no standard deviation, which few formats can say."""
        return not all(s > 0 for s, k in zip(self.sigma_m.tolist(), self.known) if k)


def control_points(oriented: OrientedBlock) -> list[ControlPoint]:
    """The control and check points of a block; a point that is both is control."""
    g, points = oriented.block.ground_points, list[ControlPoint]()
    sigma = np.sqrt(np.maximum(np.einsum("nii->ni", g.covariance_m2), 0.0))
    for k, row in enumerate(g.point.tolist()):
        is_control = g.role[k] == CONTROL
        is_known = is_control if is_control.any() else g.role[k] == CHECK
        if is_known.any():
            x, y, z = is_known.tolist()
            name = str(oriented.block.points.id[row])
            points.append(ControlPoint(name, row, g.xyz_m[k], sigma[k], (x, y, z), not is_control.any()))
    return points


def full_control(oriented: OrientedBlock, what: str, reporter: Reporter) -> list[ControlPoint]:
    """Control points with three coordinates; the others are told."""
    control = [p for p in control_points(oriented) if not p.is_check]
    if partial := [p.id for p in control if not all(p.known)]:
        reporter.warn(f"plan-only and height-only control has no place in {what}, and is left out: {shown(partial)}")
    return [p for p in control if all(p.known)]


def short_names(ids: Sequence[str], longest: int, *, numbers: bool = False) -> tuple[list[str], str]:
    """Names for programs with short names: the ids themselves, or 1, 2 ... and a table that says which is which.

    Parameters
    ----------
    longest : int
        Most signs of a name; blanks and what is not ASCII have no place in it either.
    numbers : bool
        Names are whole numbers.

    Returns
    -------
    table : str
        CSV `written,id`; empty where the ids are written as they are.
    """
    fits = all(len(i) <= longest and i.isascii() and len(i.split()) == 1 and (i.isdigit() or not numbers) for i in ids)
    if fits:
        return list(ids), ""
    names = [str(k) for k in range(1, len(ids) + 1)]
    return names, "written,id\n" + "".join(f'{name},"{i}"\n' for name, i in zip(names, ids))


def contents_of(oriented: OrientedBlock) -> dict[Content, int]:
    """How much there is of each content that a format may carry; what is not there is left out."""
    block = oriented.block
    control, check, e = block.ground_points.given_as(CONTROL), block.ground_points.given_as(CHECK), block.exterior
    bound = block.points_given_as(CONTROL, CHECK)
    correlations = block.ground_points.covariance_m2.copy()
    correlations[:, range(3), range(3)] = 0.0
    counts: dict[Content, int] = {
        "cameras": len(block.cameras),
        "distortion": int((block.cameras.distortion != "none").sum()) if oriented.image_points is None else 0,
        "image points": int(block.image_points.active.sum()),
        "control": int(control.sum()),
        "check points": int(check.sum()),
        "start values of points": int((np.isfinite(oriented.xyz_m).all(axis=1) & ~bound).sum()),
        "positions": int((e.position_use == OBSERVED_VALUE).sum()),
        "attitudes": int((e.angle_use == OBSERVED_VALUE).sum()),
        "start orientations": int(oriented.oriented.sum()),
        "strips": len(block.strips),
        "times": int(np.isfinite(block.images.time_s).sum()),
        "frame": int(block.frames.crs[0] != "local"),
        "standard deviations": int((np.nan_to_num(block.image_points.sigma_mm) > 0).any())
        + int((np.nan_to_num(np.einsum("nii->ni", block.ground_points.covariance_m2)) > 0).any()),
        "covariances": len(block.ground_point_covariances) + int((np.nan_to_num(correlations) != 0).any()),
        "rigs": len(np.unique(block.rig_members.rig)),
        "film": int((block.cameras.kind == "film").sum()),
        "geodetic observations": len(block.geodetic) + len(block.relative_control),
    }
    return {content: count for content, count in counts.items() if count}


def lost(oriented: OrientedBlock, written: Sequence[Content]) -> list[str]:
    """What of a block a format has no place for, in words."""
    uncounted = ("frame", "standard deviations", "covariances")
    return [
        content if content in uncounted else f"{content} ({count})"
        for content, count in contents_of(oriented).items()
        if content not in written
    ]


NAME = "crs.txt"
MAP = "east,north,up"
"""The order of map coordinates in a Solution, whatever their order in the tables."""


def write_crs(block: Block, folder: Path) -> None:
    """Write in which system the coordinates of an export are; nothing where the block declares none.

    Parameters
    ----------
    folder : Path
        With the export.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    crs, vertical = str(block.frames.crs[0]), str(block.frames.vertical[0])
    if crs == "local":
        return
    stated = str(block.frames.axes[0])
    axes = MAP if sorted(stated.split(",")) == sorted(MAP.split(",")) else stated
    lines = [f"crs: {crs}", *([f"vertical: {vertical}"] if vertical else []), f"axes: {axes}", "unit: m"]
    write_files(folder, {NAME: "\n".join(lines) + "\n"})
