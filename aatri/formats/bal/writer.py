"""Writing of an oriented block as a problem of Bundle Adjustment in the Large; the form is that of `bal`.

Images and points of the file are the oriented images and the points with rays, in the order of their ids (numerically
where all are numbers), counted from 0. Each image gets the f, k1 and k2 of its camera; coordinates count from the
principal point, in pixels as wide as high.
"""

from pathlib import Path

import numpy as np

from aatri.arrays import Int, Text
from aatri.formats.conventions.poses import stated_rotation, translation_of
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.results.sparse_rays import centred_cameras
from aatri.formats.text.written_files import write_files
from aatri.geometry.rotations import log_rotation
from aatri.progress import SILENT, Reporter

NAME = "problem.txt"


def write_bal_problem(
    oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT
) -> None:
    """Write an oriented block as `problem.txt`.

    Raises
    ------
    InputError
        If a camera cannot be written as f, k1, k2.
    ResourceError
        If the file cannot be written.
    """
    block, rays = oriented.block, oriented.model_rays
    lenses, xy_px = centred_cameras(oriented, ["bundler"], reporter, allowed_px=writing.lens_misfit_px)
    images, points = np.unique(rays.image), np.unique(rays.point)
    images, points = _in_order(block.images.id, images), _in_order(block.points.id, points)
    image_number, point_number = _numbers(images, len(block.images)), _numbers(points, len(block.points))
    order = np.lexsort((image_number[rays.image], point_number[rays.point]))
    lines = [f"{len(images)} {len(points)} {len(order)}"]
    lines += [
        f"{i} {j} {x!r} {-y!r}"
        for i, j, (x, y) in zip(
            image_number[rays.image][order].tolist(), point_number[rays.point][order].tolist(), xy_px[order].tolist()
        )
    ]
    rotation = oriented.ground_from_image[images]
    values = [
        [lens.focal_px[0], lens.parameters["k1"], lens.parameters["k2"]]
        for lens in (lenses[k] for k in block.images.camera[images].tolist())
    ]
    translation = translation_of(rotation, oriented.position_m[images], "bal")
    poses = np.hstack([log_rotation(stated_rotation(rotation, "bal")), translation, np.array(values)])
    lines += [repr(v) for v in [*poses.ravel().tolist(), *oriented.xyz_m[points].ravel().tolist()]]
    write_files(folder, {NAME: "\n".join(lines) + "\n"})


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
