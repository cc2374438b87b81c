"""Free components to the ground by all that is known of it, and a Solution of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.ground.control_fit import exchange_notes, height_notes
from aatri.adapters.ground.initial_scale import compared, distance_ratios
from aatri.adapters.solution import residuals, solved_cameras, stacked
from aatri.adapters.strips import strips as pieces
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import DatumCarriers, Parameters, Residuals, Solution, StripTransformations
from aatri.artifacts.suspects import Suspects
from aatri.errors import GeometryError
from aatri.geometry.similarity import Similarity, compose, transform
from aatri.geometry.vectors import finite_rows
from aatri.ids import shown
from aatri.notes import Level, Note
from aatri.observations.control import Control, control_of
from aatri.observations.image_points import ImagePointRows
from aatri.observations.poses import Poses
from aatri.observations.positions import Positions, positions_of
from aatri.orientation.free_block.absolute import Datum, OrientedComponent, orient_component
from aatri.orientation.graph.component import Component
from aatri.orientation.graph.frame import first_base_one
from aatri.orientation.graph.triangulation import residuals_mm

STAGE = "initial_orientation"

PRECISION = 3.0
"""Standard deviations of a ray that a point or projection centre of a component is off, in object space."""


@dataclass(frozen=True)
class OnGround:
    """A component on the ground.

    Attributes
    ----------
    component : Component
        In the ground's frame, reduced to the origin.
    control, position : (k,) int
        Rows of the control and the positions held against it.
    oriented : OrientedComponent, optional
        None without a datum.
    similarity : Similarity
        Ground from component.
    """

    component: Component
    control: Int
    position: Int
    oriented: OrientedComponent | None
    similarity: Similarity


@dataclass(frozen=True)
class Ground:
    """What is known of the ground, and where coordinates are reduced to."""

    control: Control
    positions: Positions
    origin_m: Float


def ground_of(block: Block, *, use_positions: bool) -> Ground:
    """Control and positions of a block."""
    control, positions = control_of(block), positions_of(block)
    if not use_positions:
        positions = replace(positions, **{n: getattr(positions, n)[:0] for n in positions.__dataclass_fields__})
    return Ground(control, positions, pieces.origin_of(control, positions))


def to_ground(
    block: Block, ground: Ground, components: tuple[Component, ...], rays: ImagePointRows, limit: float
) -> tuple[list[OnGround], list[Note]]:
    """Every component by one similarity; the first one stays free where none has a datum.

    Raises
    ------
    GeometryError
        If there is control or there are positions, and no component can be oriented by them.
    """
    done, notes, failed = [], [], []
    held = [_holds(ground, c) for c in components]
    if not any(len(a) + len(b) for a, b in held):
        free = first_base_one(components[0])
        ratio = distance_ratios(block, free[0])
        text = "no control and no observed positions: the datum is free, the first base is 1"
        if len(ratio):
            scaled = Similarity(np.zeros(3), float(np.median(ratio)), np.eye(3))
            free = moved(free[0], scaled), compose(scaled, free[1])
            text = f"no control and no observed positions: the datum is free, its scale that of {len(ratio)} distances"
        notes = [Note("warning", text), *(_apart(block, c, "no datum of their own") for c in components[1:])]
        none = np.zeros(0, dtype=np.int64)
        return [OnGround(free[0], none, none, None, free[1])], notes
    for number, (component, (control, position)) in enumerate(zip(components, held), 1):
        what = f"component {number} ({int(component.images.sum())} images)"
        try:
            part = _oriented(block, ground, component, rays, control, position, what, limit)
            done.append(part)
            notes += _control_notes(block, ground, part, what)
        except GeometryError as error:
            failed.append(error)
            notes.append(_apart(block, component, error.what))
    if not done:
        raise failed[0]
    for number, part in enumerate(done, 1):
        notes += compared(block, number, part.component)
    return done, notes


def _control_notes(block: Block, ground: Ground, part: OnGround, what: str) -> list[Note]:
    """Heights of control in another unit, numbers of control exchanged."""
    assert part.oriented is not None
    n, c = len(part.control), ground.control
    model = ground.origin_m + part.component.xyz[c.point[part.control]]
    return [
        *height_notes(block, c, part.control, model, what),
        *exchange_notes(block, c, part.control, part.oriented.residual_m[:n], part.oriented.active[:n]),
    ]


def _apart(block: Block, component: Component, why: str) -> Note:
    ids = tuple(block.images.id[component.images].tolist())
    return Note("warning", f"a component of {len(ids)} images stays apart: {why}", ids)


def _holds(ground: Ground, component: Component) -> tuple[Int, Int]:
    """Rows of the control and the positions that a component holds."""
    known = finite_rows(component.xyz)
    return (np.flatnonzero(known[ground.control.point]), np.flatnonzero(component.images[ground.positions.image]))


def _oriented(
    block: Block, ground: Ground, component: Component, rays: ImagePointRows, control: Int, position: Int, what: str,
    limit: float,
) -> OnGround:  # fmt: skip
    c, p, poses = ground.control, ground.positions, component.poses
    image = p.image[position]
    datum = Datum(
        name=tuple(f"point {i}" for i in block.points.id[c.point[control]])
        + tuple(f"image {i}" for i in block.images.id[image]),
        x=np.concatenate([component.xyz[c.point[control]], poses.position_m[image]]),
        covariance=np.tile(_precision(component, rays) ** 2 * np.eye(3), (len(control) + len(position), 1, 1)),
        offset_m=np.concatenate(
            [np.zeros((len(control), 3)),
             np.einsum("nij,nj->ni", poses.ground_from_image[image], p.lever_arm_m[position])]
        ),
        xyz_m=np.concatenate([c.xyz_m[control], p.position_m[position]]) - ground.origin_m,
        covariance_m2=np.concatenate([c.covariance_m2[control], p.covariance_m2[position]]),
        given=np.concatenate([c.given[control], np.ones((len(position), 3), dtype=bool)]),
        n_control=len(control),
    )  # fmt: skip
    images = component.images
    body = np.concatenate([component.xyz[finite_rows(component.xyz)], poses.position_m[images]])
    up = poses.ground_from_image[images][:, :, 2].mean(axis=0)
    result = orient_component(datum, body, up, what=what, limit=limit)
    to = result.ground_from_component
    return OnGround(moved(component, to), control, position, result, to)


def _precision(component: Component, rays: ImagePointRows) -> float:
    """Standard deviation of points and centres of a component, in its unit: that of a ray at its typical length."""
    rows = np.flatnonzero(component.kept)
    away = component.xyz[rays.point[rows]] - component.poses.position_m[rays.image[rows]]
    per_mm = np.linalg.norm(away, axis=1) / rays.c_mm[rows]
    return PRECISION * max(component.spread, 0.1) * float(np.median(per_mm * rays.sigma_mm[rows].mean(axis=1)))


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
    kept = np.zeros(len(rays.image), dtype=bool)
    free = parts[0].oriented is None
    origin = np.zeros(3) if free else ground.origin_m
    for number, part in enumerate(parts, 1):
        c = part.component
        new, points = c.images & ~finite_rows(position), finite_rows(c.xyz) & ~finite_rows(xyz)
        position[new], rotation[new] = c.poses.position_m[new] + origin, c.poses.ground_from_image[new]
        xyz[points] = c.xyz[points] + origin
        kept |= c.kept & new[rays.image] & points[rays.point]
        moves.append(pieces.similarity_rows(f"component {number}", part.similarity, origin))
        tables += _residuals(block, ground, part)
        found += _suspects(block, ground, part)
    reached = rays.active & finite_rows(position)[rays.image] & finite_rows(xyz)[rays.point]
    found.append(_trimmed(block, rays, Poses(position, rotation), xyz, np.flatnonzero(reached & ~kept)))
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


def _residuals(block: Block, ground: Ground, part: OnGround) -> list[Residuals]:
    if part.oriented is None:
        return []
    first, tables = len(part.control), []
    for kind, of, rows in (("control", slice(0, first), part.control), ("position", slice(first, None), part.position)):
        if not len(rows):
            continue
        source = ground.control if kind == "control" else ground.positions
        names = block.points.id[ground.control.point[rows]] if kind == "control" else np.full(len(rows), "")
        images = block.images.id[ground.positions.image[rows]] if kind == "position" else np.full(len(rows), "")
        sigma = np.sqrt(np.einsum("nii->ni", source.covariance_m2[rows]))
        value = part.oriented.residual_m[of]
        tables.append(residuals(kind, source.row[rows], images, names, value,
                                np.where(np.isfinite(value), sigma, np.nan), part.oriented.active[of]))  # fmt: skip
    return tables


def _suspects(block: Block, ground: Ground, part: OnGround) -> list[Suspects]:
    """Control and positions that do not fit the similarity."""
    if part.oriented is None:
        return []
    first, tables = len(part.control), []
    test = part.oriented.tied.test[-len(part.oriented.active) :]
    for kind, of, rows in (("control", slice(0, first), part.control), ("position", slice(first, None), part.position)):
        source = ground.control if kind == "control" else ground.positions
        names = block.points.id[ground.control.point[rows]] if kind == "control" else np.full(len(rows), "")
        images = block.images.id[ground.positions.image[rows]] if kind == "position" else np.full(len(rows), "")
        everything = np.ones(len(rows), dtype=bool)
        tables.append(pieces.tested(
            kind=kind, row=source.row[rows], image=images, point=names, stage=STAGE,
            size_m=part.oriented.residual_m[of], test=test[of], began=everything, active=part.oriented.active[of],
            above=~everything,
        ))  # fmt: skip
    return tables


def _trimmed(block: Block, rays: ImagePointRows, poses: Poses, xyz: Float, rows: Int) -> Suspects:
    """Image points that do not fit the points of the others: rejected, for the bundle to test again."""
    n, off = len(rows), residuals_mm(rays, rows, poses, xyz)
    sigma = rays.sigma_mm[rows].mean(axis=1)
    finite: Bool = np.isfinite(off)
    return Suspects(
        kind=np.full(n, "image_point"), row=rows.astype(np.int32), image=block.images.id[rays.image[rows]],
        point=block.points.id[rays.point[rows]], stage=np.full(n, STAGE), size=np.where(finite, off, np.nan),
        unit=np.full(n, "mm"), sigma=sigma, test=np.where(finite, off / sigma, np.nan), verdict=np.full(n, "rejected"),
    )  # fmt: skip


def rejected_note(suspects: Suspects) -> list[Note]:
    """How many image points, control points and positions are rejected."""
    notes = []
    for kind in np.unique(suspects.kind[(suspects.verdict == "rejected") & (suspects.stage == STAGE)]).tolist():
        rows = np.flatnonzero((suspects.kind == kind) & (suspects.verdict == "rejected") & (suspects.stage == STAGE))
        ids = tuple("/".join(x for x in pair if x) for pair in zip(suspects.image[rows], suspects.point[rows]))
        level: Level = "note" if kind == "image_point" else "warning"
        notes.append(Note(level, f"{kind}: {len(rows)} rejected", ids))
    return notes


def not_oriented(block: Block, solution: Solution) -> list[Note]:
    """A warning that names the images in use that are not oriented."""
    return pieces.left_out(block, solution.images.oriented)


def shown_components(components: tuple[Component, ...], block: Block) -> list[Note]:
    """Sizes of the components; the images of all but the first by name."""
    if len(components) == 1:
        return [Note("note", f"one component of {int(components[0].images.sum())} images")]
    return [
        Note("warning", f"{len(components)} components that are not joined; number {k} has {int(c.images.sum())} "
             f"images: {shown(block.images.id[c.images])}")
        for k, c in enumerate(components, 1)
        if k > 1
    ]  # fmt: skip
