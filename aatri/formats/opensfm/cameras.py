"""Cameras of OpenSfM: focal lengths and principal point divided by max(width, height), the point from the image centre.

    perspective                   1 + k1 r^2 + k2 r^4, one focal length
    simple_radial, radial         the same with two focal lengths and a principal point
    brown                         OpenCV's k1 k2 k3 p1 p2
    fisheye, fisheye_opencv       k1 k2, or k1 k2 k3 k4, of theta

The formulas are those of `conventions.lens`.
"""

import numpy as np

from aatri.formats.conventions.lens import FORMS, Lens
from aatri.formats.text.json_text import JsonText, Key

MODELS = [name.removeprefix("opensfm-") for name in FORMS if name.startswith("opensfm-")]
"""What OpenSfM calls its models."""


def read_cameras(document: JsonText, sections: list[tuple[Key, ...]]) -> list[Lens]:
    """Cameras, each once.

    Parameters
    ----------
    sections : list of keys
        Where objects of cameras are.

    Raises
    ------
    InputError
        If a camera has a model that has none of ours, or no size or focal length.
    """
    cameras: dict[Key, Lens] = {}
    for section in sections:
        for name in document.get(dict, *section):
            if name not in cameras:
                cameras[name] = _lens(document, (*section, name))
    return list(cameras.values())


def _lens(document: JsonText, keys: tuple[Key, ...]) -> Lens:
    kind = document.get(str, *keys, "projection_type")
    if kind not in MODELS:
        what = f"camera {keys[-1]!r} is of the projection type {kind!r}, which has no like here"
        raise document.fault((*keys, "projection_type"), what, f"types that are read: {', '.join(MODELS)}")
    form = FORMS[f"opensfm-{kind}"]
    width, height = (document.get(float, *keys, side) for side in ("width", "height"))
    longer = max(width, height)
    one = document.get(float, *keys, "focal", default=np.nan)
    fx, fy = (longer * document.get(float, *keys, f"focal_{axis}", default=one) for axis in "xy")
    if form.focal_lengths == 1:
        fx = fy = longer * one
    if not min(width, height, fx, fy) > 0:
        what = f"camera {keys[-1]!r} has no positive width, height and focal length"
        raise document.fault(keys, what, "export the reconstruction again")
    point = (0.0, 0.0)
    if form.principal_point:
        x, y = (longer * document.get(float, *keys, f"c_{axis}", default=0.0) for axis in "xy")
        point = (x, y)
    parameters = {name: document.get(float, *keys, name, default=0.0) for name in form.terms}
    where = document.where(*keys)
    return Lens(str(keys[-1]), f"opensfm-{kind}", (width, height), (fx, fy), point, parameters, where=where)
