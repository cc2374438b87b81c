"""Candidate groups: what observations of a kind may have in common, unit by unit, as derivatives H of their residuals.

    positions       shift, shift and drift of a strip, a flight; shift and height of all;  lever arm of a camera
    attitudes       shift, shift and drift of a strip, a flight;  boresight of a camera
    image points    of a camera, or of what a strip has of it: c, principal point, radial distortion, affinity
                    (`groups.candidates`)
    of an image: affinity
    of a neighbourhood in an image: shift (`neighbourhoods`)
    distances       a common scale, dv/ds = d
    control         a common scale of the relief, dv/ds = mean Z - Z
    portable frame  a mark, of control with full covariances a point (`frame_marks`)

c, x0, y0 are added to those of the block; p, a and b correct the measured points: they are mm at r0, the corner of the
format. x and y are adjusted coordinates: measured ones have the errors of the residuals, and to make all coordinates
smaller would make these smaller too. With 10^6 image points and sigma_c / c of 10^-4 that is 100 sigma_c.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from aatri.adapters.limits import FEWEST_OF_UNIT
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.elimination.effects import Effects
from aatri.adjustment.records import whitened_residuals
from aatri.adjustment.unknowns import Ids
from aatri.arrays import Bool, Float, Int, Text, sums_of
from aatri.observations.attitudes import KIND as ATTITUDE
from aatri.observations.carried_vectors import BORESIGHT, LEVER_ARM
from aatri.observations.control import KIND as CONTROL
from aatri.observations.drift import group_times
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.poses import FILM, POINT, POSE
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bundle.block import LINE, STRIP, BundleInput, ImageGroups
from aatri.orientation.bundle.groups.candidates import (
    AFFINITY,
    ALL,
    IMAGE,
    CameraEffects,
    Candidates,
    Cause,
    UnitMembers,
)
from aatri.orientation.bundle.groups.frame_marks import gives_coordinates, marks_of_frames, points_of_sets
from aatri.orientation.bundle.groups.limits import MOST_IMAGES_TESTED, MOST_TYPICAL
from aatri.orientation.bundle.groups.neighbourhoods import moved_together
from aatri.orientation.bundle.parameter_estimates import parameter_names
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.strip_numbering import flown_lines

DISTANCE = "distance"

CAUSES = (
    Cause("principal distance", (0,)),
    Cause("principal point", (1, 2)),
    Cause("radial distortion", (3,)),
    Cause("affinity", (4, 5)),
)

OF_CALIBRATION = ((CAUSES[0], {"c"}), (CAUSES[1], {"x0", "y0"}))
"""Causes that parameters of a calibration stand for, and their names."""

AT_A_TIME = 100_000
"""Image points whose derivatives are made at once."""


def candidate_groups(block: BundleInput, result: BundleResult) -> Iterator[Candidates]:
    """What is to be tested of a block, kind by kind."""
    if block.images is None:
        return
    for place, adjusted in enumerate(result.observations):
        rows, o = np.flatnonzero(adjusted.used), adjusted.observed
        if o.kind == DISTANCE and o.components:
            yield from marks_of_frames(block, result, place, rows)
        if gives_coordinates(o):
            yield from points_of_sets(block, result.adjusted.state, place, rows)
        if not len(rows) or o.exact or o.components:
            continue
        groups = [group for group, _ in o.records.touches]
        if o.kind == POSITION and groups[0] == POSE:
            yield from _of_positions(block.images, result, place, adjusted, rows)
        elif o.kind == ATTITUDE and groups[:2] == [POSE, BORESIGHT]:
            yield from _of_attitudes(block.images, result, place, adjusted, rows)
        elif o.kind == IMAGE_POINT and block.rays is not None:
            v = whitened_residuals(o.records, result.adjusted.state, rows)
            image, residuals_mm = block.rays.image[rows], v / o.records.whitener[rows]
            corner_mm = _corner_mm(block.images, block.rays)[block.images.camera]
            H = CameraEffects(block.rays.xy_mm[rows] + residuals_mm, block.rays.c_mm[rows], corner_mm[image])
            images = _with_lines(block.images, block.image_ids, result.poses.position_m)
            units = _of_image_points(images, place, rows, image, H, _causes_of_cameras(block))
            yield from _with_rejected(units, images, block.rays, corner_mm, ~adjusted.used)
            yield from _of_images(block.image_ids, place, rows, image, H, v, o.records.whitener[rows])
            yield from moved_together(block.rays, block.image_ids, block.point_ids, place, rows, v)
        elif o.kind == DISTANCE and groups == [POINT, POINT] and len(rows) > FEWEST_OF_UNIT:
            a, b = (result.adjusted.state[POINT][ends[rows]] for _, ends in o.records.touches)
            yield _of_all(place, rows, np.linalg.norm(a - b, axis=1)[:, None, None], Cause("scale", (0,)))
        elif o.kind == CONTROL and groups == [POINT] and o.records.rows == 3:
            yield from _of_relief(result, place, adjusted, rows)


def _with_lines(images: ImageGroups, ids: Ids, position_m: Float) -> ImageGroups:
    """With the lines that were flown as strips where none is declared, called by their first and last image."""
    if (images.strip != "").any():
        return images
    strip = np.full(len(images.strip), "", dtype=object)
    for line in flown_lines(position_m, images.time_s, images.sequence, images.camera):
        strip[line] = f"{ids[line[0]]} to {ids[line[-1]]}"
    return replace(images, strip=strip.astype(np.str_), line=LINE)


def _of_all(place: int, rows: Int, H: Float, *causes: Cause) -> Candidates:
    return Candidates(place, ALL, np.array([ALL]), rows, np.zeros(len(rows), dtype=np.int64), H, causes)


def _of_positions(
    images: ImageGroups, result: BundleResult, place: int, adjusted: AdjustedObservations, rows: Int
) -> Iterator[Candidates]:
    image = adjusted.observed.records.touches[0][1][rows]
    yield from _in_time(images, place, rows, image, (ALL, "strip", "flight"))
    by_pose = adjusted.observed.records.evaluate(result.adjusted.state, rows)[1][0]
    R = result.adjusted.state[POSE].ground_from_image[image]
    cameras, H = images.cameras[images.camera], by_pose[:, :, :3] @ R
    yield from _units(place, "camera", cameras, image, rows, H, (Cause(LEVER_ARM, (0, 1, 2)),), True)


def _of_attitudes(
    images: ImageGroups, result: BundleResult, place: int, adjusted: AdjustedObservations, rows: Int
) -> Iterator[Candidates]:
    image = adjusted.observed.records.touches[0][1][rows]
    cameras = images.cameras[images.camera]
    by_boresight = adjusted.observed.records.evaluate(result.adjusted.state, rows)[1][1]
    fixed = not any(u.free.any() for u in adjusted.observed.unknowns if u.name == BORESIGHT)
    yield from _units(place, "camera", cameras, image, rows, by_boresight, (Cause("boresight", (0, 1, 2)),), fixed)
    yield from _in_time(images, place, rows, image, ("strip", "flight"))


def _in_time(images: ImageGroups, place: int, rows: Int, image: Int, pers: tuple[str, ...]) -> Iterator[Candidates]:
    """Shift, and shift and drift, of units of images."""
    names = {"strip": images.strip, "flight": images.flight, ALL: np.full(len(images.camera), ALL)}
    for per in pers:
        time = group_times(images.time_s[image], images.sequence[image], names[per][image])
        largest = float(np.abs(time).max(initial=0.0)) or 1.0
        H = np.concatenate(
            [np.broadcast_to(np.eye(3), (len(rows), 3, 3)), (time / largest)[:, None, None] * np.eye(3)], axis=2
        )
        causes: tuple[Cause, ...] = (Cause("shift", (0, 1, 2)),)
        if per == ALL:
            causes = (Cause("height", (2,)), *causes)
        elif time.any():
            causes = (*causes, Cause("drift", tuple(range(6))))
        yield from _units(place, per, names[per], image, rows, H, causes, True)


def _units(
    place: int,
    per: str,
    names: Text,
    image: Int,
    rows: Int,
    H: Effects,
    causes: tuple[Cause, ...],
    removable: bool = False,
) -> Iterator[Candidates]:
    """Candidates unit by unit, of units with enough observations; a single strip or flight is all there is.

    `names` are those of the units of the images, `image` that of each row.
    """
    ids, number = np.unique(names, return_inverse=True)
    number = number[image]
    count = np.bincount(number, minlength=len(ids))
    enough = (count >= FEWEST_OF_UNIT) & (ids != "")
    if not enough.any() or (per in (STRIP, LINE, "flight") and (count > 0).sum() < 2):
        return
    large, new = enough[number], np.cumsum(enough) - 1
    if not large.all():
        number, rows, H = number[large], rows[large], H[large]
    yield Candidates(place, per, ids[enough], rows, new[number], H, causes, removable)


def _causes_of_cameras(block: BundleInput) -> tuple[Cause, ...]:
    """What cameras may have in common: all if the block estimates none of it, else what it estimates with a weight."""
    estimated = [p for p in block.parameters if p.group != FILM and p.free.any()]
    if not estimated:
        return CAUSES
    free, weighted, measured = set[str](), set[str](), set[str]()
    for p, unit in [(rows, unit) for rows in estimated for unit in range(len(rows.ids))]:
        names = np.array(parameter_names(p, unit))
        with_weight = set(names[p.free[unit] & p.weighted[unit]].tolist())
        free |= set(names[p.free[unit] & ~p.weighted[unit]].tolist())
        weighted |= with_weight
        measured |= with_weight if p.calibrated else set()
    return tuple(
        replace(cause, loosens=not names & measured) for cause, names in OF_CALIBRATION if names <= weighted - free
    )


def _of_image_points(
    images: ImageGroups, place: int, rows: Int, image: Int, H: Effects, of_cameras: tuple[Cause, ...]
) -> Iterator[Candidates]:
    """Interior orientation of cameras, where the block carries none of its own, and of what strips have of them."""
    if of_cameras:
        yield from _units(place, "camera", images.cameras[images.camera], image, rows, H, of_cameras)
    strip = images.strip if of_cameras == CAUSES else strips_with_part_of_a_camera(images, image)
    of_strips = (*CAUSES, Cause("camera", tuple(range(6))))
    for units in _units(place, images.line, strip, image, rows, H, of_strips):
        estimated_of, seen = np.zeros((len(units.units), len(images.cameras)), dtype=bool), np.unique(image)
        unit = _unit_of(units, strip[seen])
        if of_cameras != CAUSES:
            estimated_of[unit[unit >= 0], images.camera[seen[unit >= 0]]] = True
        yield replace(units, typical=np.ones(len(units.units), dtype=bool), estimated_of=estimated_of)


def _unit_of(units: Candidates, names: Text) -> Int:
    """Which of the units have some names, -1 none."""
    unit = np.minimum(np.searchsorted(units.units, names), len(units.units) - 1)
    return np.where(units.units[unit] == names, unit, -1)


def _with_rejected(
    candidates: Iterator[Candidates], images: ImageGroups, rays: ImagePointRows, corner_mm: Float, rejected: Bool
) -> Iterator[Candidates]:
    """Candidates with the image points that are not in use: an earlier stage may have rejected them for the camera.

    Their H is at measured coordinates: of these nothing better is known.

    Parameters
    ----------
    corner_mm : (n_images,) float64, mm
        Half the diagonal of the format.
    rejected : (n_rays,) bool
    """
    rows = np.flatnonzero(rejected & np.isfinite(rays.xy_mm).all(axis=1))
    image = rays.image[rows]
    H = CameraEffects(rays.xy_mm[rows], rays.c_mm[rows], corner_mm[image])
    for units in candidates:
        names = images.cameras[images.camera[image]] if units.per == "camera" else images.strip[image]
        unit = _unit_of(units, names)
        of_units = unit >= 0
        yield replace(units, rejected=UnitMembers(rows[of_units], unit[of_units], H[of_units]))


def strips_with_part_of_a_camera(images: ImageGroups, image: Int) -> Text:
    """Strips of the images, empty where all that their cameras see is in that strip: it has what the camera carries.

    The same correction twice, at measured and at adjusted coordinates, differs by the residuals and would explain them.
    """
    seen = np.unique(image)
    strips = [np.unique(images.strip[seen[images.camera[seen] == k]]) for k in range(len(images.cameras))]
    shared = {str(name) for of_camera in strips if len(of_camera) > 1 for name in of_camera}
    return np.where(np.isin(images.strip, list(shared)), images.strip, "")


def _of_images(
    image_ids: Ids, place: int, rows: Int, image: Int, H: CameraEffects, v: Float, whitener: Float
) -> Iterator[Candidates]:
    """Affinity of single images, as film shrinks; c and principal point of one are those of its orientation.

    Tested are those with the largest gain were all unknowns held, g'(H'H)^-1 g, which the true one is not below, and
    some that are chosen evenly of all.
    """
    count = len(image_ids)
    N, g = np.zeros((count, 2, 2)), np.zeros((count, 2))
    for first in range(0, len(rows), AT_A_TIME):
        part = slice(first, first + AT_A_TIME)
        whitened = H[part][:, :, AFFINITY:] * whitener[part][:, :, None]
        N += sums_of(np.einsum("nmi,nmj->nij", whitened, whitened), image[part], count)
        g += sums_of(np.einsum("nmi,nm->ni", whitened, v[part]), image[part], count)
    bound = np.einsum("ni,nij,nj->n", g, np.linalg.pinv(N, hermitian=True), g)
    seen, names = np.flatnonzero(bound > 0), np.asarray(image_ids)
    typical = seen[np.unique(np.linspace(0, len(seen) - 1, min(MOST_TYPICAL, len(seen))).astype(int))]
    tested = np.isin(image, np.concatenate([np.argsort(-bound, kind="stable")[:MOST_IMAGES_TESTED], typical]))
    causes = (Cause("affinity", (0, 1)),)
    for units in _units(place, IMAGE, names, image[tested], rows[tested], H[tested][:, :, AFFINITY:], causes):
        yield replace(units, tests=len(seen), typical=np.isin(units.units, names[typical]))


def _corner_mm(images: ImageGroups, rays: ImagePointRows) -> Float:
    """Half the diagonal of the format of each camera; the largest radius that is measured where it is not known."""
    largest = np.full(len(images.cameras), 1e-9)
    radius = np.where(rays.active, np.linalg.norm(rays.xy_mm, axis=1), 0.0)
    np.maximum.at(largest, images.camera[rays.image], radius)
    return np.where(np.isfinite(images.corner_mm), images.corner_mm, largest)


def _of_relief(result: BundleResult, place: int, adjusted: AdjustedObservations, rows: Int) -> Iterator[Candidates]:
    records = adjusted.observed.records
    rows = rows[records.observed_components()[rows, 2]]
    if len(rows) < 2 * FEWEST_OF_UNIT:  # three heights tilt and shift the block, and some must be left to contradict
        return
    state = result.adjusted.state
    height = state[POINT][records.touches[0][1][rows], 2] - records.evaluate(state, rows)[0][:, 2]
    H = np.zeros((len(rows), 3, 1))
    H[:, 2, 0] = height.mean() - height
    yield _of_all(place, rows, H, Cause("relief", (0,)))
