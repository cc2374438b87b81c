"""Cameras of block.yaml as tables."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aatri.artifacts.block import CameraParameters, Cameras, DistortionTable, Fiducials
from aatri.errors import InputError
from aatri.formats.tables.settings.camera import VECTORS, CameraSettings
from aatri.formats.tables.source import Source, ask_for_angle_unit, plain_angle_rad, texts
from aatri.ids import canonical, clipped, is_valid


class CameraTables(NamedTuple):
    """The tables that describe cameras."""

    cameras: Cameras
    camera_parameters: CameraParameters
    distortion_table: DistortionTable
    fiducials: Fiducials


def camera_tables(source: Source) -> CameraTables:
    """Cameras in canonical order, with parameters, distortion tables and fiducials."""
    given = source.settings.cameras
    ids = canonical(given)
    cameras = [given[name] for name in ids]
    return CameraTables(_cameras(source, ids, cameras), _parameters(source, cameras), _distortion(cameras),
                        _fiducials(source, ids, cameras))  # fmt: skip


def _cameras(source: Source, ids: list[str], cameras: list[CameraSettings]) -> Cameras:
    nothing = [np.nan, np.nan]
    for name, camera in zip(ids, cameras):
        if any(camera.boresight) or _has_unit(camera.sigmas.get("boresight", 0.0)):
            ask_for_angle_unit(source, "a boresight is given", "cameras", name)
    n = len(ids)
    return Cameras(
        id=texts(ids),
        kind=texts(c.kind for c in cameras),
        image_coordinates=texts(c.image_coordinates for c in cameras),
        pixel_size_mm=np.array([c.pixel.size if c.pixel else nothing for c in cameras]).reshape(n, 2),
        pixel_origin=texts((c.pixel.origin or "") if c.pixel else "" for c in cameras),
        pixel_y=texts((c.pixel.y or "") if c.pixel else "" for c in cameras),
        format=np.array([c.format or nothing for c in cameras]).reshape(n, 2),
        principal_distance_mm=np.array([c.principal_distance for c in cameras]),
        principal_point_mm=np.array([c.principal_point for c in cameras]).reshape(n, 2),
        symmetry_point_mm=np.array([c.symmetry_point for c in cameras]).reshape(n, 2),
        distortion=texts(c.distortion.model for c in cameras),
        lever_arm_m=np.array([c.lever_arm for c in cameras]).reshape(n, 3),
        boresight_rad=np.array([c.boresight for c in cameras]).reshape(n, 3) * plain_angle_rad(source),
        mount_deg=np.array([c.mount for c in cameras], np.int32),
    )


def _has_unit(sigma: float | list[float]) -> bool:
    """Whether a standard deviation is a figure: 0 and infinity are so in every unit."""
    return any(0 < s < np.inf for s in (sigma if isinstance(sigma, list) else [sigma]))


def _parameters(source: Source, cameras: list[CameraSettings]) -> CameraParameters:
    """One row per distortion parameter or given standard deviation, by camera and name."""
    camera, name, value, sigma, free = [], [], [], [], []
    for k, settings in enumerate(cameras):
        sigmas: dict[str, float] = {}
        for parameter, given in settings.sigmas.items():
            if parameter in VECTORS:
                listed = given if isinstance(given, list) else [given] * len(VECTORS[parameter])
                unit = plain_angle_rad(source) if parameter == "boresight" else 1.0
                sigmas |= {f"{parameter}.{axis}": s * unit for axis, s in zip(VECTORS[parameter], listed)}
            else:
                sigmas[parameter] = given[0] if isinstance(given, list) else given
        for parameter in sorted({*sigmas, *settings.distortion.parameters}):
            s = sigmas.get(parameter, np.nan)
            camera.append(k)
            name.append(parameter)
            value.append(settings.distortion.parameters.get(parameter, np.nan))
            sigma.append(np.nan if np.isinf(s) else s)
            free.append(bool(np.isinf(s)))
    return CameraParameters(camera=np.array(camera, np.int32), name=texts(name), value=np.array(value, float),
                            sigma=np.array(sigma, float), free=np.array(free, bool))  # fmt: skip


def _distortion(cameras: list[CameraSettings]) -> DistortionTable:
    counts = [len(c.distortion.radius) for c in cameras]
    return DistortionTable(
        camera=np.repeat(np.arange(len(cameras), dtype=np.int32), counts),
        radius_mm=np.array([r for c in cameras for r in c.distortion.radius], float),
        correction_mm=np.array([v for c in cameras for v in c.distortion.correction], float) * 1e-3,
    )


def _fiducials(source: Source, ids: list[str], cameras: list[CameraSettings]) -> Fiducials:
    camera, name, xy = [], [], []
    for k, settings in enumerate(cameras):
        for mark in canonical(settings.fiducials):
            if not is_valid(mark):
                where = source.document.where_key("cameras", ids[k], "fiducials", mark)
                source.problems.append(InputError(f"fiducial {clipped(mark)!r} is no id", where=where))
            camera.append(k)
            name.append(mark)
            xy.append(settings.fiducials[mark])
    return Fiducials(camera=np.array(camera, np.int32), id=texts(name), xy_mm=np.array(xy, float).reshape(-1, 2))
