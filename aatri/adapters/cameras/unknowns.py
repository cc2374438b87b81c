"""Unknown parameters of cameras: what shares them, sets of additional parameters, camera models the block leaves open.

    p = (p_camera, p_flight, p_session, p_image),    (x, y) + sum of K_part p_part = projection

c, x0 and y0 of a lens that is refocused or hit change from image to image while its distortion stays: the former are
image-variant, the latter block-invariant. Each part is a group of unknowns of its own; that of the images joins them in
the order of elimination, so that it fills nothing in. Parameters of a set are lengths in mm, weighted by one standard
deviation around zero, or free. Parameters of a camera model are free or weighted as the block says (`sigmas` of
block.yaml); their measurements must not have been corrected for distortion before.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import Block, Cameras
from aatri.artifacts.image_points import ImagePoints
from aatri.camera.models import calibration
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale, chosen, scale_of_format
from aatri.errors import InputError, SpecError
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import ADDITIONAL, CAMERA

Sharing = Literal["camera", "flight", "session", "image"]

SHARINGS: tuple[Sharing, ...] = ("camera", "flight", "session", "image")
"""From what most images share to what none do."""

Per = Sharing | Mapping[Sharing, Sequence[str]]


@dataclass(frozen=True)
class SharingUnits:
    """The cameras, flights, sessions or images that share parameters."""

    id: Text
    """(n,) str."""
    camera: Int
    """(n,). Camera of each unit."""
    of_image: Int
    """(n_images,)."""


def units_of(block: Block, per: Sharing) -> SharingUnits:
    """Cameras, flights or sessions of cameras, or images."""
    camera = block.images.camera
    if per == "image":
        return SharingUnits(block.images.id, camera, np.arange(len(camera)))
    if per == "camera":
        return SharingUnits(block.cameras.id, np.arange(len(block.cameras)), camera)
    part = block.images.flight if per == "flight" else block.images.session
    names = np.array([f"{block.cameras.id[c]}/{s}" for c, s in zip(camera, part)])
    ids, first, of_image = np.unique(names, return_index=True, return_inverse=True)
    return SharingUnits(ids, camera[first], of_image.ravel())


def camera_scale(block: Block, camera: int) -> SetScale:
    """Scale of the additional parameters of a camera: its format, else the extent of its measurements."""
    cameras = block.cameras
    half = 0.5 * cameras.format[camera]
    if cameras.kind[camera] == "digital":
        half = half * cameras.pixel_size_mm[camera]
    if not np.isfinite(half).all():
        of_camera = block.images.camera[block.image_points.image] == camera
        half = np.abs(block.image_points.xy[of_camera]).max(axis=0, initial=0.0)
    return scale_of_format(half, float(cameras.principal_distance_mm[camera]))


@dataclass(frozen=True)
class SetPart:
    """Parameters of a set that share their unit."""

    group: str
    """Name of the group of unknowns."""
    per: Sharing
    """camera, flight, session or image."""
    parameters: ParameterSet
    """The set with these parameters only."""


def parts_of_set(parameters: ParameterSet, per: Per) -> tuple[SetPart, ...]:
    """The parts of a set.

    Parameters
    ----------
    per : str or mapping
        What shares all parameters, or what shares which of them; parameters that are not named are left out.

    Raises
    ------
    SpecError
        If a name is not one of the set, or is given twice.
    """
    if isinstance(per, str):
        return (SetPart(ADDITIONAL, per, parameters),)
    named = [name for unit in SHARINGS for name in per.get(unit, ())]
    twice = sorted({name for name in named if named.count(name) > 1})
    if twice or not named:
        what = f"names {', '.join(twice)} twice" if twice else "names no parameter"
        raise SpecError(f"self_calibration.per {what}", remedy="per: {camera: [k1, k2], image: [x0, y0]}")
    units = [unit for unit in SHARINGS if per.get(unit)]
    groups = [ADDITIONAL, *(f"{ADDITIONAL} per {unit}" for unit in units[1:])]
    return tuple(SetPart(g, unit, chosen(parameters, list(per[unit]))) for g, unit in zip(groups, units))


def names_of_parts(parts: Sequence[SetPart]) -> str:
    """What shares which parameters, as text."""
    if len(parts) == 1:
        return f"per {parts[0].per}"
    return "; ".join(f"{', '.join(p.parameters.parameters)} per {p.per}" for p in parts)


MODELS = {"none": "pinhole", "dbat3": "brown"} | {
    name: name for name in ("brown", "bal", "opencv", "polynomial", "fisheye")
}
"""Camera model of each distortion of the block."""

PRINCIPAL_POINT = ("principal_point.x", "principal_point.y")

CARRIED = ("lever_arm", "boresight")
"""Parameters of a camera that are none of its model: how it is mounted with antenna and IMU."""


def additional_parameters(
    block: Block,
    image_points: ImagePoints,
    chosen: ParameterSet,
    per: Sharing,
    sigma_mm: float | None,
    group: str = ADDITIONAL,
) -> ParameterRows:
    """Unknowns of a set of additional parameters.

    Parameters
    ----------
    per : str
        camera, flight, session or image.
    sigma_mm : float or None, mm
        A-priori standard deviation of every parameter around zero; None leaves them free.
    group : str
        Name of the group of unknowns.
    """
    units, m = units_of(block, per), image_points.measurements
    n, s = len(units.id), len(chosen)
    of_ray = block.images.camera[m.image]

    def terms(xy_mm: Float) -> Float:
        basis = np.zeros((len(m), 2, s))
        for camera in np.unique(of_ray):
            of_camera = of_ray == camera
            basis[of_camera] = chosen.basis(xy_mm[of_camera], camera_scale(block, int(camera)))
        return basis

    weighted = np.full((n, s), sigma_mm is not None)
    covariance = np.tile(np.eye(s) * (sigma_mm or 1.0) ** 2, (n, 1, 1))
    zero = np.zeros((n, s))
    return ParameterRows(
        group,
        units.id,
        chosen.parameters,
        zero,
        np.ones((n, s), dtype=bool),
        zero,
        covariance,
        weighted,
        units.of_image[m.image],
        terms(np.where(np.isfinite(m.xy_mm), m.xy_mm, 0.0)),
        per_image=per == "image",
        terms=terms,
        ideal=chosen.ideal,
    )


def camera_parameters(block: Block, image_points: ImagePoints, *, calibrated: bool = False) -> ParameterRows | None:
    """Unknowns of the camera models; None where the corrected measurements are those of a central projection.

    Parameters
    ----------
    calibrated : bool
        Another block will tell the parameters: they are unknown here too.

    Raises
    ------
    InputError
        If a camera's distortion has been corrected although its parameters are unknown, or has not been corrected
        although it is a table.
    """
    corrected = "distortion" in image_points.corrections.name
    open_ = np.unique(block.camera_parameters.camera[_is_open(block)])
    distorted = block.cameras.distortion != "none"
    open_ = np.arange(len(block.cameras)) if calibrated else open_
    if corrected and len(open_):
        raise InputError(
            "the distortion has been corrected, although camera parameters are to be estimated",
            where=f"camera {block.cameras.id[open_[0]]}",
            remedy="set `distortion: false` in image_refinement, or fix the parameters (`sigmas` in block.yaml)",
        )
    if corrected or not (len(open_) or distorted.any()):
        return None
    for k, name in enumerate(block.cameras.distortion):
        if name not in MODELS:
            raise InputError(
                f"distortion {name} has not been corrected",
                where=f"camera {block.cameras.id[k]}",
                remedy="correct it by image_refinement/systematic",
            )
    _refuse_symmetry_point(block)
    return _by_image(block, _camera_rows(block, image_points))


def _refuse_symmetry_point(block: Block) -> None:
    """The models of the adjustment are about the principal point."""
    away = np.flatnonzero((np.nan_to_num(block.cameras.symmetry_point_mm) != 0).any(axis=1))
    if len(away):
        x, y = block.cameras.symmetry_point_mm[away[0]]
        raise InputError(
            f"symmetry_point {x:g}, {y:g} mm: the adjustment has distortions about the principal point only",
            where=f"camera {block.cameras.id[away[0]]}",
            remedy="correct the distortion by image_refinement/systematic before, or leave symmetry_point out",
        )


def _is_open(block: Block) -> Bool:
    sigma = block.camera_parameters.sigma
    names = block.camera_parameters.name.tolist()
    of_model = np.array([name.partition(".")[0] not in CARRIED for name in names], dtype=bool)
    return np.asarray(of_model & (block.camera_parameters.free | (np.isfinite(sigma) & (sigma > 0))))


def _camera_rows(block: Block, image_points: ImagePoints) -> ParameterRows:
    models = tuple(MODELS[str(d)] for d in block.cameras.distortion)
    n, s = len(models), max(len(calibration.PARAMETERS[m]) for m in models)
    start, free, sigma = np.zeros((n, s)), np.zeros((n, s), dtype=bool), np.zeros((n, s))
    for k, model in enumerate(models):
        names = calibration.PARAMETERS[model]
        start[k, 0] = block.cameras.principal_distance_mm[k]
        if "q" in names:
            start[k, names.index("q")] = 1.0
    table = block.camera_parameters
    for row in range(len(table)):
        k, name = int(table.camera[row]), str(table.name[row])
        names = calibration.PARAMETERS[models[k]]
        if name not in names:
            continue
        j = names.index(name)
        if np.isfinite(table.value[row]):
            start[k, j] = table.value[row]
        free[k, j] = table.free[row] or table.sigma[row] > 0
        sigma[k, j] = 0.0 if table.free[row] else np.nan_to_num(table.sigma[row])
    covariance = np.where(sigma[:, :, None] > 0, sigma[:, :, None] ** 2, 1.0) * np.eye(s)
    longest = max((calibration.PARAMETERS[m] for m in models), key=len)
    block_of_ray = block.images.camera[image_points.measurements.image]
    return ParameterRows(
        CAMERA, block.cameras.id, longest, start, free, start, covariance, sigma > 0, block_of_ray, None, models
    )


def _by_image(block: Block, rows: ParameterRows) -> ParameterRows:
    """Where every image has a camera of its own, the camera joins its image: it fills nothing in."""
    camera = block.images.camera
    if len(np.unique(camera)) < len(camera) or len(camera) < len(block.cameras):
        return rows
    image_of = np.empty(len(camera), dtype=np.int64)
    image_of[camera] = np.arange(len(camera))
    columns = {name: getattr(rows, name)[camera] for name in ("start", "free", "prior", "covariance", "weighted")}
    models = tuple(rows.model[k] for k in camera)
    ids, of_ray = block.cameras.id[camera], image_of[rows.block]
    return replace(rows, ids=ids, block=of_ray, model=models, per_image=True, **columns)


def nominal_point_mm(cameras: Cameras, camera: str) -> Float:
    """Principal point of a camera as the block gives it, (2,) mm."""
    return np.asarray(cameras.principal_point_mm[cameras.id == camera][0])
