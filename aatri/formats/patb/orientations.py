"""PATB's orientations, `.ori`: three records of fixed width a photo, read and written.

    I16, 16X, 3F16.5    photo  X Y Z                  m
    5F16.12             a11 a12 a13 a21 a22
    4F16.12             a23 a31 a32 a33

Read, the records do not say whether the matrix maps image to ground (Rx Ry Rz, as Pix4D and aatri write it) or back:
the lines of the flight do (`conventions.poses`), or the user (`maps`). They are start values.

Written, the matrix is R = Rx(omega) Ry(phi) Rz(kappa), image to ground, x right, y up; coordinates end at 1e-5 m.
Photos are numbers: where the ids are none, `photos.csv` says which is which.

Source: PCI Geomatics, support document 204186705; "PATB convention" in support.pix4d.com 202559089.
"""

import re
from pathlib import Path

import numpy as np

from aatri.arrays import Float
from aatri.errors import GeometryError, InputError
from aatri.formats.conventions.poses import as_ground_from_image, is_rotation, stated_rotation
from aatri.formats.parts.block_parts import PLANE, BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, AS_USUAL, FileView, Format, Reading, Writing
from aatri.formats.results.exported_files import short_names
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.text_file import read_lines
from aatri.formats.text.text_line import TextLine, blank_separated, places
from aatri.formats.text.written_files import write_files
from aatri.ids import clipped, several
from aatri.progress import SILENT, Reporter

WIDTH = 16
FIELDS = ((0, 2, 3, 4), (0, 1, 2, 3, 4), (0, 1, 2, 3))
"""Columns of 16 characters that the records have something in."""


def read_patb(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read orientations.

    Raises
    ------
    InputError
        If a record is missing or not of this form, a photo stands twice, or nothing tells which way the matrices map.
    """
    lines = [(k, text) for k, text in enumerate(read_lines(path, reporter), 1) if text.strip()]
    if not lines:
        raise InputError("the file has no rows", where=str(path), remedy="put the data in")
    if len(lines) % 3:
        what = f"{several(len(lines), 'record')}, three a photo"
        raise InputError(what, where=f"{path}:{lines[-1][0]}", remedy="the file is cut off, or no .ori of PATB")
    first: dict[str, TextLine] = {}
    heads, positions, matrices = list[TextLine](), list[list[float]](), list[Float]()
    for i in range(0, len(lines), 3):
        head, *rows = (_record(path, *lines[i + j], FIELDS[j]) for j in range(3))
        head.once(head.words[0], first, "photo")
        heads.append(head)
        positions.append(head.numbers(1))
        matrices.append(np.array([value for row in rows for value in row.numbers()]).reshape(3, 3))
        if not is_rotation(matrices[-1]):
            raise rows[0].error(f"the matrix of photo {head.words[0]} is no rotation", "export the orientations again")
    stated, position_m = np.array(matrices), np.array(positions)
    R, note = as_ground_from_image(stated, position_m, reading.maps, f"{path}:1")
    names = [head.words[0] for head in heads]
    at = places(heads, [path])
    return BlockParts(
        "patb",
        [path],
        name=path.stem,
        frame=PLANE,
        notes=[note],
        images={"id": names, **at},
        exterior={"image": names, "position_m": position_m, "ground_from_image": R, **at},
    )


def _record(path: Path, line: int, text: str, fields: tuple[int, ...]) -> TextLine:
    """The words of a record; where they touch, its columns."""
    words = blank_separated(text)
    if len(words) != len(fields):
        words = [text[WIDTH * k : WIDTH * (k + 1)].strip() for k in fields]
    if not all(words):
        what = f"{several(len(blank_separated(text)), 'word')} where a record of {len(fields)} should stand"
    elif beyond := text[WIDTH * (fields[-1] + 1) :].strip():
        what = f"{clipped(beyond)!r} stands beyond character {WIDTH * (fields[-1] + 1)}, where the record ends"
    else:
        return TextLine(words, path, line)
    raise InputError(what, where=f"{path}:{line}", remedy="keep to the columns of 16 characters")


LONGEST = 9
"""Digits of a photo number: readers take it for a whole number of four bytes."""


def write_patb(oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT) -> None:
    """Write the oriented images as `orientations.ori`.

    Raises
    ------
    GeometryError
        If no image is oriented.
    """
    rows = np.flatnonzero(oriented.oriented)
    if not len(rows):
        raise GeometryError("no image has position and rotation", remedy="export a result, or give start values")
    photos, table = short_names(oriented.block.images.id[rows].tolist(), LONGEST, numbers=True)
    matrices = stated_rotation(oriented.ground_from_image[rows], "patb").reshape(-1, 9).tolist()
    lines = []
    for photo, xyz, a in zip(photos, oriented.position_m[rows].tolist(), matrices):
        lines.append(f"{photo:>16}{'':16}" + "".join(f"{value:16.5f}" for value in xyz))
        lines += ["".join(f"{value:16.12f}" for value in a[:5]), "".join(f"{value:16.12f}" for value in a[5:])]
    files = {"orientations.ori": "\n".join(lines) + "\n"} | ({"photos.csv": table} if table else {})
    write_files(folder, files)
    reporter.log("the matrices are R = Rx(omega) Ry(phi) Rz(kappa), image to ground; coordinates end at 1e-5 m")


_NUMBER = r"\s*[-+]?[0-9]+\.[0-9]*"
_RECORDS = (
    re.compile(rf"\s*\S{{1,16}}(?:{_NUMBER}){{3}}\s*"),
    re.compile(rf"(?:{_NUMBER}){{5}}\s*"),
    re.compile(rf"(?:{_NUMBER}){{4}}\s*"),
)


def _recognised(view: FileView) -> str:
    records = view.lines[:3]
    alike = len(records) == 3 and all(form.fullmatch(line) for form, line in zip(_RECORDS, records))
    return "records `photo X Y Z` and nine numbers in two lines" if alike else ""


PATB = Format(
    "patb",
    "PATB orientations (.ori)",
    _recognised,
    "three records of fixed width a photo",
    carries=("start orientations",),
    page="docs/formats.md#patb",
    read=read_patb,
    write=write_patb,
    written=("start orientations",),
)
