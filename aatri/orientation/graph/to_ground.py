"""Free components to the ground by all that is observed of it."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.arrays import Bool, finite_rows
from aatri.codes import CONTROL as CONTROL_CODE
from aatri.codes import OBSERVED_VALUE
from aatri.errors import AatriError, ConvergenceError, GeometryError
from aatri.geometry.similarity import IDENTITY, compose
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.attitudes import KIND as ATTITUDE
from aatri.observations.control import control_of
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.observed import Observed
from aatri.orientation.bodies.absolute import OrientationSettings, OrientedBody, orient_body
from aatri.orientation.bodies.datum_analysis import OpenDatumError
from aatri.orientation.bodies.datum_start import Observe, typical_distance
from aatri.orientation.bodies.ground_fit import height_notes
from aatri.orientation.bodies.ground_observed import (
    BEGUN_LEVEL,
    DISTANCES,
    GroundObserved,
    by_time_offsets,
    everything,
    oriented_by,
    placed,
    with_level_images,
)
from aatri.orientation.bodies.limits import HARDLY_DETERMINED, MISFIT_OF_RIGHT, UPWARDS
from aatri.orientation.bodies.one_left_out import oriented_by_the_others
from aatri.orientation.bodies.wrong_control import MirroredError
from aatri.orientation.graph.component import ImageComponent, first_base_one
from aatri.orientation.graph.component_bodies import body_of, oriented_at_datum_points, precision
from aatri.orientation.graph.ground_tests import (
    attitude_notes,
    contradiction_note,
    contradicts,
    deformation_notes,
    fits_as_it_bends,
    two_that_differ,
    with_uncertain_distances,
    without_one,
)
from aatri.orientation.graph.limits import FEWEST_TO_JOIN, OPEN_MOTION
from aatri.orientation.graph.neighbouring_components import OnGround, by_neighbours, placed_by_attitudes, together

if TYPE_CHECKING:
    from aatri.artifacts.block import Block


IMAGES_ALONE = (
    "or orient the images to each other alone: here `use_positions: false`, in the bundle `datum: free` with "
    "`positions: {use: false}`"
)
NOTHING_PLACES = "no control and no observed positions: the datum is free"
BY_DATUM_POINTS = "the datum points place it, to begin a bundle with `datum: free` and `datum_over: marked`"
Left = tuple[ImageComponent, str, AatriError, str]
"""A component that is not on the ground, what messages call it, why, and why what it shares does not place it."""


def to_ground(
    ground: GroundObserved, components: Sequence[ImageComponent], rays: ImagePointRows, limit: float
) -> tuple[list[OnGround], list[Note]]:
    """Every component by one similarity; where nothing observed places any, the first by datum points, or else free.

    Parameters
    ----------
    limit : float
        Test statistic of what is wrong.

    Raises
    ------
    GeometryError
        If there is control or there are positions, and they orient no component, or the largest is mirrored.
    """
    block, settings = ground.block, OrientationSettings(limit, stiff=True)
    done, notes, failed = list[OnGround](), list[Note](), list[tuple[ImageComponent, str, AatriError]]()
    if not any(placed(ground.of(body_of(c, rays), everything, drift=False)(IDENTITY)) for c in components):
        by_datum = _at_datum_points(ground, components[0], rays, settings, "the block")
        if isinstance(by_datum, str):
            part, notes = _free(ground, components[0], rays, replace(settings, weakest=OPEN_MOTION, free=True))
            notes += [Note("warning", by_datum)] if by_datum else []
            return [part], [*notes, *(_apart(block, c.images, "no datum of their own") for c in components[1:])]
        done, notes = [by_datum], [Note("note", f"{BY_DATUM_POINTS}; without them {NOTHING_PLACES}")]
    for number, component in enumerate(components[len(done) :], 1 + len(done)):
        what = f"component {number} ({several(int(component.images.sum()), 'image')})"
        try:
            part, of_part = _oriented(ground, component, rays, what, settings)
        except (ConvergenceError, GeometryError) as error:
            if isinstance(error, MirroredError) and number == 1:
                raise  # the others are mirrored too, and few observations may hide it
            failed.append((component, what, error))
            continue
        done.append(part)
        notes += of_part
    left, of_shared = _by_what_they_share(ground, failed, rays, done, settings)
    notes += of_shared
    turned, of_attitudes = placed_by_attitudes(ground, rays, done, [failure for _, _, failure, _ in left])
    notes += of_attitudes
    for part in turned:
        done.append(part)
        failed = [one[:3] for one in left if not part.component.images[one[0].images].all()]
        left, of_shared = _by_what_they_share(ground, failed, rays, done, settings)
        notes += of_shared
    for component, what, failure, by_shared in left:
        part_or_none, of_part = _otherwise(ground, component, rays, done, what, settings, failure, by_shared)
        notes += of_part
        done += [] if part_or_none is None else [part_or_none]
    if not done:
        raise _nowhere(ground, failed[0][1], failed[0][2], len(components))
    return done, notes


def _nowhere(ground: GroundObserved, what: str, reason: AatriError, components: int) -> AatriError:
    """The error of a block that nothing places; where it has positions alone its images may still be oriented."""
    text = (
        reason.what if reason.what.startswith(what) else f"{what}: control and positions do not place it: {reason.what}"
    )
    remedy = reason.remedy
    if components > 1:
        text += f"; the images stay in {components} components"
        join = f"measure points in three images or more: {FEWEST_TO_JOIN} common points join two components"
        remedy = "; ".join(filter(None, [join, remedy]))
    error = ConvergenceError if isinstance(reason, ConvergenceError) else GeometryError  # its narrower classes say more
    positions = ground.use_positions and (ground.block.exterior.position_use == OBSERVED_VALUE).any()
    if not positions or np.isin(ground.block.ground_points.role, CONTROL_CODE).any():
        return error(text, remedy=remedy)
    return error(text, remedy="; ".join(filter(None, [remedy, IMAGES_ALONE])))


def _otherwise(
    ground: GroundObserved,
    component: ImageComponent,
    rays: ImagePointRows,
    done: Sequence[OnGround],
    what: str,
    settings: OrientationSettings,
    failure: AatriError,
    by_shared: str,
) -> tuple[OnGround | None, list[Note]]:
    """A component that its own observations and others leave open: hardly determined, by datum points, or level, as a
    bundle may begin; else None."""
    try:
        part, notes = _oriented(ground, component, rays, what, replace(settings, weakest=HARDLY_DETERMINED))
    except (ConvergenceError, GeometryError):
        reasons = [failure.what, f"by the images and points it shares with others {by_shared}" if by_shared else ""]
        if not isinstance(failure, ConvergenceError) and (not done or any(part.datum is not None for part in done)):
            by_datum = _at_datum_points(ground, component, rays, settings, what)
            if not isinstance(by_datum, str):
                return by_datum, [Note("note", f"{BY_DATUM_POINTS}; without them {failure.what}")]
            reasons.append(by_datum)
        if isinstance(failure, OpenDatumError) and _has_more(ground, component, rays) and _look_down(done):
            with contextlib.suppress(ConvergenceError, GeometryError):
                level = with_level_images(ground, np.flatnonzero(component.images))
                part, notes = _oriented(level, component, rays, what, replace(settings, weakest=HARDLY_DETERMINED))
                return part, [*notes, Note("warning", f"{failure.what}; {BEGUN_LEVEL}")]
        apart = component.images & np.all([~part.component.images for part in done], axis=0)
        return None, [_apart(ground.block, apart, "; ".join(filter(None, reasons)))]
    return part, [*notes, Note("warning", f"hardly determined, errors are magnified: {failure.what}")]


def _has_more(ground: GroundObserved, component: ImageComponent, rays: ImagePointRows) -> bool:
    """Whether images of a component show what it has no place of: control, or points that images beside it show."""
    own = component.images[rays.image]
    lacking = np.append(control_of(ground.block).point, rays.point[rays.active & ~own])
    shown = np.intersect1d(lacking, rays.point[rays.active & own])
    return not finite_rows(component.xyz)[shown].all()


def _look_down(done: Sequence[OnGround]) -> bool:
    """Whether images that are on the ground look down in the mean, or none is there."""
    upright = [part.component.poses.ground_from_image[part.component.images][:, 2, 2] for part in done]
    return not upright or float(np.concatenate(upright).mean()) > UPWARDS


def _by_what_they_share(
    ground: GroundObserved,
    failed: Sequence[tuple[ImageComponent, str, AatriError]],
    rays: ImagePointRows,
    done: list[OnGround],
    settings: OrientationSettings,
) -> tuple[list[Left], list[Note]]:
    """Components by others on the ground, and together, as long as `done` grows. Those left, with the reason."""
    left, notes = [(*one, "") for one in failed], list[Note]()
    while True:
        before, others = len(done), list[Left]()
        for component, what, failure, _ in left:
            beside = by_neighbours(ground, component, rays, [part.component for part in done], what, settings)
            if isinstance(beside, str):
                others.append((component, what, failure, beside))
                continue
            part, left_out = beside
            text = f"oriented by the images and points it shares with others; without them {failure.what}"
            notes.append(Note("warning", f"{what}: {left_out}") if left_out else Note("note", f"{what}: {text}"))
            done.append(part)
        left = others
        if len(done) == before and len(left) > 1:
            names, on_ground = [what for _, what, _, _ in left], [part.component for part in done]
            joint = together(ground, [c for c, _, _, _ in left], names, rays, on_ground, settings)
            text = "oriented together with others, by the points they share and what is observed of each; without them"
            notes += [Note("note", f"{names[k]}: {text} {left[k][2].what}") for k in joint]
            done += joint.values()
            left = [one for k, one in enumerate(left) if k not in joint]
        if len(done) == before or not left:
            return left, notes


def _at_datum_points(
    ground: GroundObserved, component: ImageComponent, rays: ImagePointRows, settings: OrientationSettings, what: str
) -> OnGround | str:
    """A component by the points that a free datum rests on, and what is observed; or why not, see there."""
    by_datum = oriented_at_datum_points(ground, component, rays, settings, what)
    if isinstance(by_datum, str):
        return by_datum
    to = by_datum[0].ground_from_body
    return OnGround(component.moved(to), by_datum[0], to, datum=by_datum[1])


def _apart(block: Block, images: Bool, reason: str) -> Note:
    ids = block.images.id[images].tolist()
    return Note("warning", f"a component of {several(len(ids), 'image')} stays apart: {reason}", tuple(ids))


def _free(
    ground: GroundObserved, component: ImageComponent, rays: ImagePointRows, settings: OrientationSettings
) -> tuple[OnGround, list[Note]]:
    """A component that nothing places: its scale by distances, its rotation by attitudes ..., what is open is held."""
    own, similarity = first_base_one(component)
    body = body_of(own, rays)
    seen = ground.of(body, everything, attitudes=True)
    observed = seen(IDENTITY)
    scaled = sum(len(o) for o in observed if o.kind in DISTANCES)
    turned = sum(len(o) for o in observed if o.kind == ATTITUDE)
    datum = [f"its scale that of {several(scaled, 'distance')}" if scaled else "the first base is 1"]
    datum += [f"its rotation that of {several(turned, 'attitude')}"] if turned else []
    note = Note("note", f"{NOTHING_PLACES}, {', '.join(datum)}")
    if not observed:
        return OnGround(own, None, similarity, free=True), [note]
    images, points = ground.block.images.id, ground.block.points.id

    def by(observe: Observe) -> OrientedBody:
        return orient_body(observe, body, settings, what="the block", image_ids=images, point_ids=points)

    oriented = by(seen)
    unit_m = precision(own.moved(oriented.ground_from_body), rays)
    share, differ = two_that_differ(oriented, unit_m, settings.limit)
    if differ:
        oriented = by(lambda to: with_uncertain_distances(seen(to), body.on_ground(to), share))
    to = oriented.ground_from_body
    return OnGround(own.moved(to), oriented, compose(to, similarity), free=True), [note, *differ]


def _oriented(
    ground: GroundObserved, component: ImageComponent, rays: ImagePointRows, what: str, settings: OrientationSettings
) -> tuple[OnGround, list[Note]]:
    """By all that is observed of it, without the one kind that contradicts all else."""
    body = body_of(component, rays)
    try:
        seated, notes = oriented_by(ground, body, settings, what)
    except (ConvergenceError, GeometryError) as failure:
        seated, notes = oriented_by_the_others(ground, body, settings, what, failure)

    def part(oriented: OrientedBody, left: tuple[Observed, ...] = ()) -> OnGround:
        to = oriented.ground_from_body
        return OnGround(component.moved(to), oriented, to, left=left)

    def notes_of(oriented: OrientedBody) -> list[Note]:
        turned = [] if notes else attitude_notes(ground, body, oriented.ground_from_body, what)
        return [*height_notes(ground.block, oriented, what), *turned]

    used, own = seated.tied.active, part(seated).component
    with_all = replace(seated, tied=replace(seated.tied, active=seated.began | used))
    if not notes and (seated.began & ~used).any() and fits_as_it_bends(ground.block, own, with_all, rays, used):
        with contextlib.suppress(ConvergenceError, GeometryError):  # a rigid body rejects what fits a bent one
            seated, notes = oriented_by(ground, body, replace(settings, rejects=False), what)
        return part(seated), [*notes, *notes_of(seated)]
    if notes or seated.tied.tau_m == 0 or fits_as_it_bends(ground.block, own, seated, rays):
        return part(seated), [*notes, *notes_of(seated)]
    if timed := by_time_offsets(ground, body, settings, what):
        return part(timed[0]), [timed[1], *notes_of(timed[0])]
    for kind, others in without_one(seated.tied.problem.ground):
        try:
            reduced, by_attitudes = oriented_by(ground, body, settings, what, chosen=others)
        except (ConvergenceError, GeometryError):
            continue  # the others do not determine it
        left = tuple(o for o in seated.tied.problem.ground if not others(o))
        far_m = MISFIT_OF_RIGHT * typical_distance(body, reduced.ground_from_body)
        # they fit, and do so no more with what is left out
        if not by_attitudes and reduced.tied.tau_m == 0 and contradicts(left, reduced.state, settings.limit, far_m):
            note = contradiction_note(ground.block, left, reduced.state, kind, what)
            return part(reduced, left), [note, *notes_of(reduced)]
    return part(seated), [*deformation_notes(seated, body, precision(component, rays), what), *notes_of(seated)]
