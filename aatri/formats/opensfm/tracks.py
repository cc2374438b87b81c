"""OpenSfM's tracks.csv: the image points, separated by tabs.

    OPENSFM_TRACKS_VERSION_v2
    image  track  feature  x  y  size  red  green  blue  segmentation  instance

Version 1 has no segmentation and instance, files without a first line (version 0) no size either. x, y count from the
image centre, y down, divided by max(width, height): pixels need the camera, which is in reconstruction.json.
"""

import re
from pathlib import Path

import numpy as np

from aatri.errors import InputError
from aatri.formats.conventions.pixel_origins import PIXEL_AXES
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, Reading
from aatri.formats.text.number_text import numbers_of, what_is_wrong
from aatri.formats.text.text_file import read_lines
from aatri.ids import clipped, several
from aatri.progress import SILENT, Reporter

WORDS = {0: 8, 1: 9, 2: 11}
"""Columns by version."""

X, Y = 3, 4


def read_tracks(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read tracks.

    Raises
    ------
    InputError
        If a line is not of this form.
    """
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
