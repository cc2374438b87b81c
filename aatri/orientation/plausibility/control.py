"""Control held against the positions of the images and against the other control, before anything is adjusted.

With d the plan distance of a control point from the farthest projection centre among the images that show it (from the
middle of the other control points, where no positions are known):

- one point lies off the block if d > 5 times the median of the others' (5 times the diagonal of the others). If the
  point with X and Y swapped, in another unit or without a zone number lies no farther than the others do, that is the
  error, and so is more than 100 km; else it is said, and the adjustment has to decide: objects at very different
  distances are legal.
- all of it lies off the block if a swap of X and Y, a unit (feet, km, mm) or a zone number before the easting brings
  the median of d below a tenth of itself and of the distance from the origin; or if the median of d exceeds 100 km,
  which no image sees: then zone or datum differ.

Only what is certain in this sense stops; nothing is changed here. Cf. EPSG guidance note 7-1 on axis order; the rows
70 to 78 of common input errors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float, Int
from aatri.ids import printable
from aatri.units import LENGTH_M

FAR = 5.0
"""So many times the others' distance is far."""

BETTER = 0.1
"""A change of all coordinates explains them if it reduces the distances to this share."""

MOST_SEEN_M = 100e3
"""No image shows points farther away than this."""

LEAST_FAR_M = 1.0
"""Nearer than this nothing is far: figures of a small object."""

FEET_M = 0.3048
ZONE_EASTING_M = 1e6
"""A zone number before the easting counts millions."""

SWAPPED = "with X and Y swapped"
FOR_ALL = {
    SWAPPED: "write `axes: [north, east, up]` (or the other way round) for this frame",
    "taken as feet": "convert to metres",
    "taken as metres that were divided by 0.3048": "convert to metres",
    "times 1000": "set units: {ground: km}",
    "divided by 1000": "set units: {ground: mm}",
    "without the zone number before the easting": "take the zone number off",
}
FOR_ONE = FOR_ALL | {
    SWAPPED: "swap the two coordinates of this point",
    "times 1000": "convert this point to metres",
    "divided by 1000": "convert this point to metres",
}
"""What to do about all control, and about one point."""


@dataclass(frozen=True)
class Misplaced:
    """Control that lies off the block.

    Attributes
    ----------
    rows : (k,) int
        Rows of the control points: one, or all.
    text : str
    remedy : str
    certain : bool
        What is wrong is known: not to be adjusted.
    """

    rows: Int
    text: str
    remedy: str
    certain: bool


def misplaced_control(
    ids: Sequence[str], xy_m: Float, position_xy_m: Float, ray_control: Int, ray_image: Int
) -> tuple[Misplaced, ...]:
    """Control points that cannot lie where they are given.

    Parameters
    ----------
    ids : (m,) str
    xy_m : (m, 2) float64, m
        Plan coordinates; NaN not given.
    position_xy_m : (n, 2) float64, m
        Projection centres, observed or approximate; NaN not known.
    ray_control, ray_image : (k,) int
        Which image shows which control point. Points that no image shows are not judged.

    Returns
    -------
    tuple of Misplaced
    """
    shown = np.zeros(len(xy_m), bool)
    shown[ray_control] = True
    rows = np.flatnonzero(shown & np.isfinite(xy_m).all(axis=1))
    if not len(rows):
        return ()
    located = np.isfinite(position_xy_m[ray_image]).all(axis=1) & np.isfinite(xy_m[ray_control]).all(axis=1)
    control, image = ray_control[located], ray_image[located]
    seen = np.intersect1d(rows, control)
    if len(seen):
        return _against_positions(ids, xy_m, position_xy_m, control, image, seen)
    return _against_each_other(ids, xy_m, rows)


def _against_positions(ids: Sequence[str], xy: Float, position: Float, control: Int, image: Int,
                       rows: Int) -> tuple[Misplaced, ...]:  # fmt: skip
    def distance(changed: Float) -> Float:
        """Distance of each of the rows from the farthest image that shows it."""
        found = np.zeros(len(xy))
        np.maximum.at(found, control, np.linalg.norm(changed[control] - position[image], axis=1))
        return found[rows]

    given = distance(xy)
    middle = float(np.median(given))
    extent = max(_diagonal(xy[rows]), _diagonal(position[np.unique(image)]))
    from_origin = float(np.linalg.norm(np.median(position[np.unique(image)], axis=0)))
    together = _all_of_it(xy, rows, middle, distance, extent, from_origin)
    if together is not None:
        return (together,)
    usual = np.array([_median_of_others(given, k) for k in range(len(rows))])
    changed = {name: distance(other) for name, other in _changes(xy).items()}
    return _single(ids, rows, given, changed, usual, from_origin)


def _all_of_it(xy: Float, rows: Int, middle: float, distance: Callable[[Float], Float], extent: float,
               from_origin: float) -> Misplaced | None:  # fmt: skip
    """What brings all control to the images, if they are apart by more than both extend.

    A change proves something only far from the origin: there it moves points, near it it gathers them.
    """
    found = {name: float(np.median(distance(changed))) for name, changed in _changes(xy).items()}
    best = min(found, key=lambda name: found[name])
    off = f"the control points lie {length(middle)} from the images that show them"
    apart = middle > max(FAR * extent, LEAST_FAR_M)
    if apart and found[best] < BETTER * min(middle, from_origin):
        return Misplaced(rows, f"{off}; {best} they lie {length(found[best])} from them", FOR_ALL[best], certain=True)
    if middle > MOST_SEEN_M:
        remedy = "check zone, datum and false easting of control and positions"
        if found[best] < BETTER * middle:
            off += f"; {best} they would lie {length(found[best])} from them"
            remedy = f"{FOR_ALL[best]} if that is so; else {remedy}"
        return Misplaced(rows, off, remedy, certain=True)
    return None


def _changes(xy: Float) -> dict[str, Float]:
    """The coordinates as they would be without each of the usual errors."""
    return {
        SWAPPED: xy[:, ::-1],
        "taken as feet": xy * FEET_M,
        "taken as metres that were divided by 0.3048": xy / FEET_M,
        "times 1000": xy * LENGTH_M["km"],
        "divided by 1000": xy * LENGTH_M["mm"],
        "without the zone number before the easting": np.column_stack([xy[:, 0] % ZONE_EASTING_M, xy[:, 1]]),
    }


def _single(ids: Sequence[str], rows: Int, given: Float, changed: Mapping[str, Float], usual: Float,
            from_origin: float) -> tuple[Misplaced, ...]:  # fmt: skip
    """Single points off the block; other units and zones prove something only far from the origin."""
    found = []
    for k in np.flatnonzero((given > FAR * usual) & (given > LEAST_FAR_M)).tolist():
        what = f"{printable(ids[rows[k]])} lies {length(float(given[k]))} from the block"
        near = {name: float(d[k]) for name, d in changed.items() if name == SWAPPED or from_origin > FAR * usual[k]}
        best = min(near, key=lambda name, near=near: near[name])  # type: ignore[misc]
        if near[best] <= 2 * usual[k] + LEAST_FAR_M:
            found.append(Misplaced(rows[k : k + 1], f"{what}; {best} it would lie inside", FOR_ONE[best], certain=True))
        else:
            what += f", the others {length(float(usual[k]))}"
            certain = bool(given[k] > MOST_SEEN_M > FAR * usual[k])
            found.append(Misplaced(rows[k : k + 1], what, "check its coordinates and its id", certain=certain))
    return tuple(found)


def _against_each_other(ids: Sequence[str], xy: Float, rows: Int) -> tuple[Misplaced, ...]:
    if len(rows) < 4:
        return ()  # three others span an area
    changes = _changes(xy)
    given, usual, from_origin = (np.zeros(len(rows)) for _ in range(3))
    changed = {name: np.zeros(len(rows)) for name in changes}
    for k in range(len(rows)):
        others = xy[np.delete(rows, k)]
        centre = np.median(others, axis=0)
        from_origin[k] = np.linalg.norm(centre)
        usual[k] = np.median(np.linalg.norm(others - centre, axis=1)) * 2
        given[k] = np.linalg.norm(xy[rows[k]] - centre)
        for name, other in changes.items():
            changed[name][k] = np.linalg.norm(other[rows[k]] - centre)
    return _single(ids, rows, given, changed, usual, float(np.median(from_origin)))


def _median_of_others(distance: Float, k: int) -> float:
    others = np.delete(distance, k)
    return float(np.median(others)) if len(others) else np.inf


def _diagonal(xy: Float) -> float:
    return float(np.linalg.norm(np.ptp(xy, axis=0)))


def length(metres: float) -> str:
    """A distance for a message."""
    value, unit = (metres / 1000, "km") if metres >= 1000 else (metres, "m")
    return f"{value:,.0f} {unit}" if value >= 100 else f"{value:.3g} {unit}"
