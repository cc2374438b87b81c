"""OpenSfM's reconstruction.json: cameras, oriented images, points; image points are in tracks.csv.

A shot has the rotation vector w and the translation t of the world to the camera, whose axes are x right, y down, z
forward: P = exp([w]x) X + t. So ground_from_image = exp([w]x)' diag(1, -1, -1), X0 = -exp([w]x)' t. The world is the
horizon (east, north, up) of `reference_lla` on WGS 84; where that is missing or 0, 0, 0, the model is free.

The file may hold several reconstructions: parts of the block that OpenSfM could not join. In one horizon all of them
are start values; free models are not in one frame, so that only the largest is.

Source: OpenSfM documentation, Geometric Models; Dataset Structure, reconstruction file format.

Cameras: focal lengths and principal point divided by max(width, height), the point from the image centre.

    perspective                   1 + k1 r^2 + k2 r^4, one focal length
    simple_radial, radial         the same with two focal lengths and a principal point
    brown                         OpenCV's k1 k2 k3 p1 p2
    fisheye, fisheye_opencv       k1 k2, or k1 k2 k3 k4, of theta

The formulas are those of `conventions.lens`.

OpenSfM's tracks.csv: the image points, separated by tabs.

    OPENSFM_TRACKS_VERSION_v2
    image  track  feature  x  y  size  red  green  blue  segmentation  instance

Version 1 has no segmentation and instance, files without a first line (version 0) no size either. x, y count from the
image centre, y down, divided by max(width, height): pixels need the camera, which is in reconstruction.json.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from aatri.codes import APPROXIMATE
from aatri.errors import InputError
from aatri.formats.conventions.lens import FORMS, Lens
from aatri.formats.conventions.lens_conversion import camera_parts
from aatri.formats.conventions.pixel_origins import PIXEL_AXES
from aatri.formats.conventions.poses import Y_UP
from aatri.formats.parts.block_parts import LOCAL, BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, Reading
from aatri.formats.parts.one_frame import topocentric
from aatri.formats.text.json_text import JsonText, Key
from aatri.formats.text.number_text import numbers_of, what_is_wrong
from aatri.formats.text.text_file import read_lines
from aatri.frames.conversion import Frame
from aatri.geometry.rotations import exp_rotation
from aatri.ids import clipped, several, shown
from aatri.progress import SILENT, Reporter

WORDS = {0: 8, 1: 9, 2: 11}
"""Columns by version."""

X, Y = 3, 4

MODELS = [name.removeprefix("opensfm-") for name in FORMS if name.startswith("opensfm-")]
"""What OpenSfM calls its models."""

WANTED = "a reconstruction.json of OpenSfM"


def read_tracks(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read tracks."""
    lines = read_lines(path, reporter)
    head = re.fullmatch(r"OPENSFM_TRACKS_VERSION_v([0-9]{1,4})", lines[0].strip())
    version = int(head.group(1)) if head else 0
    if version not in WORDS:
        what = f"tracks of version {version}"
        raise InputError(what, where=f"{path}:1", remedy=f"versions that are read: {', '.join(map(str, WORDS))}")
    rows = [(k, text.split("\t")) for k, text in enumerate(lines, 1) if text.strip() and not (head and k == 1)]
    for k, words in rows:
        if len(words) != WORDS[version]:
            what = f"{several(len(words), 'column')} separated by tabs, version {version} has {WORDS[version]}"
            raise InputError(what, where=f"{path}:{k}", remedy="the line is cut, or of another version")
    first: dict[tuple[str, ...], int] = {}
    for k, words in rows:
        if first.setdefault((words[0], words[1], words[2]), k) != k:
            what = f"feature {clipped(words[2])} of image {clipped(words[0])} twice in track {clipped(words[1])}"
            before = f"first in line {first[words[0], words[1], words[2]]}"
            raise InputError(f"{what}, {before}", where=f"{path}:{k}", remedy="remove one")
    if not rows:
        raise InputError("no image points in it", where=str(path), remedy="run OpenSfM's create_tracks")
    xy = np.empty((len(rows), 2))
    for column, name in ((X, 0), (Y, 1)):
        cells = [words[column].strip() for _, words in rows]
        xy[:, name], bad = numbers_of(cells)
        bad = [*bad, *(k for k, cell in enumerate(cells) if not cell)]
        if bad:
            k = bad[0]
            what = f"{'xy'[name]} is {clipped(cells[k])!r}: {what_is_wrong(cells[k]) if cells[k] else 'empty'}"
            raise InputError(what, where=f"{path}:{rows[k][0]}", remedy="write it like -0.1234")
    far = np.flatnonzero((np.abs(xy) > 0.5 + 1e-6).any(axis=1))
    if len(far):
        what = f"({xy[far[0], 0]:g}, {xy[far[0], 1]:g}) lies outside of an image, whose edge is at 0.5"
        remedy = "coordinates are divided by max(width, height), and count from the image centre: no pixels"
        raise InputError(what, where=f"{path}:{rows[int(far[0])][0]}", remedy=remedy)
    parts = BlockParts("opensfm_tracks", [path], pixel_axes=PIXEL_AXES["opensfm"])
    parts.image_points = {
        "image": [words[0] for _, words in rows],
        "point": [words[1] for _, words in rows],
        "xy": xy,
        "line": [k for k, _ in rows],
    }
    return parts


def read_reconstruction(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a reconstruction."""
    document = JsonText(path, WANTED)
    number = range(len(document.get(list)))
    if not number:
        raise document.fault((), "no reconstruction in it", "run OpenSfM to its end")
    lenses = read_cameras(document, [(k, "cameras") for k in number])
    frame = _frame(document)
    parts = BlockParts(
        "opensfm",
        [path],
        name=path.resolve().parent.name,
        frame=frame,
        pixel_axes=PIXEL_AXES["opensfm"],
        **camera_parts(lenses, reporter, allowed_px=reading.lens_misfit_px),
    )
    shots = _shots(document, number, [lens.id for lens in lenses])
    used = [True] * len(shots["id"])
    if frame == LOCAL and len(number) > 1:
        largest = max(number, key=lambda k: len(document.get(dict, k, "shots")))
        used = [part == largest for part in shots["of"]]
        parts.notes.append(
            f"{len(number)} free models: start values have only those of the largest, {several(sum(used), 'image')}"
        )
    parts.images = {k: shots[k] for k in ("id", "camera", "time_s", "line")}
    parts.exterior = _exterior(shots, used)
    parts.ground_points = _points(document, [k for k in number if frame != LOCAL or used[_first(shots["of"], k)]])
    if rigs := [name for k in number for name in _mounted(document, k)]:
        parts.notes.append(f"images of {several(len(rigs), 'rig camera')} stand alone, not as rigs: {shown(rigs)}")
    shots_of = [document.get(dict, k, "shots") for k in number]
    located = [name for shots in shots_of for name, shot in shots.items() if shot.get("gps_position")]
    if located:
        what = f"gps_position of {several(len(located), 'shot')} is not read: {shown(located)}"
        parts.notes.append(f"{what}; give the photographs or geo.txt beside it")
    if any(document.get(dict, k, "points", default={}) for k in number):
        parts.notes.append("its points are start values of those that tracks.csv measures")
    return parts


def _first(values: list[int], value: int) -> int:
    return values.index(value) if value in values else 0


def _mounted(document: JsonText, k: int) -> list[str]:
    """Rig cameras that are mounted on another one, beside it or turned."""
    names = document.get(dict, k, "rig_cameras", default={})
    return [
        name
        for name in names
        if any(any(document.numbers(k, "rig_cameras", name, key, count=3)) for key in ("translation", "rotation"))
    ]


def _frame(document: JsonText) -> Frame:
    if not document.get(dict, 0, "reference_lla", default={}):
        return LOCAL
    place = [document.get(float, 0, "reference_lla", key) for key in ("latitude", "longitude", "altitude")]
    if not any(place):
        return LOCAL
    if not (abs(place[0]) <= 90 and abs(place[1]) <= 360):
        what = f"reference_lla is at latitude {place[0]}, longitude {place[1]}"
        raise document.fault((0, "reference_lla"), what, "degrees, latitude up to 90")
    return topocentric(*place)


def _shots(document: JsonText, numbers: range, cameras: list[str]) -> dict[str, Any]:
    """Shots of all reconstructions, in their order."""
    columns: dict[str, list[Any]] = {k: [] for k in ("id", "camera", "time_s", "line", "of", "w", "t")}
    for k in numbers:
        shots = document.get(dict, k, "shots")
        lines = document.lines(k, "shots") if shots else {}
        for name in shots:
            keys = (k, "shots", name)
            camera = document.get(str, *keys, "camera")
            if camera not in cameras:
                raise document.fault(keys, f"shot {name!r} names camera {camera!r}, which is not there", "export again")
            if name in columns["id"]:
                raise document.fault(keys, f"shot {name!r} is in two reconstructions", "remove one of them")
            time = document.get(float, *keys, "capture_time", default=0.0)
            pose = [document.numbers(*keys, part, count=3) for part in ("rotation", "translation")]
            for column, value in zip(columns.values(), (name, camera, time or np.nan, lines[name], k, *pose)):
                column.append(value)
    if not columns["id"]:
        raise document.fault((0,), "no shots in it", "run OpenSfM to its end")
    return columns


def _exterior(shots: dict[str, Any], used: list[bool]) -> dict[str, Any]:
    chosen = np.flatnonzero(used)
    world_from_camera = exp_rotation(np.array(shots["w"])[chosen]).swapaxes(1, 2)
    return {
        "image": [shots["id"][k] for k in chosen],
        "position_m": -np.einsum("nij,nj->ni", world_from_camera, np.array(shots["t"])[chosen]),
        "ground_from_image": world_from_camera * Y_UP,
        "line": [shots["line"][k] for k in chosen],
    }


def _points(document: JsonText, numbers: list[int]) -> dict[str, Any]:
    ids: list[str] = []
    xyz: list[list[float]] = []
    for k in numbers:
        for name in document.get(dict, k, "points", default={}):
            ids.append(name)
            xyz.append(document.numbers(k, "points", name, "coordinates", count=3))
    first = dict(zip(reversed(ids), reversed(range(len(ids)))))  # a track of two models has the place of the first
    rows = sorted(first.values())
    if not rows:
        return {}
    return {"point": [ids[k] for k in rows], "xyz_m": np.array(xyz)[rows], "role": APPROXIMATE}


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
