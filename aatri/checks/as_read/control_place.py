"""Control that lies off the block: held against the positions of the images, or against the other control.

With d the plan distance of a control point from the farthest projection centre among the images that show it (from the
middle of the other control points, where no positions are known):

Seen: another unit, axes, zone or datum of all control, or of one point.
Test: one point lies off if even the nearest of its images is farther than 5 times the median of the others' d: a wrong
position is far from all that its image shows, and says nothing of the control. It is an error if one of the usual
changes brings it to where the others are, or if it is more than 100 km off, else a warning: objects at very different
distances are legal.
All of it lies off if a change brings the median of d below a tenth of itself and of the distance from the origin, and
d is beyond what both extend, or the change is an exchange of X and Y and leaves less than a tenth of that; or if it
exceeds 100 km, which no image sees.

Cf. EPSG guidance note 7-1 on axis order; the rows 70 to 78 of common input errors.
"""

from collections.abc import Callable, Sequence

import numpy as np

from aatri.arrays import Float, Int, finite_rows
from aatri.artifacts.block import Block
from aatri.checks.as_read.changes import CHANGES, Change
from aatri.checks.finding import Finding, Level
from aatri.checks.limits import EXPLAINED_DISTANCE, FAR_CONTROL, LEAST_FAR_M, MOST_SEEN_M
from aatri.ids import printable
from aatri.observations.control import control_of
from aatri.units import length

IN_PLAN = tuple(change for change in CHANGES if change.in_plan)


def control_off_the_block(block: Block) -> list[Finding]:
    """Control that lies off the block; positions are those of exterior.csv, observed or approximate."""
    control, points = control_of(block), block.image_points
    number = np.full(len(block.points), -1)
    number[control.point] = np.arange(len(control.point))
    rows = points.active & block.images.active[points.image] & (number[points.point] >= 0)
    position = block.positions_m
    ids = block.points.id[control.point].tolist()
    xyz_m = np.where(control.given, control.xyz_m, np.nan)
    seen, image = number[points.point[rows]], points.image[rows]
    places = [block.read_at(block.ground_points, int(row)) for row in control.row]
    return misplaced_control(ids, xyz_m, position, seen, image, places)


def misplaced_control(
    ids: Sequence[str], xyz_m: Float, position_m: Float, ray_control: Int, ray_image: Int, places: Sequence[str]
) -> list[Finding]:
    """Control points that cannot lie where they are given.

    Parameters
    ----------
    ids : (m,) str
    xyz_m : (m, 3) float64, m
        NaN not given.
    position_m : (n, 3) float64, m
        Projection centres, observed or approximate; NaN not known.
    ray_control, ray_image : (k,) int
        Which image shows which control point. Points that no image shows are not judged.
    places : (m,) str
        `file:line` of each.
    """
    plan, of_image = finite_rows(xyz_m[:, :2]), finite_rows(position_m[:, :2])
    rows = np.unique(ray_control[plan[ray_control]])
    located = of_image[ray_image] & plan[ray_control]
    control, image = ray_control[located], ray_image[located]
    if not len(control):
        return _against_each_other(ids, xyz_m, rows, places)
    rows = np.unique(control)

    def distances_to_images(changed: Float, extreme: np.ufunc = np.maximum) -> Float:
        """Distance of each of the rows from the farthest (or nearest) image that shows it."""
        off = np.full(len(xyz_m), 0.0 if extreme is np.maximum else np.inf)
        extreme.at(off, control, np.linalg.norm(changed[control, :2] - position_m[image, :2], axis=1))
        return np.asarray(off[rows])

    def nearest(changed: Float) -> Float:
        return distances_to_images(changed, np.minimum)

    seen_from = position_m[np.unique(image), :2]
    extent = max(float(np.linalg.norm(np.ptp(xy, axis=0))) for xy in (xyz_m[rows, :2], seen_from))
    from_origin = float(np.linalg.norm(np.median(seen_from, axis=0)))
    together = _all_of_it(xyz_m, distances_to_images, extent, from_origin, [places[row] for row in rows])
    if together is not None:
        return [together]
    farthest = distances_to_images(xyz_m)
    usual = np.array([np.median(np.delete(farthest, k)) if len(farthest) > 1 else np.inf for k in range(len(farthest))])
    changed = [nearest(change.apply(xyz_m)) for change in IN_PLAN]
    return _single(ids, rows, nearest(xyz_m), changed, usual, from_origin, places)


def _all_of_it(
    xyz: Float, distance: Callable[[Float], Float], extent: float, from_origin: float, places: Sequence[str]
) -> Finding | None:
    """What brings all control to the images, if they are apart by more than both extend.

    A change proves something only far from the origin: there it moves points, near it it gathers them. An exchange of X
    and Y gathers none: where it brings two and more to within a tenth of the extent from their images, it is so.
    """
    middle = float(np.median(distance(xyz)))
    left = [float(np.median(distance(change.apply(xyz)))) for change in IN_PLAN]
    best, least = IN_PLAN[int(np.argmin(left))], min(left)
    text = f"the control points lie {length(middle)} from the images that show them"
    is_exchange = best.moves_near and len(places) > 1 and least < EXPLAINED_DISTANCE * extent
    apart = middle > max(0.0 if is_exchange else FAR_CONTROL * extent, LEAST_FAR_M)
    if apart and least < EXPLAINED_DISTANCE * min(middle, from_origin):
        text += f"; {best.text} they lie {length(least)} from them"
        return Finding("control_place", "error", text, best.of_all, where=places[0])
    if middle <= MOST_SEEN_M:
        return None
    remedy = "check zone, datum and false easting of control and positions"
    if least < EXPLAINED_DISTANCE * middle:
        text += f"; {best.text} they would lie {length(least)} from them"
        remedy = f"{best.of_all} if that is so; else {remedy}"
    return Finding("control_place", "error", text, remedy, where=places[0])


def _single(
    ids: Sequence[str],
    rows: Int,
    distances: Float,
    changed: Sequence[Float],
    usual: Float,
    from_origin: float,
    places: Sequence[str],
) -> list[Finding]:
    """Single points off the block; other units and zones prove something only far from the origin."""
    findings = []
    for k in np.flatnonzero((distances > FAR_CONTROL * usual) & (distances > LEAST_FAR_M)).tolist():
        text = f"{printable(ids[rows[k]])} lies {length(float(distances[k]))} from the block"
        far_away = from_origin > FAR_CONTROL * usual[k]
        near: list[tuple[float, Change]] = [
            (float(d[k]), change) for change, d in zip(IN_PLAN, changed) if change.moves_near or far_away
        ]
        least, best = min(near, key=lambda pair: pair[0])
        level: Level = "error"
        if least <= min(
            2 * usual[k] + LEAST_FAR_M, 0.5 * distances[k]
        ):  # a change that changes nothing explains nothing
            text, remedy = f"{text}; {best.text} it would lie inside", best.of_one
        else:
            text, remedy = f"{text}, the others {length(float(usual[k]))}", "check its coordinates and its id"
            level = "error" if distances[k] > MOST_SEEN_M > FAR_CONTROL * usual[k] else "warning"
        findings.append(Finding("control_place", level, text, remedy, where=places[rows[k]]))
    return findings


def _against_each_other(ids: Sequence[str], xyz: Float, rows: Int, places: Sequence[str]) -> list[Finding]:
    if len(rows) < 3:
        return []
    changed = [change.apply(xyz)[rows, :2] for change in IN_PLAN]
    distances, usual, from_origin = (np.zeros(len(rows)) for _ in range(3))
    off = np.zeros((len(changed), len(rows)))
    for k in range(len(rows)):
        others = xyz[np.delete(rows, k), :2]
        centre = np.median(others, axis=0)
        from_origin[k] = np.linalg.norm(centre)
        off_centre = np.sort(np.linalg.norm(others - centre, axis=1))
        usual[k] = np.median(off_centre[1:]) * 2  # without the first: of few points it is the centre itself
        distances[k] = np.linalg.norm(xyz[rows[k], :2] - centre)
        off[:, k] = [np.linalg.norm(xy[k] - centre) for xy in changed]
    findings = _single(ids, rows, distances, list(off), usual, float(np.median(from_origin)), places)
    # two others span no area: where they are near to each other the third may be far
    return findings if len(rows) > 3 else [finding for finding in findings if finding.level == "error"]
