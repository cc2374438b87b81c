"""Writing of a Solution as a problem of Bundle Adjustment in the Large; the form is that of `bal`.

Images and points of the file are the oriented images and the points with rays, in the order of their ids (numerically
where all are numbers), counted from 0. Each image gets the f, k1 and k2 of its camera.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.errors import InputError, ResourceError
from aatri.formats.results.exported_rays import REMEDY, ExportedCamera, exported_cameras, exported_rays
from aatri.geometry.rotations import log_rotation


def write_bal_problem(
    solution: Solution, block: Block, path: Path, *, image_points: ImagePoints | None = None
) -> list[Path]:
    """Write a Solution as a problem file.

    Parameters
    ----------
    solution : Solution
    block : Block
        The Block it belongs to.
    path : Path
        The file, or a folder in which `problem.txt` is made.
    image_points : ImagePoints, optional
        Corrected image points; None: as measured, with the distortion of the cameras.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    InputError
        If a camera cannot be written as f, k1, k2.
    ResourceError
        If the file cannot be written.
    """
    rays = exported_rays(solution, block, image_points)
    cameras = exported_cameras(solution, block, image_points)
    images, points = np.unique(rays.image), np.unique(rays.point)
    images, points = _in_order(block.images.id, images), _in_order(block.points.id, points)
    image_number, point_number = _numbers(images, len(block.images)), _numbers(points, len(block.points))
    camera = block.images.camera
    values = np.array([_camera(c) for c in cameras])[camera[images]]
    pixel = np.array([c.pixel_mm[0] for c in cameras])
    xy = rays.xy_mm / pixel[camera[rays.image], None]
    order = np.lexsort((image_number[rays.image], point_number[rays.point]))
    lines = [f"{len(images)} {len(points)} {len(order)}"]
    lines += [
        f"{i} {j} {x!r} {y!r}"
        for i, j, (x, y) in zip(
            image_number[rays.image][order].tolist(), point_number[rays.point][order].tolist(), xy[order].tolist()
        )
    ]
    image_from_ground = solution.images.ground_from_image[images].swapaxes(1, 2)
    translation = -np.einsum("nij,nj->ni", image_from_ground, solution.images.position_m[images])
    poses = np.hstack([log_rotation(image_from_ground), translation, values])
    lines += [repr(v) for v in [*poses.ravel().tolist(), *solution.points.xyz_m[points].ravel().tolist()]]
    if path.is_dir() or not path.suffix:
        path = path / "problem.txt"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("\n".join(lines) + "\n", encoding="ascii")
    except OSError as error:
        raise ResourceError(f"cannot write: {error}", where=str(path), remedy="choose another place") from error
    return [path]


def _camera(camera: ExportedCamera) -> Float:
    """f in px, k1, k2."""
    where = f"camera {camera.id}"
    if not np.isclose(camera.pixel_mm[0], camera.pixel_mm[1], rtol=1e-12):
        what = f"pixels of {camera.pixel_mm[0]:g} x {camera.pixel_mm[1]:g} mm, but a BAL camera has one f"
        raise InputError(what, where=where, remedy="export as colmap")
    if camera.distortion not in ("none", "bal"):
        what = f"distortion {camera.distortion} cannot be written as k1, k2"
        raise InputError(what, where=where, remedy=f"{REMEDY}, or as colmap")
    k1, k2 = (camera.parameters.get(name, 0.0) for name in ("k1", "k2"))
    return np.array([camera.c_mm / camera.pixel_mm[0], k1, k2])


def _in_order(ids: Text, rows: Int) -> Int:
    """Rows in the order of their ids, numerically where all are numbers."""
    names = ids[rows].tolist()
    if all(name.isascii() and name.isdigit() for name in names):
        return np.asarray(rows[np.argsort([int(name) for name in names], kind="stable")])
    return rows


def _numbers(rows: Int, n: int) -> Int:
    number = np.full(n, -1, dtype=np.int32)
    number[rows] = np.arange(len(rows), dtype=np.int32)
    return number
