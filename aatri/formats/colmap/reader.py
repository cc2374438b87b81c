"""Reading of a COLMAP sparse model as a Block.

COLMAP's camera axes are x right, y down, z forward, ours x right, y up, z backward: u = diag(1, -1, -1) P. With
P = R(q) X + t:  ground_from_image = R(q)' diag(1, -1, -1),  X0 = -R(q)' t. Image coordinates keep COLMAP's origin, the
upper left corner of the image. Images have the name of their file as id, points and cameras their numbers.

Camera models become ours as `formats.conventions.lens` says: none, bal, opencv or fisheye, all of them exactly. The
model knows no millimetres: a pixel is 0.001 mm wide, so c = fx um; its height is 0.001 fx / fy mm, which represents
two focal lengths exactly. Features without a point are no observations of a block; their number is logged.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import APPROXIMATE, OBSERVED_VALUE, Block
from aatri.artifacts.builder import Columns, block_of
from aatri.errors import Faults, InputError, raise_all
from aatri.formats.colmap.binary import binary_paths, read_binary
from aatri.formats.colmap.model import NO_POINT, ColmapCamera, ColmapImage, ColmapModel, compare_tracks
from aatri.formats.colmap.text import read_text, text_paths
from aatri.formats.conventions.lens import COLMAP, Lens
from aatri.formats.conventions.lens_conversion import camera_columns
from aatri.formats.conventions.poses import ground_from_image, matrix_of_quaternion, position_of
from aatri.formats.tables.columns import GROUND_POINTS
from aatri.formats.tables.ground import ground_point_columns
from aatri.formats.tables.settings.block import Settings
from aatri.formats.tables.source import Source
from aatri.formats.text.text_file import missing
from aatri.geometry.rotations import angles_from_rotation
from aatri.ids import several
from aatri.progress import SILENT, Reporter
from aatri.strict_yaml import loads
from aatri.units import LARGEST


def with_control(
    start: Columns, paths: Sequence[Path], control: Path | None, reporter: Reporter = SILENT
) -> tuple[Columns, list[Path]]:
    """Columns of ground points with the control of a file in place of the start values of its points, and all files.

    Parameters
    ----------
    start : mapping of str to array
        `point` holds ids.
    paths : sequence of Path
        Files so far.
    control : Path, optional
        X, Y, Z in metres, right-handed, in the frame wanted; standard deviations in metres.

    Raises
    ------
    InputError
        If the file is missing or breaks its contract.
    """
    if control is None:
        return start, list(paths)
    if not control.is_file():
        raise missing(control)
    settings = Settings.model_validate({"aatri_block": 1, "frames": {"local": {"axes": ["x", "y", "z"]}}})
    source = Source(control.parent, settings, loads("aatri_block: 1", str(control), InputError), reporter)
    columns, _ = ground_point_columns(source, source.table(control.name, GROUND_POINTS))
    raise_all(source.problems)
    columns["file"] = np.full(len(columns["line"]), len(paths))
    columns_of = {name: np.asarray(columns[name]) for name in start}
    kept = ~np.isin(np.asarray(start["point"]), columns_of["point"])
    both = {name: np.concatenate([np.asarray(values)[kept], columns_of[name]]) for name, values in start.items()}
    return both, [*paths, control]


CAMERAS, IMAGES, POINTS = 0, 1, 2
EXPORT = "export the model again"
"""Rows of the files of a model."""


def read_colmap(
    folder: Path,
    *,
    image_sigma_px: float = 1.0,
    position_sigma_m: float | None = None,
    control: Path | None = None,
    calibrate: bool = False,
    reporter: Reporter = SILENT,
) -> Block:
    """Read a sparse model, text or binary.

    Parameters
    ----------
    image_sigma_px : float, px
        Standard deviation of image coordinates.
    position_sigma_m : float, m, optional
        The positions of the images are observations with this standard deviation; None: start values.
    control : Path, optional
        A ground_points.csv of the block folder, with the ids of the points of the model.
    calibrate : bool
        c, principal point and the distortion parameters of each model are free. Else they are fixed.

    Raises
    ------
    InputError
        If a file is missing or not of its form, or a camera model has none of ours.
    """
    model = _read(folder, reporter)
    _check(model)
    raise_all(compare_tracks(model, reporter))
    images = model.images
    lenses = [_lens(camera, _place(model, CAMERAS, camera.line)) for camera in model.cameras]
    columns, parameters = camera_columns(lenses, calibrate=calibrate)
    pixel_mm = {camera.id: size for camera, size in zip(model.cameras, columns["pixel_size_mm"])}
    names = [image.name for image in images]
    lines = [image.line for image in images]
    rotation, position_m = _poses(images)
    exterior: dict[str, Any] = {
        "image": names,
        "position_m": position_m,
        "angles_rad": angles_from_rotation(rotation),
        "file": IMAGES,
        "line": lines,
    }
    if position_sigma_m is not None:
        exterior |= {"position_use": OBSERVED_VALUE, "sigma_m": position_sigma_m}
    ground, paths = with_control(_ground_points(model), model.paths, control, reporter)
    return block_of(
        name=folder.resolve().name,
        files=paths,
        cameras=columns,
        camera_parameters=parameters,
        images={
            "id": names,
            "camera": [str(image.camera) for image in images],
            "sequence": np.arange(1.0, len(names) + 1),
            "file": IMAGES,
            "line": lines,
        },
        points=[str(point) for point in model.points.tolist()],
        image_points=_image_points(model, pixel_mm, image_sigma_px, reporter),
        ground_points=ground,
        exterior=exterior,
    )


def _read(folder: Path, reporter: Reporter) -> ColmapModel:
    if not folder.is_dir():
        raise missing(folder)
    binary = not any(p.exists() for p in text_paths(folder)) and any(p.exists() for p in binary_paths(folder))
    return read_binary(folder) if binary else read_text(folder, reporter)


def _check(model: ColmapModel) -> None:
    """Numbers, references, names and camera models."""
    problems = _numbers_of_model(model)
    cameras = {c.id for c in model.cameras}
    for camera in model.cameras:
        where = _place(model, CAMERAS, camera.line)
        if camera.model not in COLMAP:
            what = f"camera {camera.id} has the model {camera.model}, which has no like here"
            problems.add(what, where, f"convert it to one of {', '.join(COLMAP)}")
        elif min(_lens(camera, where).focal_px) <= 0 or min(camera.width, camera.height) <= 0:
            problems.add(f"camera {camera.id} has no positive focal length and size", where, EXPORT)
    if not model.images:
        problems.add("no image", str(model.paths[IMAGES]), "export a reconstruction")
    seen: dict[str, int] = {}
    for image in model.images:
        where = _place(model, IMAGES, image.line)
        if image.camera not in cameras:
            problems.add(f"image {image.id} names camera {image.camera}, which is not there", where, EXPORT)
        if math.hypot(*image.quaternion) < 1.0 / LARGEST:
            problems.add(f"image {image.name} has no rotation: its quaternion is 0", where, EXPORT)
        if seen.setdefault(image.name, image.id) != image.id:
            what = f"images {seen[image.name]} and {image.id} have one name"
            problems.add(what, where, "remove one, or give it another name")
        unknown = np.setdiff1d(image.point[image.point != NO_POINT], model.points)
        if len(unknown):
            problems.add(f"image {image.name} shows point {unknown[0]}, which is not in points3D", where, EXPORT)
    if len(np.unique(model.points)) < len(model.points):
        problems.add("a point stands twice", str(model.paths[POINTS]), "remove one")
    raise_all(problems)


def _numbers_of_model(model: ColmapModel) -> Faults:
    """Faults for what is not finite, or too large for a quantity, which binary files may hold."""
    faults = Faults()
    parts: list[tuple[int, str, int, Any]] = [
        (CAMERAS, f"camera {c.id}", c.line, [*c.parameters, c.width, c.height]) for c in model.cameras
    ]
    parts += [(IMAGES, f"image {i.id}", i.line, [*i.quaternion, *i.translation]) for i in model.images]
    parts += [(IMAGES, f"a feature of image {i.id}", i.line, i.xy_px.ravel()) for i in model.images]
    parts += [(POINTS, "a point", 0, model.xyz.ravel())]
    for file, what, line, values in parts:
        if not (np.abs(np.asarray(values, dtype=np.float64)) <= LARGEST).all():
            faults.add(f"{what} has a number that is not finite or too large", _place(model, file, line), EXPORT)
    return faults


def _place(model: ColmapModel, file: int, line: int) -> str:
    return f"{model.paths[file]}:{line}" if line else str(model.paths[file])


def _poses(images: list[ColmapImage]) -> tuple[Float, Float]:
    """ground_from_image (n, 3, 3) and positions (n, 3)."""
    rotation = ground_from_image(matrix_of_quaternion(np.array([image.quaternion for image in images])), "colmap")
    return rotation, position_of(rotation, np.array([image.translation for image in images]), "colmap")


def _lens(camera: ColmapCamera, where: str) -> Lens:
    """A camera of a model that is known."""
    form = COLMAP[camera.model]
    size, of_centre = np.array([camera.width, camera.height], dtype=np.float64), form.focal_lengths
    f, centre = camera.parameters[:of_centre], camera.parameters[of_centre : of_centre + 2]
    return Lens(
        str(camera.id),
        f"colmap-{camera.model}",
        tuple(size),
        (f[0], f[-1]),
        tuple(centre - size / 2),
        dict(zip(form.terms, camera.parameters[of_centre + 2 :])),
        where=where,
    )


def _image_points(model: ColmapModel, pixel_mm: Mapping[int, Float], sigma_px: float, reporter: Reporter) -> Columns:
    """Features with a point; rows of images and points are those of the model."""
    used = [image.point != NO_POINT for image in model.images]
    counts = [int(mask.sum()) for mask in used]
    if without := sum(map(len, used)) - sum(counts):
        reporter.log(f"not taken: {several(without, 'feature')} without a point")
    number = np.concatenate([image.point[mask] for image, mask in zip(model.images, used)])
    order = np.argsort(model.points)
    return {
        "image": np.repeat(np.arange(len(model.images)), counts),
        "point": order[np.searchsorted(model.points, number, sorter=order)],
        "xy": np.concatenate([image.xy_px[mask] for image, mask in zip(model.images, used)]),
        "sigma_mm": sigma_px * np.repeat([pixel_mm[image.camera] for image in model.images], counts, axis=0),
        "file": IMAGES,
        "line": np.repeat([i.line + (i.line > 0) for i in model.images], counts),
    }


def _ground_points(model: ColmapModel) -> Columns:
    """All points as start values."""
    n = len(model.points)
    return {
        "point": model.points.astype(np.str_),
        "xyz_m": model.xyz,
        "covariance_m2": np.zeros((n, 3, 3)),
        "role": np.full((n, 3), APPROXIMATE, np.int32),
        "datum": np.zeros(n, bool),
        "file": np.full(n, POINTS, np.int32),
        "line": np.asarray(model.point_lines),
    }
