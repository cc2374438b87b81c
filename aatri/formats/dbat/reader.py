"""Reading of DBAT's files, a PhotoModeler export with its control points, as a Block.

The form of the files is that of `dbat_files`. DBAT's model, in the notation of the Block (R maps image to ground):

- R = Rx(omega) Ry(phi) Rz(kappa), so its angles are the international ones; the export lists them kappa phi omega.
- A pixel coordinate u (right), v (down) stands at u and v times the pixel size from the upper left corner of the
  format: the origin is top-left-corner, without half a pixel. Pixels are taken as square, of their height; what they
  are wider is the aspect `as`, which model 1 does not have.
- The principal point px, py is counted from that corner; here x0 = px - width/2, y0 = height/2 - py.

The measured coordinate is corrected and then compared with the central projection (`backward` models), Brown with x
and y from the principal point, mm:

    model 1, `brown`:   x = x_photo - x0,            y = y_photo - y0
    model 3, `dbat3`:   x = (1 + as)(x_photo - x0),  y = y_photo - y0
    both                pixels square: height / rows
    corrected: x + x (k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 x^2) + 2 p2 x y
               y + y (k1 r^2 + k2 r^4 + k3 r^6) + p2 (r^2 + 2 y^2) + 2 p1 x y

Residuals are those of the corrected coordinates, both divided by the square pixel. DBAT scales x before
it subtracts px (1 + as), and its reports print px: the same as above.

Coordinates of the export are reduced by a constant. They are start values only; here they are shifted so that their
control points lie, in the mean, on those of the control file, whose frame is that of the Block.

Source: Börlin & Grussenmeyer 2016, External verification of the bundle adjustment in photogrammetric software using
the Damped Bundle Adjustment Toolbox; checked against the reports of DBAT 0.9.2, pixels and aspect against its
prob2dbatstruct.m ("use y as the pixel size, store diff as aspect").
"""

from collections import Counter
from pathlib import Path
from typing import Any, Literal

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import APPROXIMATE, CONTROL, NOT_SEEN, Block, Rejects
from aatri.artifacts.builder import block_of
from aatri.errors import GeometryError, InputError, raise_all
from aatri.formats.dbat.files import DbatPhoto, DefaultCamera, Export, ObjectPoint, read_control, read_export
from aatri.formats.limits import LARGEST_ASPECT_PX
from aatri.ids import canonical, did_you_mean, several
from aatri.progress import SILENT, Reporter

CAMERA = "camera"
"""Id of the camera; the files give it none."""

EXPORT = 0
"""Row of the export in the list of files."""

NOT_GIVEN_SIGMA_PX = 1.0
"""Standard deviation of marks that have none; sigma0 tells what it should have been."""

CameraModel = Literal["brown", "dbat3"]


def read_dbat(
    export: Path,
    control: Path | None = None,
    *,
    camera_model: CameraModel = "brown",
    calibrate: bool = False,
    image_sigma_px: float | None = None,
    set_aside: bool = False,
    reporter: Reporter = SILENT,
) -> Block:
    """Read a PhotoModeler export and a control file of DBAT.

    Parameters
    ----------
    control : Path, optional
        None: no point is control, the datum is free.
    camera_model : str
        brown (DBAT's model 1) or dbat3 (its model 3).
    calibrate : bool
        The interior orientation is free: c, x0, y0, k1, k2, k3, p1, p2, and `as` of dbat3. Else it is fixed.
    image_sigma_px : float, px, optional
        Standard deviation of image coordinates; None: that of each mark.
    set_aside : bool
        Points that cannot be determined are set aside. Else they are refused, as DBAT does.

    Raises
    ------
    InputError
        If a file is missing or a line is not of its form.
    GeometryError
        If an object point has no image point, or one and no control.
    """
    source = read_export(export, reporter)
    surveyed = {} if control is None else read_control(control, reporter)
    if source.control and control is None:
        reporter.warn(
            f"{export}: its {several(len(source.control), 'control point', 'is', 'are')} adjusted, and "
            "not used as control"
        )
    shift = _shift(source, surveyed, control, reporter)
    if not set_aside:
        _refuse_undetermined(source, surveyed)
    photos = _distinct(source.photos)
    names = [p.name for p in photos]
    entries = [p.entry for p in photos]
    _warn_of_aspect(export, source.camera, camera_model, reporter)
    return block_of(
        name=export.stem,
        files=[export] if control is None else [export, control],
        cameras=_camera(source.camera, camera_model),
        camera_parameters=_parameters(source.camera, camera_model, calibrate),
        images={"id": names, "camera": CAMERA, "sequence": np.arange(1.0, len(names) + 1), "at": entries},
        image_points=_image_points(source, image_sigma_px, reporter),
        ground_points=_ground_points(source, surveyed, shift),
        exterior={
            "image": names,
            "position_m": np.array([p.position_m for p in photos]) + shift,
            "angles_rad": np.radians([p.kappa_phi_omega_deg[::-1] for p in photos]),
            "at": entries,
        },
        rejects=_not_seen(source, surveyed),
    )


def _refuse_undetermined(source: Export, surveyed: dict[str, ObjectPoint]) -> None:
    """Object points that their image points cannot determine: none at all, or one without control."""
    rays = Counter(name for name, _ in {(m.point, m.photo) for m in source.marks})
    remedy = "measure it in two images at least, remove it, or set `undetermined_points: set_aside`"
    listed = {m.point: m.entry for m in reversed(source.marks)} | {p: g.entry for p, g in source.points.items()}
    problems = []
    for name, entry in sorted(listed.items(), key=lambda item: item[1].line):
        if name not in surveyed and rays[name] < 2:
            seen = "one image only, which does not determine it" if rays[name] else "no image"
            where = f"{entry.path}:{entry.line}"
            problems.append(GeometryError(f"object point {name} is seen in {seen}", where=where, remedy=remedy))
    raise_all(problems)


def _not_seen(source: Export, surveyed: dict[str, ObjectPoint]) -> Rejects:
    seen = {m.point for m in source.marks}
    names = canonical(name for name in source.points if name not in seen and name not in surveyed)
    lines = [source.points[p].entry.line for p in names]
    return Rejects.of(kind="ground_point", id=names, reason=NOT_SEEN, file=EXPORT, line=lines)


def _distinct(photos: list[DbatPhoto]) -> list[DbatPhoto]:
    """The photos; an error if two have files of one name."""
    first: dict[str, DbatPhoto] = {}
    problems = []
    for photo in photos:
        if first.setdefault(photo.name, photo) is not photo:
            earlier = first[photo.name].entry.line
            problems.append(photo.entry.error(f"photo {photo.name} twice, first in line {earlier}", "rename one"))
    raise_all(problems)
    return photos


def _shift(source: Export, surveyed: dict[str, ObjectPoint], control: Path | None, reporter: Reporter) -> Float:
    """Mean of the control file minus the export over common points, (3,) m."""
    if not surveyed:
        return np.zeros(3)
    common = [name for name in surveyed if name in source.points]
    if not common:
        name = next(iter(surveyed))
        what = f"no control point is an object point of the export{did_you_mean(name, source.points)}"
        raise InputError(what, where=str(control), remedy="give points the same ids in both files")
    differences = np.array([surveyed[p].xyz_m for p in common]) - np.array([source.points[p].xyz_m for p in common])
    shift = np.asarray(differences.mean(axis=0))
    scatter = float(np.abs(differences - shift).max())
    reporter.log(f"export shifted by {shift.round(6).tolist()} m onto the control; it differs by up to {scatter:.3g} m")
    return shift


def _pixel_mm(camera: DefaultCamera) -> Float:
    """Square pixels of the height given, mm, (2,)."""
    return np.full(2, camera.format_mm[1] / camera.size_px[1])


def _wider(camera: DefaultCamera) -> float:
    """Pixel width over height, minus 1."""
    width, height = np.array(camera.format_mm) / np.array(camera.size_px)
    return float(width / height - 1.0)


def _aspect(camera: DefaultCamera, model: CameraModel) -> float:
    """Start value of `as`; model 1 has none."""
    return 0.0 if model == "brown" else _wider(camera)


def _warn_of_aspect(export: Path, camera: DefaultCamera, model: CameraModel, reporter: Reporter) -> None:
    edge_px = abs(_wider(camera)) * camera.size_px[0] / 2
    if model == "brown" and edge_px > LARGEST_ASPECT_PX:
        reporter.warn(
            f"{export}: pixels are {100 * _wider(camera):+.3f} % wider than high, {edge_px:.2f} px at the edge; DBAT's"
            " model 1 (camera_model: brown) takes them as square, of their height: dbat3 has the aspect"
        )


def _camera(camera: DefaultCamera, model: CameraModel) -> dict[str, Any]:
    pixel, size = _pixel_mm(camera), np.array(camera.size_px)
    px, py = camera.principal_point_mm
    px = px / (1.0 + _aspect(camera, model))
    return {
        "id": CAMERA,
        "pixel_size_mm": pixel,
        "pixel_origin": "top-left-corner",
        "pixel_y": "down",
        "format": size.astype(float),
        "principal_distance_mm": camera.c_mm,
        "distortion": model,
        "principal_point_mm": np.array([px, -py]) - np.array([1, -1]) * pixel * size / 2,
    }


def _parameters(camera: DefaultCamera, model: CameraModel, calibrate: bool) -> dict[str, Any]:
    """Distortion parameters, and for the interior orientation whether it is free (NaN and free) or fixed (0)."""
    values = dict(zip(("k1", "k2", "k3", "p1", "p2"), camera.distortion))
    values |= dict.fromkeys(("principal_distance", "principal_point.x", "principal_point.y"), np.nan)
    if model == "dbat3":
        values["as"] = _aspect(camera, model)
    return {
        "camera": CAMERA,
        "name": list(values),
        "value": list(values.values()),
        "sigma": np.nan if calibrate else 0.0,
        "free": calibrate,
    }


def _image_points(source: Export, sigma_px: float | None, reporter: Reporter) -> dict[str, Any]:
    n = len(source.marks)
    photo = [p.name for p in source.photos]
    own = np.array([m.sigma_px for m in source.marks]).reshape(n, 2)
    sigma = own if sigma_px is None else np.full((n, 2), sigma_px)
    not_given = np.flatnonzero((sigma == 0).all(axis=1))
    if len(not_given):
        entry = source.marks[not_given[0]].entry
        reporter.warn(
            f"{entry.path}:{entry.line}: {len(not_given)} of {n} image points have standard deviations 0, 0:"
            f" {NOT_GIVEN_SIGMA_PX:g} px is taken; image_sigma_px gives another"
        )
        sigma[not_given] = NOT_GIVEN_SIGMA_PX
    return {
        "image": [photo[m.photo] for m in source.marks],
        "point": [m.point for m in source.marks],
        "xy": [m.xy_px for m in source.marks],
        "sigma_mm": sigma * _pixel_mm(source.camera),
        "at": [m.entry for m in source.marks],
    }


def _ground_points(source: Export, surveyed: dict[str, ObjectPoint], shift_m: Float) -> dict[str, Any]:
    """Control as given; all other object points as start values."""
    names = list({**source.points, **surveyed})
    points = [surveyed.get(p) or source.points[p] for p in names]
    n = len(names)
    is_control = np.array([p in surveyed for p in names], dtype=bool)
    xyz = np.array([p.xyz_m for p in points]).reshape(n, 3)
    sigma = np.where(is_control[:, None], np.array([p.sigma_m for p in points]).reshape(n, 3), 0.0)
    return {
        "point": names,
        "xyz_m": np.where(is_control[:, None], xyz, xyz + shift_m),
        "sigma_m": sigma,
        "role": np.where(is_control[:, None], np.full((n, 3), CONTROL), APPROXIMATE),
        "at": [p.entry for p in points],
    }
