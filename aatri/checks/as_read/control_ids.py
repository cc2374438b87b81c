"""Control that no image shows because its ids are written otherwise there: other case, other form of Unicode, zeros.

Seen: control and measurements that have nothing in common, though they are of one project.
Test: an id that nothing measures is, without case, form and zeros, that of a measured point without coordinates. If
all control is lost so, the block would hang on nothing, or on positions alone: an error. One point is a warning.
"""

import re
import unicodedata

import numpy as np

from aatri.arrays import Bool
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.checks.finding import Finding, Level
from aatri.ids import printable, shown


def joined(block: Block) -> Bool:
    """Points named by geodetic observations or relative control, (points,)."""
    g, members = block.geodetic, block.relative_control_members
    start, end = g.start[g.active & (g.start_kind == "point")], g.end[g.active & (g.end_kind == "point")]
    return np.isin(block.points.id, np.concatenate([start, end, g.via[g.active], members.id]))


def lost_control(block: Block) -> list[Finding]:
    """The error if all control is lost, a warning for single points."""
    ground, rows = block.ground_points, block.image_points
    is_used = joined(block)
    is_used[rows.point[rows.active]] = True
    named = np.flatnonzero(ground.given_as(CONTROL, CHECK))
    lost = [row for row in named.tolist() if not is_used[ground.point[row]]]
    if not lost or not is_used.any():
        return []
    with_coordinates = set(ground.point[named].tolist())
    measured: dict[str, str] = {}
    for point in np.flatnonzero(is_used).tolist():
        if point not in with_coordinates:
            measured.setdefault(_plain(str(block.points.id[point])), str(block.points.id[point]))
    ids = [str(block.points.id[ground.point[row]]) for row in lost]
    meant = {row: measured[_plain(name)] for row, name in zip(lost, ids) if _plain(name) in measured}
    if not meant:
        return []
    control = np.flatnonzero(ground.given_as(CONTROL))
    first = next(iter(meant))
    level: Level = "warning"
    what = "points with coordinates that nothing measures"
    if len(control) and not is_used[ground.point[control]].any():
        level, what = "error", "no control point is measured"
    what += f"; did you mean {shown(_pairs(block, meant), 3)}?"
    remedy = "give a point the same id in all tables, to the letter"
    return [Finding("control_ids", level, what, remedy, where=block.read_at(ground, first))]


def _pairs(block: Block, meant: dict[int, str]) -> list[str]:
    ids = block.points.id[block.ground_points.point]
    return [
        f"{printable(name)!r} for {printable(str(ids[row]))!r}{_form(name, str(ids[row]))}"
        for row, name in meant.items()
    ]


def _form(a: str, b: str) -> str:
    """Of ids that look alike, why they are not the same."""
    same = unicodedata.normalize("NFC", a) == unicodedata.normalize("NFC", b)
    return " (another Unicode form)" if same else ""


def _plain(name: str) -> str:
    """The id without what hands and programs change: case, full-width and composed letters, blanks, leading zeros."""
    folded = unicodedata.normalize("NFKC", name).casefold()
    return re.sub(r"(?<![0-9])0+(?=[0-9])", "", re.sub(r"[\s_.-]+", "-", folded).strip("-"))
