"""What a stage has rejected as gross errors, by name and size; what of it fits under another's number.

Seen: observations that the stage leaves out; control that never reached it; two of one kind with each other's number.
Test: that of the stage; numbers are exchanged where each of two rejected observations lies where the other is given, to
a twentieth of their distance (`adjustment.statistics.exchanged`). Two objects have one number where three rays and more
that are left out meet in another place than the rays used, or three others: nearer than `MEETING` times their standard
deviations and what rays in use miss, and all off the first place by `APART` times that. Three with errors of 50
standard deviations of their own meet so once in a thousand, by the share of their field that lies so near a place.
"""

import itertools

import numpy as np

from aatri.adjustment.statistics.exchanged import exchanged_pairs
from aatri.adjustment.unknowns import Ids
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import ProposedNumbers, Solution
from aatri.artifacts.suspects import Suspects
from aatri.checks.finding import Finding
from aatri.checks.limits import APART, FEWEST_MEETING, MEETING, MOST_IMAGES, MOST_MEETING, SMALL_TEST
from aatri.geometry.intersection import intersect_rays
from aatri.ids import several, shown
from aatri.notes import EXCHANGED, REJECTED, Note
from aatri.observations.control import control_of
from aatri.observations.image_point_rows import ImagePointRows
from aatri.orientation.bundle.result import BundleResult
from aatri.units import length


def rejections(suspects: Suspects, stage: str) -> list[Finding]:
    """A warning for each kind of observation of which a stage rejected some, the largest first.

    Image points of an initial orientation are a note: the bundle tests them again.

    Parameters
    ----------
    stage : str
        Role of the stage.
    """
    of_stage, findings = suspects.take(suspects.stage == stage), []
    open_ = np.unique(of_stage.point[of_stage.verdict == "undecidable"])
    if len(open_):
        text = f"not decided: {several(len(open_), 'point')} whose observations contradict each other"
        findings.append(Finding("rejections", "note", text, ids=tuple(open_.tolist())))
    for kind in np.unique(of_stage.kind[of_stage.verdict == "rejected"]).tolist():
        rows = np.flatnonzero((of_stage.kind == kind) & (of_stage.verdict == "rejected"))
        rows = rows[np.argsort(-np.nan_to_num(np.abs(of_stage.test[rows])), kind="stable")]
        again = stage == "initial_orientation" and kind == "image_point"
        findings.append(
            Finding(
                "rejections",
                "note" if again else "warning",
                f"{len(rows)} {REJECTED}",
                where=kind,
                ids=tuple(_named(of_stage, int(row)) for row in rows),
                rows={kind: of_stage.row[rows]},
                statistic=float(np.nanmax(np.abs(of_stage.test[rows]), initial=0.0)),
            )
        )
    return findings


def _named(suspects: Suspects, row: int) -> str:
    name = "/".join(part for part in (str(suspects.image[row]), str(suspects.point[row])) if part)
    size, test = float(abs(suspects.size[row])), float(abs(suspects.test[row]))
    if not np.isfinite(size) or not np.isfinite(test):
        return name
    if suspects.stage[row] == "relative_orientation" and test < SMALL_TEST:
        return f"{name} (its rays meet behind the cameras)"
    return f"{name} ({size:.3g} {suspects.unit[row]}, {test:.3g} sigma)"


def exchanged_numbers(block: Block, solution: Solution, before: Suspects) -> list[Finding]:
    """Pairs of rejected control points or positions that fit with their numbers exchanged.

    Those that an earlier stage has rejected both are its to tell.

    Parameters
    ----------
    block : Block
        In the frame of the adjustment.
    solution : Solution
        In the same frame.
    before : Suspects
        Of the stages before.
    """
    control, r = control_of(block), solution.residuals
    coordinates = {"control": np.full((len(block.ground_points), 3), np.nan), "position": block.exterior.position_m}
    coordinates["control"][control.row] = np.where(control.given, control.xyz_m, np.nan)
    findings = []
    for kind, given_m in coordinates.items():
        rows = np.flatnonzero((r.kind == kind) & (r.row >= 0) & ~r.active)
        if len(rows) < 2:
            continue
        X = given_m[r.row[rows]]
        pairs = exchanged_pairs(X + r.residual[rows], X, range(len(rows)))
        names = np.where(r.point[rows] != "", r.point[rows], r.image[rows])
        told_before = before.row[(before.kind == kind) & (before.verdict == "rejected")]
        for pair in pairs:
            both = [pair.first, pair.second]
            if np.isin(r.row[rows[both]], told_before).all():
                continue
            text = "two that are rejected fit with their numbers exchanged"
            findings.append(
                Finding(
                    "rejections",
                    "warning",
                    text,
                    "exchange the two ids",
                    where=kind,
                    ids=tuple(names[both].tolist()),
                    rows={kind: r.row[rows[both]]},
                    statistic=pair.exchanged_m / pair.as_given_m,
                )
            )
    return findings


def two_objects(
    rays: ImagePointRows | None, image_ids: Ids, point_ids: Ids, result: BundleResult, scale: float = 1.0
) -> list[Finding]:
    """Points whose rays are those of two objects: what is left out meets in another place.

    Parameters
    ----------
    scale : float
        Of the standard deviations of image points.
    """
    if rays is None:
        return []
    usable, used = rays.active & result.image_adjusted[rays.image], result.ray_used
    left_out = np.bincount(rays.point[usable & ~used], minlength=len(result.xyz_m))
    rows = np.flatnonzero(usable & (left_out[rays.point] >= FEWEST_MEETING))
    if not len(rows):
        return []
    usual = _miss(rays, result, np.flatnonzero(used), result.xyz_m[rays.point[used]])
    allowed = MEETING * max(scale, float(np.median(usual)) if len(usual) else 0.0)
    names, point_rows = list[str](), rows[np.argsort(rays.point[rows], kind="stable")]
    for of_point in np.split(point_rows, np.flatnonzero(np.diff(rays.point[point_rows])) + 1):
        point, in_use = int(rays.point[of_point[0]]), of_point[used[of_point]]
        adjusted = result.xyz_m[point], in_use
        place, first = adjusted if len(in_use) > 1 else _meeting(rays, result, of_point, allowed)
        if len(first) < FEWEST_MEETING and not len(in_use) > 1:
            continue
        other, second = _meeting(rays, result, np.setdiff1d(of_point, first), allowed)
        apart = _miss(rays, result, second, np.repeat(place[None], len(second), axis=0))
        if len(second) >= FEWEST_MEETING and apart.min() > APART * allowed:  # else they are rays of it, badly measured
            images = shown(np.asarray(image_ids)[rays.image[second]].tolist(), MOST_IMAGES)
            names.append(f"{point_ids[point]} ({length(float(np.linalg.norm(other - place)))} off in {images})")
    if not names:
        return []
    text = "one number for two points: the rays left out meet in another place"
    return [Finding("rejections", "warning", text, "give the other point a number of its own there", ids=tuple(names))]


def _meeting(rays: ImagePointRows, result: BundleResult, rows: Int, allowed: float) -> tuple[Float, Int]:
    """Where most of the rays of a point meet, by pairs of them, and which do."""
    best, place = rows[:0], np.full(3, np.nan)
    for pair in itertools.combinations(rows[:MOST_MEETING].tolist(), 2):
        two = np.array(pair)
        X = intersect_rays(
            result.poses.position_m[rays.image[two]], rays.directions(result.poses, two), np.zeros(2, dtype=int), 1
        )
        meets = rows[_miss(rays, result, rows, np.repeat(X, len(rows), axis=0)) <= allowed]
        if len(meets) > len(best):
            best, place = meets, X[0]
    return place, best


def _miss(rays: ImagePointRows, result: BundleResult, rows: Int, xyz_m: Float) -> Float:
    """Angles between rays and where places are seen, in standard deviations of an image point, (k,)."""
    u, away = rays.directions(result.poses, rows), xyz_m - result.poses.position_m[rays.image[rows]]
    angle = np.arctan2(np.linalg.norm(np.cross(u, away), axis=1), np.einsum("ni,ni->n", u, away))
    sigma = np.linalg.norm(rays.sigma_mm[rows], axis=1) / np.sqrt(2.0) / np.linalg.norm(u, axis=1)
    return np.asarray(np.nan_to_num(angle / sigma, nan=np.inf))


def exchanged_proposals(proposed: ProposedNumbers, before: Suspects) -> list[Note]:
    """Pairs that fit with their numbers exchanged; of control and positions those that no earlier stage has told.

    Parameters
    ----------
    proposed : ProposedNumbers
        Exchanged ones in pairs, one after the other.
    before : Suspects
        Of the stages before, which tell of what they have rejected both (`exchanged_numbers`).
    """
    notes, names = [], np.where(proposed.image == "", proposed.point, proposed.image)
    of_rays = (proposed.image != "") & (proposed.point != "")
    names = np.where(of_rays, np.char.add(np.char.add(proposed.image, "/"), proposed.point), names)
    for pair in np.flatnonzero(proposed.exchanged).reshape(-1, 2):
        kind = str(proposed.kind[pair[0]])
        told_before = before.row[(before.kind == kind) & (before.verdict == "rejected")]
        if of_rays[pair].any() or not np.isin(proposed.row[pair], told_before).all():
            ids = tuple(sorted(names[pair].tolist()))
            notes.append(Note("warning", f"{kind}: {EXCHANGED}", ids))
    return notes


def control_left_behind(block: Block, solution: Solution, before: Suspects) -> list[Finding]:
    """Control points that oriented images show, and that take no part: why.

    Parameters
    ----------
    before : Suspects
        Of the stages before.
    """
    control, measured = control_of(block), block.image_points
    used = measured.active & block.images.active[measured.image]
    shows = np.bincount(measured.point[used], minlength=len(block.points))
    used &= solution.images.oriented[measured.image]  # images that are not oriented are told as a whole
    is_seen = np.bincount(measured.point[used], minlength=len(block.points)) > 0
    taken = np.isin(control.row, solution.residuals.row[solution.residuals.kind == "control"])
    rejected = set(before.point[(before.verdict == "rejected") & (before.point != "")].tolist())
    names = []
    for k in control.point[~taken & is_seen[control.point]].tolist():
        name, count = str(block.points.id[k]), int(shows[k])
        reason = (
            f"rejected before, {several(count, 'image', 'shows', 'show')} it"
            if name in rejected
            else f"in no model, {several(count, 'image', 'shows', 'show')} it"
        )
        names.append(f"{name} ({'one image shows it' if count == 1 else reason})")
    if not names:
        return []
    text = "control that takes no part here, for relative orientation gave no model point of it"
    remedy = "measure it in a second image of a model"
    return [Finding("rejections", "warning", text, remedy, ids=tuple(names))]
