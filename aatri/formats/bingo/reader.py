"""BINGO's image coordinates and `geoin.dat`, as Metashape and Pix4D write them too.

    image coordinates    image [camera]            of each image; a camera stands until the next one is named
                         point x y [more]          mm from the image centre, x right, y up; a line a point
                         -99                       ends an image
    geoin.dat            CAPA camera c [x0 y0]     mm
                         RADI camera step d1 d2 .. mm; radial distortion in um at step, 2 step, ...
                         COES [sX sY sZ]           default standard deviations of control, m
                         CONT point X Y Z [sX sY sZ]

geoin.dat has columns: keyword 1-4, camera 8-23, point 5-20, then numbers. Writers overrun them, so that numbers touch:
then they are told apart by their fifteen decimals, else by the columns of the ruler, else by blanks. A `*` or `C` in
column 1 is a remark. Other keywords are no part of a block and are told.

d is what is added outwards to the measurement, at the radius of the ideal point: held against the calibration that the
sample's exporter wrote beside it, d(r) = -(k1 r^3 + k2 r^5), and the first value belongs to one step, not to zero.

Source: support.pix4d.com 203590305; geoin.dat's own remarks; the sample.
"""

import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from aatri.codes import CONTROL
from aatri.errors import InputError
from aatri.formats.bingo.writer import write_bingo
from aatri.formats.conventions.pixel_origins import PIXEL_AXES
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, FileView, Format, Reading
from aatri.formats.text.number_text import is_number
from aatri.formats.text.text_file import read_lines
from aatri.formats.text.text_line import TextLine, blank_separated, places, word_lines
from aatri.ids import clipped, several, shown
from aatri.progress import SILENT, Reporter

END = "-99"
REMARK = "C"
"""Begins a remark, as `*` does, but where a point of this name may stand."""
TOUCHING = re.compile(r"-?[0-9]{1,20}\.[0-9]{15}")
RULER = {
    "CAPA": (7, 23, (10, 9, 9, 8, 8, 8)),
    "RADI": (7, 23, ()),
    "COES": (4, 20, (14, 14, 11)),
    "CONT": (4, 20, (14, 14, 11, 7, 7, 7)),
}
"""Keywords that are read: where their name begins and ends, and the widths of the numbers after it."""

LEAST = {"CAPA": 1, "RADI": 2, "COES": 3, "CONT": 3}
"""Fewest numbers after the name."""


def read_image_coordinates(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read image coordinates.

    Raises
    ------
    InputError
        If a line is not of this form, an image stands twice, or the end is missing. A point that stands twice in an
        image is left to the checks of the block.
    """
    images: list[tuple[TextLine, str]] = []
    image_of_row: list[str] = []
    rows: list[TextLine] = []
    first: dict[str, TextLine] = {}
    camera, inside = "", False
    for line in word_lines(path, reporter, remark="*"):
        words = line.words
        if words[0] == REMARK and not (inside and len(words) in (3, 4)):
            continue
        if words == [END]:
            inside = False
        elif not inside and len(words) <= 2:
            camera = words[1] if len(words) == 2 else camera
            images.append((line, camera))
            line.once(words[0], first, "image")
            inside = True
        elif inside and len(words) in (3, 4):
            image_of_row.append(images[-1][0].words[0])
            rows.append(line)
        else:
            what = "inside an image" if inside else "where an image should begin"
            raise line.error(f"{several(len(words), 'word')} {what}", f"write `image camera`, `point x y`, {END}")
    if inside:
        where = f"{path}:{rows[-1].line if rows else 1}"
        raise InputError(f"the last image does not end with {END}", where=where, remedy="the file is incomplete")
    if not rows:
        raise InputError("no image point", where=str(path), remedy="export the image coordinates again")
    more = sum(len(line.words) == 4 for line in rows)
    if 0 < more < len(rows):
        odd = next(line for line in rows if len(line.words) == (4 if 2 * more <= len(rows) else 3))
        what = f"{several(len(odd.words), 'word')}, and {7 - len(odd.words)} in most lines: a blank within a number?"
        raise odd.error(what, "give every point the fourth column, or none")
    return BlockParts(
        "bingo",
        [path],
        name=path.stem,
        notes=[f"a fourth column of {several(more, 'image point')} is not read"] if more else [],
        pixel_axes=PIXEL_AXES["bingo"],
        images={
            "id": [line.words[0] for line, _ in images],
            "camera": [name for _, name in images],
            **places([line for line, _ in images], [path]),
        },
        image_points={
            "image": image_of_row,
            "point": [line.words[0] for line in rows],
            "xy": [line.numbers(1, 3) for line in rows],
            **places(rows, [path]),
        },
    )


def read_geoin(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read `geoin.dat`.

    Raises
    ------
    InputError
        If a line is not of this form, or a camera or point stands twice.
    """
    cameras: dict[str, TextLine] = {}
    radial: dict[str, TextLine] = {}
    control: dict[str, TextLine] = {}
    default, others = [np.nan] * 3, set[str]()
    for number, text in enumerate(read_lines(path, reporter), 1):
        if not text.strip() or (text[0] in "*C" and text[:4] not in RULER):
            continue
        if "\t" in text:
            raise InputError("a tabulator", where=f"{path}:{number}", remedy="write blanks: columns count")
        keyword = text[:4].strip()
        if keyword not in RULER:
            others.add(keyword)
            continue
        line = _line(text, keyword, path, number)
        if keyword == "COES":
            default = line.of_width(4, "COES sX sY sZ").numbers(1)
            continue
        table, what = {
            "CAPA": (cameras, "camera"),
            "RADI": (radial, "distortion of camera"),
            "CONT": (control, "control point"),
        }[keyword]
        line.once(line.words[0], table, what)
    if not (cameras or control):
        raise InputError("no CAPA and no CONT", where=f"{path}:1", remedy="give geoin.dat, or the file with control")
    notes = [f"keywords not read: {shown(sorted(others))}"] if others else []
    parts = BlockParts("bingo_geoin", [path], name=path.stem, notes=notes)
    if cameras:
        parts.cameras = _cameras(cameras, radial)
    if radial:
        parts.others = {"distortion_table": _table(cameras, radial)}
    if control:
        sigma = [line.numbers(4) if len(line.words) > 4 else default for line in control.values()]
        for line, values in zip(control.values(), sigma):
            if len(values) != 3 or (not np.isnan(values).all() and min(values) <= 0):
                raise line.error(f"standard deviations {values}", "give three, positive, in m, or COES")
        parts.ground_points = {
            "point": list(control),
            "xyz_m": [line.numbers(1, 4) for line in control.values()],
            "sigma_m": sigma,
            "role": CONTROL,
            **places(list(control.values()), [path]),
        }
    return parts


def _line(text: str, keyword: str, path: Path, number: int) -> TextLine:
    """The name and the numbers of a line."""
    start, end, widths = RULER[keyword]
    name, rest = text[start:end].strip(), text[end:]
    words = blank_separated(rest)
    if any(not is_number(word) for word in words):
        apart = TOUCHING.findall(rest)
        if "".join(apart) == "".join(words):
            words = apart
        elif len(words) < LEAST[keyword]:
            ends = np.cumsum([0, *widths]).tolist()
            cells = [rest[a:b].strip() for a, b in pairwise(ends)]
            words = [cell for cell in [*cells, *blank_separated(rest[ends[-1] :])] if cell]
    line = TextLine([name, *words], path, number)
    if len(blank_separated(name)) > 1 and len(text) > end and " " not in text[end - 1 : end + 1]:
        what = f"{clipped(name)!r} in columns {start + 1}-{end}, which end within a word"
        raise line.error(what, f"write the name alone there, and the numbers from column {end + 1} on")
    line.numbers(1)
    if keyword != "COES" and not name:
        raise line.error(f"{keyword} without a name in columns {start + 1}-{end}", "keep to the columns")
    if len(words) < LEAST[keyword]:
        raise line.error(f"{keyword} {clipped(name)} with {several(len(words), 'number')}", "the line is incomplete")
    return line


def _cameras(cameras: dict[str, TextLine], radial: dict[str, TextLine]) -> dict[str, object]:
    values = [[*line.numbers(1), 0.0, 0.0][:3] for line in cameras.values()]
    for line, (c, _, _) in zip(cameras.values(), values):
        if c <= 0:
            raise line.error(f"principal distance {c:g}", "it is in mm and positive")
    return {
        "id": list(cameras),
        "image_coordinates": "photo",
        "principal_distance_mm": [value[0] for value in values],
        "principal_point_mm": [value[1:] for value in values],
        "distortion": ["table" if name in radial else "none" for name in cameras],
    }


def _table(cameras: dict[str, TextLine], radial: dict[str, TextLine]) -> dict[str, object]:
    """Radii of measured points and what is added to them, both in mm, as far as the lens does not fold."""
    rows: list[tuple[str, float, float]] = []
    for name, line in radial.items():
        if name not in cameras:
            raise line.error(f"camera {name} has no CAPA", "give its principal distance")
        step, *values = line.numbers(1)
        if step <= 0:
            raise line.error(f"a step of {step:g} mm", "it is positive")
        correction_mm = np.array([0.0, *values]) * 1e-3
        measured_mm = step * np.arange(len(correction_mm)) - correction_mm
        fold = np.flatnonzero(np.diff(measured_mm) <= 0)
        last = int(fold[0]) + 1 if len(fold) else len(measured_mm)
        rows += [(name, r, d) for r, d in zip(measured_mm[:last].tolist(), correction_mm[:last].tolist())]
    return dict(zip(("camera", "radius_mm", "correction_mm"), zip(*rows)))


PAGE = "docs/formats.md#bingo"
_NUMBER = r"[-+]?[0-9]+(?:\.[0-9]*)?"
_HEAD, _POINT = re.compile(r"\s*\S+(?:\s+\S+)?\s*"), re.compile(rf"\s*\S+\s+{_NUMBER}\s+{_NUMBER}(?:\s+\S+)?\s*")


def _image_coordinates(view: FileView) -> bool:
    lines = [line for line in view.lines if not line.startswith(("*", "C "))]
    ended = any(line.strip() == "-99" for line in lines)
    return ended and len(lines) > 2 and bool(_HEAD.fullmatch(lines[0]) and _POINT.fullmatch(lines[1]))


def _geoin(view: FileView) -> str:
    keys = {line[:4] for line in view.lines}
    seen = [key for key in ("CAPA", "RADI", "CONT") if key in keys]
    return f"lines {', '.join(seen)}" if seen else ""


BINGO = Format(
    "bingo",
    "BINGO image coordinates",
    _image_coordinates,
    "images with lines `point x y`, ended by -99",
    carries=("image points",),
    page=PAGE,
    read=read_image_coordinates,
    write=write_bingo,
    written=("cameras", "image points", "control", "standard deviations"),
)
GEOIN = Format(
    "bingo_geoin",
    "BINGO geoin.dat",
    _geoin,
    "lines that begin with CAPA, RADI, CONT",
    carries=("cameras", "distortion", "control", "standard deviations"),
    page=PAGE,
    read=read_geoin,
)
