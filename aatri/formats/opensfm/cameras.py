"""Cameras of OpenSfM: focal lengths and principal point divided by max(width, height), the point from the image centre.

    perspective                   bal: 1 + k1 r^2 + k2 r^4, one focal length
    simple_radial, radial         the same with two focal lengths and a principal point
    brown                         opencv with k1 k2 k3 p1 p2
    fisheye, fisheye_opencv       fisheye with k1 k2, or k1 k2 k3 k4

The formulas are those of `aatri.camera.models.forward_models`. No camera has millimetres: a pixel is 0.001 mm wide, and
0.001 fx / fy mm high.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from aatri.formats.conventions.pixel_origins import PIXEL_AXES, PIXEL_MM, principal_point_mm
from aatri.formats.text.json_text import JsonText, Key


class CameraModel(NamedTuple):
    """Our distortion, the names of its parameters, and whether x and y have focal lengths of their own."""

    distortion: str
    parameters: tuple[str, ...]
    two: bool


MODELS = {
    "perspective": CameraModel("bal", ("k1", "k2"), two=False),
    "simple_radial": CameraModel("bal", ("k1",), two=True),
    "radial": CameraModel("bal", ("k1", "k2"), two=True),
    "brown": CameraModel("opencv", ("k1", "k2", "k3", "p1", "p2"), two=True),
    "fisheye": CameraModel("fisheye", ("k1", "k2"), two=False),
    "fisheye_opencv": CameraModel("fisheye", ("k1", "k2", "k3", "k4"), two=True),
}
"""What OpenSfM calls its models."""

ORIGIN = PIXEL_AXES["aatri"]


def camera_columns(document: JsonText, sections: list[tuple[Key, ...]]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Columns of cameras and of their parameters, each camera once.

    Parameters
    ----------
    document : JsonText
    sections : list of keys
        Where objects of cameras are.

    Raises
    ------
    InputError
        If a camera has a model that has none of ours, or no size or focal length.
    """
    cameras: dict[str, dict[str, Any]] = {}
    parameters: list[tuple[str, str, float]] = []
    for section in sections:
        for name in document.get(dict, *section):
            if name in cameras:
                continue
            cameras[name], values = _camera(document, (*section, name))
            parameters += [(name, parameter, value) for parameter, value in values.items()]
    columns: dict[str, Any] = {"id": list(cameras)}
    for key in ("pixel_size_mm", "format", "principal_distance_mm", "principal_point_mm", "distortion"):
        columns[key] = [camera[key] for camera in cameras.values()]
    columns |= {"pixel_origin": ORIGIN.origin, "pixel_y": ORIGIN.y}
    of, name, value = zip(*parameters) if parameters else ((), (), ())
    return columns, {"camera": list(of), "name": list(name), "value": list(value)} if parameters else {}


def _camera(document: JsonText, keys: tuple[Key, ...]) -> tuple[dict[str, Any], dict[str, float]]:
    kind = document.get(str, *keys, "projection_type")
    if kind not in MODELS:
        what = f"camera {keys[-1]!r} is of the projection type {kind!r}, which has no like here"
        raise document.fault((*keys, "projection_type"), what, f"types that are read: {', '.join(MODELS)}")
    size = np.array([document.get(float, *keys, side) for side in ("width", "height")], dtype=np.float64)
    one = document.get(float, *keys, "focal", default=np.nan)
    focal = np.array([document.get(float, *keys, f"focal_{axis}", default=one) for axis in "xy"], dtype=np.float64)
    focal = focal if MODELS[kind].two else np.array([one, one])
    if not ((size > 0).all() and (focal > 0).all()):
        what = f"camera {keys[-1]!r} has no positive width, height and focal length"
        raise document.fault(keys, what, "export the reconstruction again")
    pixel_mm = PIXEL_MM * np.array([1.0, focal[0] / focal[1]])
    centre = [document.get(float, *keys, f"c_{axis}", default=0.0) if MODELS[kind].two else 0.0 for axis in "xy"]
    camera = {
        "pixel_size_mm": pixel_mm,
        "format": size,
        "principal_distance_mm": float(focal[0] * size.max() * PIXEL_MM),
        "principal_point_mm": principal_point_mm(centre, PIXEL_AXES["opensfm"], size, pixel_mm),
        "distortion": MODELS[kind].distortion,
    }
    return camera, {name: document.get(float, *keys, name, default=0.0) for name in MODELS[kind].parameters}
