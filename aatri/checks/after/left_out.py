"""What takes no part in an adjustment.

Seen: images, points and observations that are in the block and not in the result; distances in another unit.
Test: none for most; they are named. Image points go with their image or point. Images that show `RESECTING` adjusted
points and more, which do not lie along a line, have no orientation in which these fit. Control, or positions, of which
all are left out are off by the same where their n differences lie as near to each other as chance has it once in a
thousand blocks: (spread / size)^(n - 1), for each coordinate of both kinds. Rejected distances are in another unit
where they are the length in the block times the factor of a unit (`OTHER_UNITS`), to `SAME_UNIT`.
"""

from collections.abc import Container

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.statistics.limits import ALARM
from aatri.arrays import Bool, Float
from aatri.checks.finding import Finding
from aatri.checks.limits import RESECTING, RESECTING_ACROSS, SAME_UNIT
from aatri.observations.control import KIND as CONTROL
from aatri.observations.geodetic.distances import KIND as DISTANCE
from aatri.observations.poses import POINT, POSE, position
from aatri.observations.positions import KIND as POSITION
from aatri.observations.relative.differences import DISTANCE as RELATIVE
from aatri.orientation.bundle.block import BundleInput, touched_points
from aatri.orientation.bundle.result import BundleResult
from aatri.units import FOOT_M

UNIT = "check both against the ground; convert those that are not in metres"
OTHER_UNITS = {FOOT_M: "feet", 1 / FOOT_M: "feet", 1000.0: "mm", 1e-3: "mm", 100.0: "cm", 0.01: "cm"}
OTHER_IMAGE = "check the numbers of their points, their camera, and whether the measurements are of another image"


def left_out(inputs: BundleInput, result: BundleResult) -> list[Finding]:
    """Images, points and observations that do not take part, by name.

    Observations of points that nothing ties to the block are only noted, and images where no image points are adjusted.
    """
    findings = []
    set_aside = result.set_aside
    images = np.asarray(inputs.image_ids)[~result.image_adjusted & ~set_aside.get(POSE, np.False_)]
    tied = touched_points(inputs)
    points = np.asarray(inputs.point_ids)[tied & ~set_aside.get(POINT, np.False_) & ~result.point_adjusted]
    unfit = np.isin(images, np.asarray(inputs.image_ids)[_with_points_enough(inputs, result)])
    for ids, total, what, reason, remedy in (
        (points, len(inputs.point_ids), "points", "too few usable rays", ""),
        (images[~unfit], len(inputs.image_ids), "images", "no start or too few points", ""),
        (images[unfit], len(inputs.image_ids), "images", "their points fit no orientation", OTHER_IMAGE),
    ):
        if len(ids) and (what == "points" or inputs.rays is not None):
            text = f"left out, {reason} ({len(ids)} of {total} {what})"
            findings.append(Finding("left_out", "warning", text, remedy, ids=tuple(ids.tolist())))
    if inputs.rays is None and len(images):
        text = f"no image points are adjusted: {len(images)} of {len(inputs.image_ids)} images take no part"
        findings.append(Finding("left_out", "note", text))
    n_rays = -1 if inputs.rays is None else len(inputs.rays.image)
    for o in result.observations:
        findings += _unused(o, tied, n_rays)
    return [*findings, *_idle(result)]


def left_out_alike(result: BundleResult, explained: Container[str] = ()) -> list[Finding]:
    """Control or positions that are all left out, and are off by the same: which of both is right nobody knows.

    Not kinds that are `explained` by another cause.
    """
    findings = []
    for kind, name in ((CONTROL, "control points"), (POSITION, "positions")):
        if kind in explained:
            continue
        of_kind = [o for o in result.observations if o.observed.kind == kind]
        single = [o for o in of_kind if o.observed.set_rows is None and o.observed.records.rows == 3]
        if not single or any(o.used.any() for o in of_kind):
            continue
        v = np.concatenate([_differences(o, result) for o in single])
        count, alike = np.isfinite(v).sum(axis=0), np.zeros(3, dtype=bool)
        shift = np.array([np.median(x[np.isfinite(x)]) if np.isfinite(x).any() else np.nan for x in v.T])
        for k in np.flatnonzero((count > 1) & (np.abs(shift) > 0)):
            spread = np.nanmax(np.abs(v[:, k] - shift[k]))
            alike[k] = (spread / abs(shift[k])) ** (count[k] - 1) < ALARM / 6
        if alike.any():
            values = ", ".join(f"{x:.2f}" for x in -shift)
            text = f"all {len(v)} {name} are left out, off by the same, {values} m in X, Y, Z: control and positions "
            text += "count from different surfaces, or are in other frames"
            remedy = "declare `vertical` of the frames, or `undulation`, or leave the constant open: "
            remedy += "positions: {drift: shift, per: block}"
            findings.append(Finding("left_out", "warning", text, remedy, contradicts=True))
    return findings


def lengths_in_other_units(result: BundleResult) -> list[Finding]:
    """Rejected distances that fit in another unit; of which it is, theirs or the control's, nothing tells."""
    state, findings = result.adjusted.state, list[Finding]()
    for adjusted in result.observations:
        o = adjusted.observed
        rows = adjusted.rows[~adjusted.used[adjusted.rows]]
        if (
            o.kind not in (DISTANCE, RELATIVE)
            or not len(rows)
            or not {g for g, _ in o.records.touches} <= {POINT, POSE}
        ):
            continue
        start, end = (position(state, group)[block[rows]] for group, block in o.records.touches)
        length_m = np.linalg.norm(end - start, axis=1)
        with np.errstate(invalid="ignore"):  # ends that coincide have no direction, and no derivatives
            value_m = length_m - o.records.evaluate(state, rows)[0][:, 0]
        for factor, unit in OTHER_UNITS.items():
            fitting = rows[np.abs(value_m - factor * length_m) < SAME_UNIT * factor * length_m]
            if len(fitting):
                text = f"rejected distances are {factor:.4g} times the length in the block: distances, or control and "
                text += f"positions, are in another unit ({unit})"
                ids = tuple(o.label(row) for row in fitting.tolist())
                findings.append(Finding("left_out", "warning", text, UNIT, ids=ids, where=o.kind))
    return findings


def _differences(o: AdjustedObservations, result: BundleResult) -> Float:
    """Computed minus given, NaN where nothing is given, (k, 3)."""
    is_given = o.observed.records.observed_components()[o.rows]
    return np.where(is_given, o.residuals(result.adjusted.state), np.nan)


def _with_points_enough(inputs: BundleInput, result: BundleResult) -> Bool:
    """Images left out that adjusted points would orient, (n_images,): enough of them, and not along a line."""
    enough = np.zeros(len(inputs.image_ids), dtype=bool)
    if inputs.rays is None:
        return enough
    rays = inputs.rays
    rows = np.flatnonzero(rays.active & result.point_adjusted[rays.point] & ~result.image_adjusted[rays.image])
    rows = rows[np.argsort(rays.image[rows], kind="stable")]
    for of_image in np.split(rows, np.flatnonzero(np.diff(rays.image[rows])) + 1):
        if len(of_image) >= RESECTING:
            xy_mm = rays.xy_mm[of_image]
            along, across = np.linalg.svd(xy_mm - xy_mm.mean(axis=0), compute_uv=False)
            enough[rays.image[of_image[0]]] = across >= RESECTING_ACROSS * along
    return enough


def _idle(result: BundleResult) -> list[Finding]:
    """Cameras, drift groups ... that are to be estimated, and that no observation in use touches."""
    findings, adjusted = [], {u.name: u.free for u in result.adjusted.problem.unknowns}
    for u in (u for o in result.observations for u in o.observed.unknowns if not u.joins):
        idle = u.free.any(axis=1) & ~adjusted[u.name].any(axis=1)
        if idle.any() and not (u.free & ~adjusted[u.name])[~idle].any():
            ids = tuple(np.asarray(u.ids, dtype=np.str_)[idle].tolist())
            text = f"not estimated, nothing in use observes them ({u.name})"
            findings.append(Finding("left_out", "warning", text, ids=ids))
    return findings


def _unused(adjusted: AdjustedObservations, tied: Bool, n_rays: int) -> list[Finding]:
    """Observations in use on input that touch nothing that takes part; image points are told by image and point."""
    o = adjusted.observed
    unused = o.records.active.copy()
    unused[adjusted.rows] = False
    rows = np.flatnonzero(unused)
    if not len(rows) or o.components or len(o) == n_rays:
        return []
    image, point = o.names(rows)
    ids = tuple(a or b for a, b in zip(image.tolist(), point.tolist()))
    of_one_point = len(o.records.touches) == 1 and o.records.touches[0][0] == POINT
    if of_one_point and not tied[o.records.touches[0][1][rows]].any():
        return [Finding("left_out", "note", f"{o.kind}: nothing else is measured at {len(rows)} of {len(o)}", ids=ids)]
    text = f"{o.kind}: {len(rows)} of {len(o)} are not used, what they touch is left out"
    return [Finding("left_out", "warning", text, ids=ids)]
