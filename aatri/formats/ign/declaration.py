"""What IGN's lists are recognised by, and what they carry."""

import re
from functools import partial

from aatri.formats.ign.reader import read_camera, read_ground_points, read_marks
from aatri.formats.parts.format import FileView, Format

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
