"""What is common to all exports: their options, their files, and what of a block they had no place for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from aatri.codes import CHECK, CONTROL, OBSERVED_VALUE
from aatri.errors import ResourceError
from aatri.formats.parts.format import Content
from aatri.formats.results.oriented_block import OrientedBlock


def write_files(folder: Path, texts: Mapping[str, str | bytes]) -> None:
    """Write files into a folder, which is made if it is not there.

    Parameters
    ----------
    folder : Path
    texts : mapping of str to str or bytes
        Content by path within the folder.

    Raises
    ------
    ResourceError
        If one cannot be written.
    """
    path = folder
    try:
        for name, content in texts.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    except OSError as error:
        raise ResourceError(f"cannot write: {error.strerror}", where=str(path), remedy="another place") from error


def contents_of(oriented: OrientedBlock) -> dict[Content, int]:
    """How much there is of each content that a format may carry; what is not there is left out."""
    block = oriented.block
    role, e = block.ground_points.role, block.exterior
    control, check = (role == CONTROL).any(axis=1), (role == CHECK).any(axis=1)
    bound = np.zeros(len(block.points), dtype=bool)
    bound[block.ground_points.point[control | check]] = True
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
