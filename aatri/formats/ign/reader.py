"""IGN's lists beside its OPK list: image points (`.mes`), ground points (`.app`), cameras.

    .mes       point image column row                     px from the upper left corner, y down
    .app       "point" type X Y Z [sX sY sZ]              m; names may stand in quotes
    camera     Name = ...  PPAx = ...  PPAy = ...  focal = ...  width = ...  height = ...      px

None of these files states a height system: in the sample the OPK list has altitudes, the ground points ellipsoidal
heights. Say so by `vertical`, or by `geoid` with the grid file.

Source: IGNF/Borea, documentation and data set.
"""

import re
from functools import partial
from pathlib import Path

from aatri.codes import CONTROL
from aatri.errors import InputError
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import camera_parts
from aatri.formats.parts.block_parts import PLANE, BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, FileView, Format, Reading
from aatri.formats.text.text_line import TextLine, check_positive, places, word_lines
from aatri.ids import clipped, several
from aatri.progress import SILENT, Reporter

OF_CAMERAS = ("PPAx", "PPAy", "focal", "width", "height")


def read_marks(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read image points, `.mes`.

    Raises
    ------
    InputError
        If a line is not of this form, or a point stands twice in an image.
    """
    first: dict[str, TextLine] = {}
    lines = word_lines(path, reporter, remark="#")
    for line in lines:
        line.of_width(4, "`point image column row`")
        line.once(f"{line.words[0]} in image {line.words[1]}", first, "point")
    return BlockParts(
        "ign_mes",
        [path],
        name=path.stem,
        image_points={
            "point": [_name(line) for line in lines],
            "image": [line.words[1] for line in lines],
            "xy": [line.numbers(2) for line in lines],
            **places(lines, [path]),
        },
    )


def read_ground_points(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read ground points, `.app`; all are control, whatever their type.

    Raises
    ------
    InputError
        If a line is not of this form, or a point stands twice.
    """
    first: dict[str, TextLine] = {}
    lines = word_lines(path, reporter, remark="#")
    for line in lines:
        if len(line.words) not in (5, 8):
            raise line.error(several(len(line.words), "word"), 'write `"point" type X Y Z`, with sX sY sZ or without')
        line.once(_name(line), first, "ground point")
        line.count(1)
        check_positive(line, line.numbers(5))
    types = sorted({line.words[1] for line in lines})
    unknown = [float("nan")] * 3
    return BlockParts(
        "ign_app",
        [path],
        name=path.stem,
        frame=PLANE,
        notes=[f"points of type {', '.join(types)} are all control: no type is a check point here"],
        ground_points={
            "point": [_name(line) for line in lines],
            "xyz_m": [line.numbers(2, 5) for line in lines],
            "sigma_m": [line.numbers(5) or unknown for line in lines],
            "role": CONTROL,
            **places(lines, [path]),
        },
    )


def read_camera(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a camera: lines `key = value`.

    Raises
    ------
    InputError
        If a value is missing or no number.
    """
    values: dict[str, TextLine] = {}
    for line in word_lines(path, reporter, blanks="=", remark="#"):
        line.once(line.words[0], values, "key")
    if absent := [key for key in ("Name", *OF_CAMERAS) if key not in values]:
        where = f"{path}:{max(line.line for line in values.values())}"
        raise InputError(f"{', '.join(absent)} missing", where=where, remedy="write `key = value`, in px")
    name = " ".join(values["Name"].words[1:])
    x, y, f, width, height = (values[key].of_width(2, f"{key} = value").number(1) for key in OF_CAMERAS)
    if min(f, width, height) <= 0:
        raise values["focal"].error(f"focal length {f:g}, image of {width:g} x {height:g}", "they are px and positive")
    lens = Lens(name, "none", (width, height), (f, f), (x - width / 2, y - height / 2), where=values["focal"].where)
    return BlockParts("ign_camera", [path], name=name, **camera_parts([lens], reporter))


def _name(line: TextLine) -> str:
    name = line.words[0].strip('"')
    if not name:
        raise line.error(f"{clipped(line.words[0])!r} is no name", "give the point one")
    return name


PAGE = "docs/formats.md#ign-lists"
_NUMBER = r"[-+]?[0-9]+(?:\.[0-9]*)?"
_MARK = re.compile(rf"\S+\s+(?!{_NUMBER}\s)\S*[A-Za-z_.]\S*\s+{_NUMBER}\s+{_NUMBER}\s*")
_POINT = re.compile(rf'"[^"]+"\s+[0-9]+(?:\s+{_NUMBER}){{3}}(?:(?:\s+{_NUMBER}){{3}})?\s*')


def _all_lines(form: re.Pattern[str], view: FileView) -> bool:
    return bool(view.lines) and all(form.fullmatch(line.strip()) for line in view.lines[:20])


def _camera(view: FileView) -> str:
    keys = {line.partition("=")[0].strip() for line in view.lines[:20]}
    return "keys PPAx, PPAy, focal" if {"Name", "PPAx", "PPAy", "focal"} <= keys else ""


IGN_MARKS = Format(
    "ign_mes",
    "IGN image points (.mes)",
    partial(_all_lines, _MARK),
    "lines `point image column row`",
    carries=("image points",),
    page=PAGE,
    read=read_marks,
)
IGN_POINTS = Format(
    "ign_app",
    "IGN ground points (.app)",
    partial(_all_lines, _POINT),
    'lines `"point" type X Y Z`',
    carries=("control", "standard deviations"),
    page=PAGE,
    read=read_ground_points,
)
IGN_CAMERA = Format(
    "ign_camera",
    "IGN camera",
    _camera,
    "lines `PPAx = ...`, `focal = ...`",
    carries=("cameras",),
    page=PAGE,
    read=read_camera,
)
