"""Parts of sources as readers give them, small and made by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import camera_parts
from aatri.formats.parts.block_parts import PLANE, BlockParts


def images(*names: str, camera: str = "cam", file: str = "points.txt") -> BlockParts:
    """Images with three points each, 100 px apart, and their camera's name."""
    rows = [(name, f"p{k}", [100.0 * k + 10 * i, 200.0]) for i, name in enumerate(names) for k in range(3)]
    image, point, xy = (list(column) for column in zip(*rows))
    return BlockParts(
        "made",
        [Path(file)],
        images={"id": list(names), "camera": camera, "line": [1] * len(names)},
        image_points={"image": image, "point": point, "xy": xy, "line": [k + 2 for k in range(len(rows))]},
    )


def camera(name: str, f: float = 1000.0, file: str = "camera.txt") -> BlockParts:
    lens = Lens(name, "none", (1000.0, 800.0), (f, f))
    return BlockParts("made", [Path(file)], **camera_parts([lens]))


def ground(file: str, *points: str, z: float = 5.0, **columns: Any) -> BlockParts:
    xyz = [[10.0 * k, 0.0, z] for k in range(len(points))]
    given = {"point": list(points), "xyz_m": xyz, "line": [k + 1 for k in range(len(points))], **columns}
    return BlockParts("made", [Path(file)], frame=PLANE, ground_points=given)


def positions(file: str, *names: str, **columns: Any) -> BlockParts:
    xyz = [[10.0 * k, 1.0, 100.0] for k in range(len(names))]
    given = {"image": list(names), "position_m": xyz, "line": [k + 1 for k in range(len(names))], **columns}
    return BlockParts("made", [Path(file)], frame=PLANE, exterior=given)
