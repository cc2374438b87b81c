"""The fiducial marks of one scan: a window around each place where one may be, in any turn of the scan.

A film lies in a scanner in four ways, on either side, so that calibrated marks may lie at eight sets of places. Each
place is looked at once; only windows of the file are read.
"""

from __future__ import annotations

import json

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.features import FoundMarks, ScanMarks
from aatri.errors import InputError
from aatri.pixels.mark_search import best_place
from aatri.pixels.reading import TIFF, Samples, size_px, whole_image, window
from aatri.pixels.templates import drawn
from aatri.regular_file import content_of


def scan_marks(path: str, picture: str, content: str, settings: str) -> ScanMarks:
    """Search the marks of a scan.

    Parameters
    ----------
    path, picture : str
        Files: the scan, and that of a template cut out of one, `""` where it is drawn.
    content : str
        SHA-256 that the block has of the scan.
    settings : str
        JSON: `places_px` of marks from the centre of the scan, x right, y down; `half_px` of a window; `shape`,
        `size_px`, `stroke_px` of a drawn template; `negative`.

    Raises
    ------
    InputError
        If the file is not the one that the block was made with.
    """
    if content_of(path) != content:
        what = "is not there, or has changed since the block was read"
        raise InputError(what, where=path, remedy="make the stage again that names it: aatri run --force STAGE")
    given = json.loads(settings)
    template = (
        whole_image(picture).astype(float) if picture else drawn(given["shape"], given["size_px"], given["stroke_px"])
    )
    width, height = (size_px(path) if path.lower().endswith(TIFF) else whole_image(path).shape[::-1])[:2]
    centre = (np.array([width, height]) - 1) / 2
    rows = []
    for place in np.array(given["places_px"]):
        first = np.clip(np.round(centre + place - given["half_px"]), 0, [width - 1, height - 1]).astype(int)
        last = np.clip(np.round(centre + place + given["half_px"]), 0, [width - 1, height - 1]).astype(int)
        found = best_place(_window(path, first, last).astype(float), template, negative=given["negative"])
        rows.append((*(found.xy_px + first), *found.sigma_px, found.correlation, found.second))
    table = np.array(rows)
    return ScanMarks(
        width_px=int(width),
        height_px=int(height),
        marks=FoundMarks(xy_px=table[:, :2], sigma_px=table[:, 2:4], correlation=table[:, 4], second=table[:, 5]),
    )


def _window(path: str, first: Int, last: Int) -> Samples:
    width, height = (last - first + 1).tolist()
    if path.lower().endswith(TIFF):
        return window(path, int(first[0]), int(first[1]), width, height)
    return whole_image(path)[first[1] : last[1] + 1, first[0] : last[0] + 1]


def ways_of_scanning() -> Float:
    """Linear maps (8, 2, 2) from the film (x right, y up) to a scan (x right, y down): four turns, and mirrored."""
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    turns = [np.linalg.matrix_power(quarter, k) for k in range(4)]
    upright, mirrored = np.diag([1.0, -1.0]), np.diag([-1.0, -1.0])
    return np.array([turn @ side for side in (upright, mirrored) for turn in turns])
