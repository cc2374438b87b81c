"""PATB's orientations, `.ori`: three records of fixed width a photo.

    I16, 16X, 3F16.5    photo  X Y Z                  m
    5F16.12             a11 a12 a13 a21 a22
    4F16.12             a23 a31 a32 a33

The records do not say whether the matrix maps image to ground (Rx Ry Rz, as Pix4D and aatri write it) or back: the
lines of the flight do (`conventions.matrix_sense`), or the user (`maps`). They are start values.

Source: PCI Geomatics, support document 204186705.
"""

from pathlib import Path

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.formats.conventions.matrix_sense import as_ground_from_image
from aatri.formats.conventions.poses import is_rotation
from aatri.formats.parts.block_parts import PLANE, BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, Reading
from aatri.formats.text.text_file import read_lines
from aatri.formats.text.text_line import TextLine, blank_separated, places
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
