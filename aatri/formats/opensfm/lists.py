"""OpenDroneMap's lists: gcp_list.txt and geo.txt, a coordinate system in the first line, rows separated by blanks.

    gcp_list.txt   x y z column row image [name] [more]      z NaN: plan control
    geo.txt        image x y [z] [yaw pitch roll] [horizontal and vertical accuracy] [more]

The coordinate system is `EPSG:n`, `WGS84 UTM 17N`, `WGS84` (longitude, latitude) or a PROJ text; `#` begins a remark. x
is longitude or easting, y latitude or northing. Heights are those of the system, ellipsoidal unless it or the source
names a vertical one. Columns and rows count from the centre of the first pixel, as OpenSfM takes them. Without a name a
point is where it is: rows of the same x y z are one point, numbered in their order.

Yaw, pitch and roll are those of a camera that looks straight down at pitch 0, its upper edge ahead, yaw clockwise from
true north: start values. Accuracies are standard deviations, m; NaN is not known.

Sources: OpenDroneMap documentation, Ground control points; Image geolocation files. OpenSfM documentation, gcp.

OpenSfM's ground_control_points.json: points with latitude, longitude, altitude, and where images show them.

Coordinates in the images are normalised as those of tracks.csv. A point without a position is a tie point; one without
an altitude is plan control. Altitudes are taken as ellipsoidal heights of WGS 84, unless the source says `vertical`.

Source: OpenSfM documentation, Using ground control points.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from aatri.codes import CONTROL, NO_ROLE, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.conventions.names import without_extension
from aatri.formats.conventions.pixel_origins import PIXEL_AXES
from aatri.formats.conventions.poses import rotation_of_carrier
from aatri.formats.limits import NEAR_DEG, NEAR_M
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, Reading
from aatri.formats.text.json_text import JsonText
from aatri.formats.text.number_text import is_number
from aatri.formats.text.text_line import TextLine, word_lines
from aatri.frames.conversion import Frame
from aatri.frames.crs_text import crs_from
from aatri.ids import clipped, several
from aatri.progress import SILENT, Reporter

WANTED = "a ground_control_points.json of OpenSfM"
WGS84 = Frame("wgs84", ("latitude", "longitude", "height"), "EPSG:4979")


def read_ground_control(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read ground control points."""
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


def read_gcp_list(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a list of control."""
    frame, rows = _lines(path, reading.crs, reporter)
    ids: dict[object, str] = {}
    ground, measured = [], []
    for row in rows:
        if len(row.words) < 6:
            raise row.error(several(len(row.words), "word"), "write x y z column row image [name]")
        xyz = [*(_number(row, k) for k in range(2)), _number(row, 2, nan=True)]
        if is_number(row.words[5]):
            what = f"{row.words[5]!r} stands where the name of an image should: a blank within a number?"
            raise row.error(what, "write x y z column row image [name]")
        for k, word in enumerate(row.words[6:], 6):
            if without_extension(word) != word and without_extension(row.words[5]) == row.words[5]:
                what = f"{' '.join(row.words[5 : k + 1])!r} is no name of an image: blanks separate columns"
                raise row.error(what, "rename the image without blanks, here and in its other files")
        name = row.words[6] if len(row.words) > 6 else ""
        key = name or tuple(xyz)
        if key not in ids:
            ids[key] = name or _next_name(ids)
            role = [CONTROL, CONTROL, CONTROL if np.isfinite(xyz[2]) else NO_ROLE]
            ground.append((ids[key], xyz, role, row.line))
        elif not np.array_equal(xyz, next(at for point, at, _, _ in ground if point == ids[key]), equal_nan=True):
            raise row.error(f"point {name!r} has other coordinates than before", "mend one of the lines")
        measured.append((row.words[5], ids[key], [row.number(3), row.number(4)], row.line))
    parts = control_parts("odm_gcp", path, frame, ground, measured, "odm_gcp")
    _tell_near(parts, path, reporter)
    return parts


def _next_name(ids: dict[object, str]) -> str:
    taken, n = set(ids.values()), len(ids) + 1
    while f"gcp{n}" in taken:
        n += 1
    return f"gcp{n}"


def _tell_near(parts: BlockParts, path: Path, reporter: Reporter) -> None:
    xyz = np.array(parts.ground_points["xyz_m"])
    near = NEAR_DEG if parts.frame is not None and parts.frame.geographic else NEAR_M
    for k in range(1, len(xyz)):
        gap = np.abs(xyz[:k, :2] - xyz[k, :2]).max(axis=1)
        if len(close := np.flatnonzero(gap < near)):
            a, b = parts.ground_points["point"][int(close[0])], parts.ground_points["point"][k]
            reporter.warn(f"{path}:{parts.ground_points['line'][k]}: points {a} and {b} are at almost one place: one?")


def read_geo(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a list of positions."""
    frame, rows = _lines(path, reading.crs, reporter)
    n = len(rows)
    xyz, sigma, angles = np.full((n, 3), np.nan), np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    for k, row in enumerate(rows):
        if len(row.words) < 3:
            raise row.error(several(len(row.words), "word"), "write image x y [z] [yaw pitch roll] [accuracies]")
        x, y = _number(row, 1), _number(row, 2)
        xyz[k] = [x, y, _number(row, 3, nan=True)]
        if len(row.words) > 6:
            angles[k] = [_number(row, j, nan=True) for j in (6, 5, 4)]
        if len(row.words) > 8:
            plan, height = _number(row, 7, nan=True), _number(row, 8, nan=True)
            if plan <= 0 or height <= 0:
                raise row.error(f"accuracies are {plan:g} and {height:g}", "write standard deviations in m, or NaN")
            sigma[k] = [plan, plan, height]
    parts = BlockParts("odm_geo", [path], frame=frame)
    parts.exterior = {
        "image": [row.words[0] for row in rows],
        "position_m": xyz,
        "sigma_m": sigma,
        "position_use": OBSERVED_VALUE,
        "line": [row.line for row in rows],
    }
    if np.isfinite(angles).all(axis=1).any():
        parts.exterior |= {"ground_from_image": rotation_of_carrier(np.radians(angles))[0]}
        if frame is not None and not frame.geographic:
            parts.notes.append(
                "yaw counts from true north, the map from grid north: start values, the angle between is left"
            )
    return parts


def _lines(path: Path, crs: str | None, reporter: Reporter) -> tuple[Frame | None, list[TextLine]]:
    """The frame of the first line, and the rows."""
    first, *rows = word_lines(path, reporter, remark="#")
    if not rows:
        raise first.error("the file has no rows", "write them below the coordinate system")
    text = " ".join(first.words)
    return _frame(_crs(crs or text, first), crs or text, first), rows


def _crs(text: str, first: TextLine) -> str:
    if utm := re.fullmatch(r"WGS84\s+UTM\s+([0-9]{1,2})\s*([NS]?)", text, re.IGNORECASE):
        zone, south = int(utm.group(1)), utm.group(2).upper() == "S"
        if 1 <= zone <= 60:
            return f"EPSG:{(32700 if south else 32600) + zone}"
    if text.upper() == "WGS84":
        return "EPSG:4326"
    if re.match(r"EPSG:[0-9]{4,6}(\+[0-9]{4,6})?$|[A-Z_]+\[|.*\+(proj|init)=", text, re.IGNORECASE):
        return text
    what = f"{clipped(text)!r} names no coordinate system"
    raise first.error(what, "write EPSG:2180, WGS84 UTM 17N, a PROJ text, WKT, or say it: `--set crs=EPSG:...`")


def _frame(crs: str, text: str, first: TextLine) -> Frame:
    import pyproj

    try:
        system = crs_from(crs)
    except pyproj.exceptions.CRSError as error:
        what = f"{clipped(text)!r} is no known coordinate system"
        raise first.error(what, "write EPSG:32617 or another PROJ text") from error
    axes = ("longitude", "latitude", "height") if system.is_geographic else ("east", "north", "up")
    return Frame("list", axes, crs)


def _number(row: TextLine, k: int, *, nan: bool = False) -> float:
    if nan and k < len(row.words) and row.words[k].lower() == "nan":
        return float("nan")
    try:
        return row.number(k)
    except InputError:
        if nan and k >= len(row.words):
            return float("nan")
        raise
