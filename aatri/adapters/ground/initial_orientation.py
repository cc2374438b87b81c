"""Free components to the ground by all that is known of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from aatri.adapters.ground.control_fit import height_notes
from aatri.adapters.ground.initial_datum import (
    Known,
    body_of,
    datum_of,
    held_datum,
    known_of,
    precision,
    without_drifting,
)
from aatri.adapters.ground.initial_neighbours import ground_of_neighbours
from aatri.adapters.ground.initial_observed import Ground
from aatri.adapters.ground.initial_tests import (
    attitude_notes,
    contradiction_note,
    contradicts,
    deformation_notes,
    two_that_differ,
    without_one,
)
from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.errors import AatriError, ConvergenceError, GeometryError
from aatri.geometry.similarity import Similarity, compose, transform
from aatri.notes import Note
from aatri.observations.image_points import ImagePointRows
from aatri.observations.poses import Poses
from aatri.orientation.bodies.absolute import OrientedComponent, orient_component
from aatri.orientation.bodies.datum_analysis import UNDETERMINED
from aatri.orientation.graph.component import ImageComponent
from aatri.orientation.graph.frame import first_base_one

HARDLY = 1e-4
"""Motions with a lambda above this (errors of control magnified less than 100 times) may start a bundle, which tells
how well they are known, where nothing better is there; see `datum_analysis`."""

ByAll = Callable[[ImageComponent, Float], Similarity]


@dataclass(frozen=True)
class OnGround:
    """A component on the ground.

    Attributes
    ----------
    component : ImageComponent
        In the ground's frame, reduced to the origin.
    known : Known
        What was held against it.
    oriented : OrientedComponent, optional
        None where nothing is known of the component.
    similarity : Similarity
        Ground from component.
    attitudes : bool
        Attitudes took part.
    free : bool
        Nothing tells where it lies.
    left : Known, optional
        What is left out, as it contradicts all else.
    """

    component: ImageComponent
    known: Known
    oriented: OrientedComponent | None
    similarity: Similarity
    attitudes: bool
    free: bool
    left: Known | None = None


def to_ground(
    block: Block,
    ground: Ground,
    components: tuple[ImageComponent, ...],
    rays: ImagePointRows,
    limit: float,
    by_all: ByAll | None = None,
) -> tuple[list[OnGround], list[Note]]:
    """Every component by one similarity; the first one stays free where none has a datum.

    Parameters
    ----------
    block : Block
    ground : Ground
    components : tuple of ImageComponent
    rays : ImagePointRows
    limit : float
        Test statistic of what is wrong.
    by_all : callable, optional
        (component, direction up in it) -> the similarity by observations of all kinds, where there are more than
        control, positions, distances and attitudes.

    Raises
    ------
    GeometryError
        If there is control or there are positions, and no component can be oriented by them.
    """
    done: list[OnGround] = []
    notes, failed = [*ground.notes], list[tuple[ImageComponent, str, AatriError]]()
    first: GeometryError | None = None
    known = [known_of(ground, c) for c in components]
    if not any(of.placed for of in known):
        part, told = _free(block, ground, components[0], rays, known[0], limit)
        notes += [*told, *(_apart(block, c, "no datum of their own") for c in components[1:])]
        return [part], notes
    for number, (component, of) in enumerate(zip(components, known), 1):
        what = f"component {number} ({int(component.images.sum())} images)"
        try:
            part, told = _oriented(block, ground, component, rays, of, what, limit)
        except (ConvergenceError, GeometryError) as error:
            failed.append((component, what, error))
            continue
        done.append(part)
        notes += [*told, *_control_notes(block, ground, part, what)]
    for component, what, alone in failed:
        beside, told, why = _otherwise(block, ground, component, rays, done, what, limit, by_all, alone)
        notes += told
        if beside is not None:
            done.append(beside)
        else:
            first = first or GeometryError(why, remedy=alone.remedy)
    if not done:
        raise first or failed[0][2]
    return done, notes


def _otherwise(
    block: Block,
    ground: Ground,
    component: ImageComponent,
    rays: ImagePointRows,
    done: list[OnGround],
    what: str,
    limit: float,
    by_all: ByAll | None,
    alone: AatriError,
) -> tuple[OnGround | None, list[Note], str]:
    """A component that control, positions, distances and attitudes leave open; else why it is."""
    why = alone.what
    try:
        if by_all is not None:
            to = by_all(component, body_of(component, rays).up)
            text = f"{what}: oriented by observations of all kinds together; without them {alone.what}"
            return (
                OnGround(moved(component, to), known_of(ground, component), None, to, False, False),
                [Note("note", text)],
                "",
            )
    except (ConvergenceError, GeometryError) as more:
        why += f"; with observations of all kinds: {more.what}"
    part = _by_neighbours(block, ground, component, rays, done, what, limit)
    if part is not None:
        text = f"{what}: oriented by the images and points it shares with others; without them {alone.what}"
        return part, [Note("note", text)], ""
    try:
        part, notes = _oriented(block, ground, component, rays, known_of(ground, component), what, limit, HARDLY)
    except (ConvergenceError, GeometryError):
        return None, [_apart(block, component, why)], why
    return part, [*notes, Note("warning", f"hardly determined, errors are magnified: {alone.what}")], ""


def _by_neighbours(
    block: Block,
    ground: Ground,
    component: ImageComponent,
    rays: ImagePointRows,
    done: list[OnGround],
    what: str,
    limit: float,
) -> OnGround | None:
    """A component that has too little of its own, by what it shares with those on the ground."""
    more = ground_of_neighbours(ground, [part.component for part in done], component, rays)
    if more is None:
        return None
    try:
        part, _ = _oriented(block, more, component, rays, known_of(more, component), what, limit)
    except (ConvergenceError, GeometryError):
        return None
    return replace(part, known=known_of(ground, component), oriented=None, left=None)


def _control_notes(block: Block, ground: Ground, part: OnGround, what: str) -> list[Note]:
    """Heights of control in another unit, attitudes that do not agree."""
    assert part.oriented is not None
    control, c = part.known.control, ground.control
    model = ground.origin_m + part.component.xyz[c.point[control]]
    return [
        *height_notes(block, c, control, model, what),
        *attitude_notes(block, ground, part.known.attitude, part.component.poses, what, took_part=part.attitudes),
    ]


def _apart(block: Block, component: ImageComponent, why: str) -> Note:
    ids = tuple(block.images.id[component.images].tolist())
    return Note("warning", f"a component of {len(ids)} images stays apart: {why}", ids)


def _free(
    block: Block, ground: Ground, component: ImageComponent, rays: ImagePointRows, known: Known, limit: float
) -> tuple[OnGround, list[Note]]:
    """A component without control and positions: its scale by distances, its rotation by attitudes, else held."""
    own, similarity = first_base_one(component)
    body = body_of(own, rays)
    datum, known = held_datum(block, ground, body, known)
    scaled, turned = sum(len(rows) for _, rows in known.lengths), len(known.attitude)
    told = [f"its scale that of {scaled} distances" if scaled else "the first base is 1"]
    if turned:
        told.append(f"its rotation that of {turned} attitudes")
    note = Note("warning", f"no control and no observed positions: the datum is free, {', '.join(told)}")
    if not scaled and not turned:
        return OnGround(own, known, None, similarity, False, True), [note]
    oriented = orient_component(datum, body.places, body.up, what="the block", limit=limit, weakest=0.0, stiff=True)
    to = oriented.ground_from_component
    own = moved(own, to)
    differ = two_that_differ(known, own, precision(own, rays), limit)
    return OnGround(own, known, oriented, compose(to, similarity), turned > 0, True), [note, *differ]


def _oriented(
    block: Block,
    ground: Ground,
    component: ImageComponent,
    rays: ImagePointRows,
    known: Known,
    what: str,
    limit: float,
    weakest: float = UNDETERMINED,
) -> tuple[OnGround, list[Note]]:
    """By control, positions and distances; by attitudes as well where these leave something open.

    Positions of drift groups take part only where nothing else determines the component.
    """
    steady = without_drifting(block, ground, known)
    if steady.placed and len(steady.position) < len(known.position):
        try:
            return _oriented(block, ground, component, rays, steady, what, limit, weakest)
        except GeometryError:
            pass  # it hangs on the positions that drift
    body = body_of(component, rays)

    def by(known: Known, *, attitudes: bool = False) -> OrientedComponent:
        datum = datum_of(block, ground, body, known, attitudes=attitudes)
        return orient_component(datum, body.places, body.up, what=what, limit=limit, weakest=weakest, stiff=True)

    def part(known: Known, result: OrientedComponent, *, attitudes: bool = False) -> OnGround:
        to = result.ground_from_component
        return OnGround(moved(component, to), known, result, to, attitudes, False)

    try:
        result = by(known)
    except GeometryError as error:
        if not len(known.attitude):
            raise
        text = f"{what}: attitudes of {len(known.attitude)} images take part, as control and positions leave it open: "
        return part(known, by(known, attitudes=True), attitudes=True), [Note("note", text + error.what)]
    if result.tied.tau_m == 0:
        return part(known, result), []
    for kind, others, left in without_one(known):
        try:
            alone = by(others)
        except (ConvergenceError, GeometryError):
            continue  # the others do not determine it
        made = replace(part(others, alone), left=left)
        # they fit, and do so no more with what is left out
        if alone.tied.tau_m == 0 and contradicts(block, ground, left, made.component, limit):
            return made, [contradiction_note(block, ground, left, made.component, kind, what)]
    return part(known, result), deformation_notes(result, precision(component, rays), what)


def moved(component: ImageComponent, to: Similarity) -> ImageComponent:
    """A component after a similarity."""
    poses = Poses(transform(to, component.poses.position_m), to.rotation @ component.poses.ground_from_image)
    return replace(component, poses=poses, xyz=transform(to, component.xyz))
