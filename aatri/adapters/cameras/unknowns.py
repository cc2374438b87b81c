"""Unknown parameters of cameras: sets of additional parameters, and camera models the block leaves open.

A set of additional parameters belongs to a camera, to a session of a camera, or to an image; its parameters are lengths
in mm, weighted by one standard deviation around zero, or free. Parameters of a camera model are free or weighted as the
block says (`sigmas` of block.yaml); their measurements must not have been corrected for distortion before.
"""

from dataclasses import replace

import numpy as np

from aatri.adapters.cameras.sharing import Sharing, camera_scale, units_of
from aatri.arrays import Bool, Float
from aatri.artifacts.block import Block, Cameras
from aatri.artifacts.image_points import ImagePoints
from aatri.camera.models import calibration
from aatri.camera.parameters.parameter_set import ParameterSet
from aatri.errors import InputError
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import ADDITIONAL, CAMERA

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
