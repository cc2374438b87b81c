"""Problems of Bundle Adjustment in the Large, read as a Block and written of an oriented one.

A text file of numbers: `cameras points observations`; per observation `camera point x y`; nine numbers per camera,
rotation vector w, translation t, f, k1, k2; three per point. Cameras and points count from 0. With R = exp([w]x)

    P = R X + t,   p = -P / P_z,   p' = f (1 + k1 |p|^2 + k2 |p|^4) p

in pixels, the origin at the image centre, y up, the camera looking along -z. So in the Block ground_from_image = R',
X0 = -R' t, and each image has a camera of its own with the distortion `bal`. The file knows no millimetres: a pixel is
taken as 0.001 mm, which makes c = f um. Camera and image k have the id k, so has point k.

The rotation leaves it open whether a point lies in front of its camera; observations of points behind stay active, as
the problem defines its cost: half the sum of all squares. So do features that the problem has twice.

Written are the oriented images and the points with rays, in the order of their ids (numerically where all are numbers),
counted from 0. Each image gets the f, k1 and k2 of its camera; coordinates count from the principal point, in pixels as
wide as high.

Source: Agarwal, Snavely, Seitz & Szeliski 2010, Bundle adjustment in the large; grail.cs.washington.edu/projects/bal.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import APPROXIMATE, Block
from aatri.artifacts.builder import block_of
from aatri.errors import InputError
from aatri.formats.conventions.pixel_origins import PIXEL_MM
from aatri.formats.conventions.poses import stated_rotation, translation_of
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.results.horizon import centred_cameras
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.number_text import numbers_of
from aatri.formats.text.text_file import read_lines
from aatri.formats.text.text_line import blank_separated
from aatri.formats.text.written_files import write_files
from aatri.geometry.collinearity import in_image_axes
from aatri.geometry.rotations import angles_from_rotation, exp_rotation, log_rotation
from aatri.ids import clipped, several
from aatri.progress import SILENT, Reporter

FREE = ("k1", "k2", "principal_distance")
FIXED = ("principal_point.x", "principal_point.y")


@dataclass(frozen=True)
class BalProblem:
    """The numbers of a file, and the lines they begin in."""

    camera: Int
    point: Int
    """(m,) int32."""
    xy_px: Float
    """(m, 2), px."""
    cameras: Float
    """(n, 9). w1 w2 w3 t1 t2 t3 f k1 k2; f in px."""
    points: Float
    """(p, 3)."""
    lines: tuple[Int, Int, Int]
    """(m,), (n,), (p,) int32."""


def read_bal(path: Path, *, image_sigma_px: float = 1.0, calibrate: bool = True, reporter: Reporter = SILENT) -> Block:
    """Read a problem.

    Parameters
    ----------
    image_sigma_px : float, px
        Standard deviation of image coordinates; the files have none.
    calibrate : bool
        f, k1 and k2 of every image are free, as the problem has it. Else they are fixed.
    """
    problem = read_problem(path, reporter)
    lines = dict(zip(("image_points", "cameras", "points"), problem.lines))
    ids, points = [str(k) for k in range(len(problem.cameras))], [str(k) for k in range(len(problem.points))]
    ground_from_image = exp_rotation(problem.cameras[:, :3]).swapaxes(1, 2)
    position_m = -np.einsum("nij,nj->ni", ground_from_image, problem.cameras[:, 3:6])
    seen = in_image_axes(position_m[problem.camera], ground_from_image[problem.camera], problem.points[problem.point])
    if (count := int((seen[:, 2] >= 0).sum())) > 0:
        reporter.log(f"{several(count, 'image point')} of points behind their camera at the start: kept")
    return block_of(
        name=path.stem,
        files=[path],
        cameras={
            "id": ids,
            "pixel_size_mm": PIXEL_MM,
            "pixel_origin": "image-centre",
            "pixel_y": "up",
            "principal_distance_mm": problem.cameras[:, 6] * PIXEL_MM,
            "distortion": "bal",
        },
        camera_parameters=_camera_parameters(ids, problem.cameras, calibrate),
        images={"id": ids, "camera": ids, "sequence": np.arange(1.0, len(ids) + 1), "line": lines["cameras"]},
        points=points,
        image_points={
            "image": problem.camera,
            "point": problem.point,
            "xy": problem.xy_px,
            "sigma_mm": image_sigma_px * PIXEL_MM,
            "line": lines["image_points"],
        },
        ground_points={
            "point": np.arange(len(points)),
            "xyz_m": problem.points,
            "role": APPROXIMATE,
            "line": lines["points"],
        },
        exterior={
            "image": ids,
            "position_m": position_m,
            "angles_rad": angles_from_rotation(ground_from_image),
            "line": lines["cameras"],
        },
    )


def _camera_parameters(ids: list[str], rows: Float, calibrate: bool) -> dict[str, Any]:
    """k1, k2 and what is free of the interior orientation."""
    n, names = len(rows), (*FREE, *FIXED)
    value = np.full((n, len(names)), np.nan)
    value[:, :2] = rows[:, 7:]
    free = np.tile(np.array([calibrate and name in FREE for name in names]), n)
    return {
        "camera": np.repeat(ids, len(names)),
        "name": names * n,
        "value": value.reshape(-1),
        "sigma": np.where(free, np.nan, 0.0),
        "free": free,
    }


def read_problem(path: Path, reporter: Reporter = SILENT) -> BalProblem:
    """The numbers of a file.

    Raises
    ------
    InputError
        If the file is missing or not of this form.
    """
    rows = [blank_separated(line) for line in read_lines(path, reporter)]
    line = np.repeat(np.arange(1, len(rows) + 1, dtype=np.int32), [len(row) for row in rows])
    words = [word for row in rows for word in row]
    values, bad = numbers_of(words)
    if bad:
        what = f"{clipped(words[bad[0]])!r} is no number"
        raise InputError(what, where=f"{path}:{line[bad[0]]}", remedy="the file holds numbers only")
    head = values[:3]
    if len(head) < 3 or (head < 1).any() or (head != np.floor(head)).any():
        raise InputError(
            "the file does not begin with the numbers of cameras, points and observations",
            where=f"{path}:1",
            remedy="unpack it if it is compressed; give a BAL problem",
        )
    cameras, points, observations = (int(v) for v in head)
    expected = 3 + 4 * observations + 9 * cameras + 3 * points
    if len(values) != expected:
        what = f"{several(len(values), 'number')} where {several(cameras, 'camera')}, {several(points, 'point')} and "
        what += f"{several(observations, 'observation')} need"
        raise InputError(
            f"{what} {expected}",
            where=f"{path}:{line[-1] if len(line) else 1}",
            remedy="the file is incomplete: get it again",
        )
    starts = np.cumsum([3, 4 * observations, 9 * cameras])
    measured, camera_rows, point_rows = np.split(values, starts)[1:]
    measured = measured.reshape(-1, 4)
    _check_numbers(measured, (cameras, points), line[starts[0] :: 4], path)
    camera_rows = camera_rows.reshape(-1, 9)
    if (camera_rows[:, 6] <= 0).any():
        k = int(np.flatnonzero(camera_rows[:, 6] <= 0)[0])
        where = f"{path}:{line[starts[1] + 9 * k + 6]}"
        raise InputError(f"camera {k} has the focal length {camera_rows[k, 6]:g}", where=where, remedy="it is positive")
    return BalProblem(
        camera=measured[:, 0].astype(np.int32),
        point=measured[:, 1].astype(np.int32),
        xy_px=measured[:, 2:],
        cameras=camera_rows,
        points=point_rows.reshape(-1, 3),
        lines=(line[starts[0] : starts[1] : 4], line[starts[1] : starts[2] : 9], line[starts[2] :: 3]),
    )


def _check_numbers(measured: Float, counts: tuple[int, int], line: Int, path: Path) -> None:
    for column, (what, count) in enumerate(zip(("camera", "point"), counts)):
        number = measured[:, column]
        wrong = np.flatnonzero((number < 0) | (number >= count) | (number != np.floor(number)))
        if len(wrong):
            k = int(wrong[0])
            message = f"{what} {number[k]:g}, but there are {count}, counted from 0"
            raise InputError(message, where=f"{path}:{line[k]}", remedy="mend the number")


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
