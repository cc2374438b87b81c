"""Free components to the ground by all that is known of it, and a Solution of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.ground.control_fit import exchange_notes, height_notes
from aatri.adapters.ground.initial_datum import Known, datum_of, held_datum, known_of, precision
from aatri.adapters.ground.initial_neighbours import ground_of_neighbours
from aatri.adapters.ground.initial_observed import Ground
from aatri.adapters.ground.initial_tests import (
    STAGE,
    attitude_notes,
    contradiction_note,
    deformation_notes,
    held_against,
    left_out_table,
    residual_table,
    suspect_table,
    two_that_differ,
    without_one,
)
from aatri.adapters.solution import solved_cameras, stacked
from aatri.adapters.strips import strips as pieces
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import DatumCarriers, Parameters, Residuals, Solution, StripTransformations
from aatri.artifacts.suspects import Suspects
from aatri.errors import AatriError, ConvergenceError, GeometryError
from aatri.geometry.similarity import Similarity, compose, transform
from aatri.geometry.vectors import finite_rows
from aatri.notes import Note
from aatri.observations.image_points import ImagePointRows
from aatri.observations.poses import Poses
from aatri.orientation.free_block.absolute import OrientedComponent, orient_component
from aatri.orientation.graph.component import WIDE_RAD, Component
from aatri.orientation.graph.frame import first_base_one
from aatri.orientation.graph.triangulation import contradicting, residuals_mm


@dataclass(frozen=True)
class OnGround:
    """A component on the ground.

    Attributes
    ----------
    component : Component
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

    component: Component
    known: Known
    oriented: OrientedComponent | None
    similarity: Similarity
    attitudes: bool
    free: bool
    left: Known | None = None


def to_ground(
    block: Block, ground: Ground, components: tuple[Component, ...], rays: ImagePointRows, limit: float,
    by_all: Callable[[Component, Float], Similarity] | None = None,
) -> tuple[list[OnGround], list[Note]]:  # fmt: skip
    """Every component by one similarity; the first one stays free where none has a datum.

    Parameters
    ----------
    block : Block
    ground : Ground
    components : tuple of Component
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
    notes, failed = [*ground.notes], list[tuple[Component, str, AatriError]]()
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
        why, how = alone.what, "the images and points it shares with others"
        beside: OnGround | None = None
        try:
            if by_all is not None:
                to = by_all(component, _body(component)[1])
                how = "observations of all kinds together"
                beside = OnGround(moved(component, to), known_of(ground, component), None, to, False, False)
        except (ConvergenceError, GeometryError) as more:
            why += f"; with observations of all kinds: {more.what}"
        beside = beside or _by_neighbours(block, ground, component, rays, done, what, limit)
        if beside is not None:
            done.append(beside)
            notes.append(Note("note", f"{what}: oriented by {how}; without them {alone.what}"))
            continue
        notes.append(_apart(block, component, why))
        first = first or GeometryError(why, remedy=alone.remedy)
    if not done:
        raise first or failed[0][2]
    return done, notes


def _by_neighbours(
    block: Block, ground: Ground, component: Component, rays: ImagePointRows, done: list[OnGround], what: str,
    limit: float,
) -> OnGround | None:  # fmt: skip
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
    """Heights of control in another unit, numbers of control exchanged, attitudes that do not agree."""
    assert part.oriented is not None
    control, c = part.known.control, ground.control
    n = len(control)
    model = ground.origin_m + part.component.xyz[c.point[control]]
    return [
        *height_notes(block, c, control, model, what),
        *exchange_notes(block, c, control, part.oriented.residual_m[:n], part.oriented.active[:n]),
        *attitude_notes(block, ground, part.known.attitude, part.component.poses, what, took_part=part.attitudes),
    ]


def _apart(block: Block, component: Component, why: str) -> Note:
    ids = tuple(block.images.id[component.images].tolist())
    return Note("warning", f"a component of {len(ids)} images stays apart: {why}", ids)


def _free(
    block: Block, ground: Ground, component: Component, rays: ImagePointRows, known: Known, limit: float
) -> tuple[OnGround, list[Note]]:
    """A component without control and positions: its scale by distances, its rotation by attitudes, else held."""
    own, similarity = first_base_one(component)
    datum, known = held_datum(block, ground, own, rays, known)
    scaled, turned = sum(len(rows) for _, rows in known.lengths), len(known.attitude)
    told = [f"its scale that of {scaled} distances" if scaled else "the first base is 1"]
    if turned:
        told.append(f"its rotation that of {turned} attitudes")
    note = Note("warning", f"no control and no observed positions: the datum is free, {', '.join(told)}")
    if not scaled and not turned:
        return OnGround(own, known, None, similarity, False, True), [note]
    body, up = _body(own)
    oriented = orient_component(datum, body, up, what="the block", limit=limit, weakest=0.0, stiff=True)
    to = oriented.ground_from_component
    own = moved(own, to)
    differ = two_that_differ(known, own, precision(own, rays), limit)
    return OnGround(own, known, oriented, compose(to, similarity), turned > 0, True), [note, *differ]


def _oriented(
    block: Block, ground: Ground, component: Component, rays: ImagePointRows, known: Known, what: str, limit: float
) -> tuple[OnGround, list[Note]]:
    """By control, positions and distances; by attitudes as well where these leave something open."""
    body, up = _body(component)

    def by(known: Known, *, attitudes: bool = False) -> OrientedComponent:
        datum = datum_of(block, ground, component, rays, known, attitudes=attitudes)
        return orient_component(datum, body, up, what=what, limit=limit, stiff=True)

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
        if alone.tied.tau_m == 0:  # they fit, and do so no more with what is left out
            made = replace(part(others, alone), left=left)
            return made, [contradiction_note(block, ground, left, made.component, kind, what)]
    return part(known, result), deformation_notes(result, precision(component, rays), what)


def _body(component: Component) -> tuple[Float, Float]:
    """All points of a component, and the direction against the mean viewing direction of its images."""
    images = component.images
    body = np.concatenate([component.xyz[finite_rows(component.xyz)], component.poses.position_m[images]])
    return body, component.poses.ground_from_image[images][:, :, 2].mean(axis=0)


def moved(component: Component, to: Similarity) -> Component:
    """A component after a similarity."""
    poses = Poses(transform(to, component.poses.position_m), to.rotation @ component.poses.ground_from_image)
    return replace(component, poses=poses, xyz=transform(to, component.xyz))


def initial_solution(
    block: Block, image_points: ImagePoints, rays: ImagePointRows, ground: Ground, parts: list[OnGround], method: str,
    suspects: Suspects,
) -> Solution:  # fmt: skip
    """The Solution of components on the ground; an image of several components is that of the first."""
    n, m = len(block.images), len(block.points)
    position, rotation, xyz = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full((m, 3), np.nan)
    tables, moves = [Residuals.empty()], [StripTransformations.empty()]
    found = [suspects]
    kept, own = np.zeros(len(rays.image), dtype=bool), np.zeros(len(rays.image), dtype=bool)
    free = parts[0].free
    origin = np.zeros(3) if free else ground.origin_m
    for number, part in enumerate(parts, 1):
        c = part.component
        new, points = c.images & ~finite_rows(position), finite_rows(c.xyz) & ~finite_rows(xyz)
        position[new], rotation[new] = c.poses.position_m[new] + origin, c.poses.ground_from_image[new]
        xyz[points] = c.xyz[points] + origin
        kept |= c.kept & new[rays.image] & points[rays.point]
        own |= c.kept
        moves.append(pieces.similarity_rows(f"component {number}", part.similarity, origin))
        if part.oriented is not None:
            first, held = len(part.oriented.tied.point_m), len(part.oriented.active) if free else 0
            for one in held_against(block, ground, part.known, c, attitudes=part.attitudes, first=first, held=held):
                tables.append(residual_table(one, part.oriented))
                found.append(suspect_table(one, part.oriented))
        if part.left is not None:
            found += [left_out_table(one) for one in held_against(block, ground, part.left, c, attitudes=False)]
    reached = rays.active & finite_rows(position)[rays.image] & finite_rows(xyz)[rays.point]
    poses = Poses(position, rotation)
    # Components that nothing joined lie apart by more than rays do: their own rays are not to blame.
    apart = np.flatnonzero(reached & own & ~kept)
    kept[apart] = residuals_mm(rays, apart, poses, xyz) <= WIDE_RAD * rays.c_mm[apart]
    found.append(_trimmed(block, rays, poses, xyz, np.flatnonzero(reached & ~kept), "rejected"))
    spread = max(part.component.spread for part in parts)
    found.append(_trimmed(block, rays, poses, xyz, contradicting(rays, poses, xyz, spread), "undecidable"))
    used, solved = int(2 * kept.sum()), finite_rows(xyz)
    solution = pieces.solution_of(
        block, image_points, pieces.Placed(position, rotation, xyz), method=method,
        counts=(used, int(6 * finite_rows(position).sum() + 3 * solved.sum())), sigma0=float("nan"), iterations=0,
        transformations=stacked(moves), parameters=Parameters.empty(), residuals=stacked(tables),
        suspects=stacked(found),
    )  # fmt: skip
    solution = replace(solution, cameras=solved_cameras(block))
    if free:
        return replace(solution, datum=DatumCarriers(kind=np.array(["held"]), id=np.array([""])))
    return solution


def _trimmed(block: Block, rays: ImagePointRows, poses: Poses, xyz: Float, rows: Int, verdict: str) -> Suspects:
    """Image points that do not fit the points of the others, or those of a point of which no two clearly fit."""
    n, off = len(rows), residuals_mm(rays, rows, poses, xyz)
    sigma = rays.sigma_mm[rows].mean(axis=1)
    finite: Bool = np.isfinite(off)
    return Suspects(
        kind=np.full(n, "image_point"), row=rows.astype(np.int32), image=block.images.id[rays.image[rows]],
        point=block.points.id[rays.point[rows]], stage=np.full(n, STAGE), size=np.where(finite, off, np.nan),
        unit=np.full(n, "mm"), sigma=sigma, test=np.where(finite, off / sigma, np.nan), verdict=np.full(n, verdict),
    )  # fmt: skip
