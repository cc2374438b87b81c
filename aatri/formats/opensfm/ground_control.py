"""OpenSfM's ground_control_points.json: points with latitude, longitude, altitude, and where images show them.

Coordinates in the images are normalised as those of tracks.csv. A point without a position is a tie point; one without
an altitude is plan control. Altitudes are taken as ellipsoidal heights of WGS 84, unless the source says `vertical`.

Source: OpenSfM documentation, Using ground control points.
"""

from pathlib import Path
from typing import Any

import numpy as np

from aatri.codes import CONTROL, NO_ROLE
from aatri.formats.conventions.pixel_origins import PIXEL_AXES
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, Reading
from aatri.formats.text.json_text import JsonText
from aatri.frames.conversion import Frame
from aatri.progress import SILENT, Reporter

WANTED = "a ground_control_points.json of OpenSfM"
WGS84 = Frame("wgs84", ("latitude", "longitude", "height"), "EPSG:4979")


def read_ground_control(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read ground control points.

    Raises
    ------
    InputError
        If the file is not of this form.
    """
    document = JsonText(path, WANTED)
    ground: list[tuple[str, list[float], list[int], int]] = []
    measured: list[tuple[str, str, list[float], int]] = []
    seen: dict[str, int] = {}
    for k, _ in enumerate(document.get(list, "points")):
        keys = ("points", k)
        name = str(document.get(str, *keys, "id"))
        if seen.setdefault(name, k) != k:
            raise document.fault(keys, f"point {name!r} stands twice", "remove one, or give it another id")
        line = document.line(*keys)
        if document.get(dict, *keys, "position", default={}):
            plan = [document.get(float, *keys, "position", key) for key in ("latitude", "longitude")]
            if not (abs(plan[0]) <= 90 and abs(plan[1]) <= 360):
                what = f"point {name!r} is at latitude {plan[0]:g}, longitude {plan[1]:g}"
                raise document.fault((*keys, "position"), what, "write degrees, latitude up to 90")
            height = document.get(float, *keys, "position", "altitude", default=np.nan)
            role = [CONTROL, CONTROL, CONTROL if np.isfinite(height) else NO_ROLE]
            ground.append((name, [*plan, height], role, line))
        for j, _ in enumerate(document.get(list, *keys, "observations")):
            at = (*keys, "observations", j)
            xy = document.numbers(*at, "projection", count=2)
            if max(map(abs, xy)) > 0.5 + 1e-6:
                what = f"point {name!r} lies at {xy}, outside of an image, whose edge is at 0.5"
                raise document.fault(at, what, "coordinates count from the image centre, divided by max(width, height)")
            measured.append((document.get(str, *at, "shot_id"), name, xy, document.line(*at)))
    if not seen:
        raise document.fault(("points",), "no points in it", f"give {WANTED}")
    return control_parts("opensfm_gcp", path, WGS84 if ground else None, ground, measured, "opensfm")


def control_parts(
    name: str,
    path: Path,
    frame: Frame | None,
    ground: list[tuple[str, list[float], list[int], int]],
    measured: list[tuple[str, str, list[float], int]],
    axes: str,
) -> BlockParts:
    """Parts of control with what images show of it: rows (point, xyz, role, line) and (image, point, xy, line)."""
    parts = BlockParts(name, [path], frame=frame, pixel_axes=PIXEL_AXES[axes])
    if ground:
        parts.ground_points = _columns(("point", "xyz_m", "role", "line"), ground)
    if measured:
        parts.image_points = _columns(("image", "point", "xy", "line"), measured)
    return parts


def _columns(names: tuple[str, ...], rows: list[Any]) -> dict[str, Any]:
    return dict(zip(names, map(list, zip(*rows))))
