"""Strips on the ground as a Solution: orientations, residuals, suspects, parameters, what nothing controls.

The ground-photogrammetric frame tp of a component is that of the two of its control points that lie farthest apart.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from aatri.adapters.observation_tables import not_seen_since
from aatri.adapters.solution import stacked, suspect_rows
from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips.tied_tables import (
    components_of,
    not_tested,
    residuals_of,
    seen_points,
    suspects_of,
    tests_of,
    uncontrolled_kinds,
)
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjusting.tied_problem import not_rejected
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.residuals import Residuals
from aatri.artifacts.solution import Parameters, Solution, StripTransformations
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.geometry.rotations import levelling
from aatri.geometry.similarity import Similarity, compose, transform
from aatri.geometry.two_point import farthest_apart, two_point_frame
from aatri.notes import Note
from aatri.observations.control import control_of
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.observed import Spread
from aatri.observations.ties import STRIP_TIE
from aatri.orientation.bodies.absolute_datum import OrientedPart, StripsOfBlock, free_images, pooled
from aatri.orientation.bodies.absolute_orientation import OrientedStrips
from aatri.orientation.bodies.components import strip_names
from aatri.orientation.bodies.control_by_rays import ControlByRays

ROLE_NAME = "absolute_orientation"


def absolute_solution(
    oriented: OrientedStrips, image_points: ImagePoints, method: str, *, tests: bool = False
) -> tuple[Solution, list[Note]]:
    """The Solution of oriented components, and which images are left out."""
    block, strips, parts = oriented.block_strips.block, oriented.block_strips.strips, oriented.parts
    origin_m = oriented.block_strips.ground.origin_m
    position, rotation = np.full((len(block.images), 3), np.nan), np.full((len(block.images), 3, 3), np.nan)
    points = np.full((len(block.points), 3), np.nan)
    transformations, parameters, residuals = [StripTransformations.empty()], [Parameters.empty()], [Residuals.empty()]
    suspects = [_carried(oriented.block_strips, parts)]
    for part in parts:
        to_ground, component = part.result.ground_from_body, part.component
        centres, rotations, image = free_images(strips, component)
        position[image] = transform(to_ground, centres) + origin_m
        rotation[image] = to_ground.rotation @ rotations
        points[component.point] = transform(to_ground, component.xyz) + origin_m
        for strip, pose in zip(component.strips, component.component_from_strip):
            name = str(strips.strips.id[strip])
            transformations.append(pieces.similarity_rows(name, compose(to_ground, pose), origin_m))
        parameters += _precisions(strips, part)
        residuals += _residual_tables(part)
        suspects += _suspect_tables(strips, part)
    counts, sigma0 = pooled(parts)
    solution = pieces.solution_of(
        block,
        image_points,
        pieces.Placed(position, rotation, points),
        method=method,
        counts=counts,
        sigma0=sigma0,
        iterations=sum(tied.iterations for part in parts for _, tied in part.adjusted()),
        transformations=stacked(transformations),
        parameters=stacked(parameters),
        residuals=stacked(residuals),
        suspects=stacked(suspects),
        uncontrolled=_uncontrolled_tables(block, strips, parts),
        tests=stacked([tests_of(tied) for part in parts for _, tied in part.adjusted()]) if tests else None,
        components=stacked([components_of(tied) for part in parts for _, tied in part.adjusted()]) if tests else None,
    )
    return solution, pieces.left_out(block, np.isfinite(position).all(1))


def _precisions(strips: Strips, part: OrientedPart) -> list[Parameters]:
    """Deformation of a component towards the ground, and of its strips towards each other."""
    name = strip_names(part.component, strips.strips.id.tolist())
    rows = [pieces.precision_row(f"{name} to the ground", part.result.tied.tau_m)]
    if part.component.tied is not None:
        scale = part.result.ground_from_body.scale
        rows.append(pieces.precision_row(f"{name} to each other", scale * part.component.tied.tau_m))
    return rows


def _residual_tables(part: OrientedPart) -> Iterator[Residuals]:
    """Component on the ground minus what is observed, and the ties in metres along the ground axes."""
    yield residuals_of(part.result.tied, part.result.state)
    if (ties := part.component.tied) is not None:
        to = part.result.ground_from_body
        tie_residuals = residuals_of(
            replace(ties, observations=tuple(_on_ground(one, to) for one in ties.observations))
        )
        yield replace(tie_residuals, residual=to.scale * tie_residuals.residual @ to.rotation.T)


def _on_ground(adjusted: AdjustedObservations, to: Similarity) -> AdjustedObservations:
    """Ties of a component, with their standard deviations on the ground."""
    spread = adjusted.observed.spread
    assert spread is not None
    turned = Spread(to.scale**2 * spread.values, to.rotation @ spread.vectors, spread.at)
    return replace(adjusted, observed=replace(adjusted.observed, spread=turned))


def _carried(block_strips: StripsOfBlock, parts: Sequence[OrientedPart]) -> Suspects:
    """Suspects of earlier stages but those that were tested here anew."""
    strips, before = block_strips.strips, block_strips.strips.suspects
    for part in parts:
        for _, tied in part.adjusted():
            before = not_tested(before, tied, strips.strips.id[part.component.strips])
        if len(part.by_rays.meeting):
            before = _told_by_rays(before, part.by_rays, block_strips)
    return before


def _told_by_rays(before: Suspects, by_rays: ControlByRays, block_strips: StripsOfBlock) -> Suspects:
    """Suspects of earlier stages without the rays that meet in control, and with those that do not."""
    block, rays = block_strips.block, block_strips.rays
    stay = ~((before.kind == IMAGE_POINT) & np.isin(before.row, np.concatenate([by_rays.meeting, by_rays.apart])))
    sigma_mm = rays.sigma_mm[by_rays.apart].mean(axis=1)
    apart = suspect_rows(
        ROLE_NAME,
        IMAGE_POINT,
        row=by_rays.apart,
        image=block.images.id[rays.image[by_rays.apart]],
        point=block.points.id[rays.point[by_rays.apart]],
        size=by_rays.apart_mm,
        sigma=sigma_mm,
        test=by_rays.apart_mm / sigma_mm,
    )
    return stacked([before.take(np.flatnonzero(stay)), apart])


def _suspect_tables(strips: Strips, part: OrientedPart) -> Iterator[Suspects]:
    """What was tested and not believed, or believed again: observations of the ground, and ties."""
    ties = part.component.tied
    yield suspects_of(part.result.tied, ROLE_NAME, part.result.began)
    if ties is not None:
        began = not_rejected(ties.problem.observed, {STRIP_TIE: strips.suspects})
        yield suspects_of(ties, ROLE_NAME, began, part.result.ground_from_body)


def _uncontrolled_tables(block: Block, strips: Strips, parts: Sequence[OrientedPart]) -> Uncontrolled:
    """Image points that no second model, strip or control has seen; what nothing else controls."""
    table = strips.strip_points
    seen_twice, tables = np.zeros(len(block.points), dtype=bool), list[Uncontrolled]()
    for part in parts:
        result, rows, ties = part.result, part.component.rows, part.component.tied
        active = np.ones(len(rows), dtype=bool) if ties is None else ties.active
        seen_twice |= np.bincount(table.point[rows[active]], minlength=len(block.points)) > 1
        seen_twice |= seen_points(result.tied)
        if ties is not None:
            tables.append(uncontrolled_kinds(ties, result.ground_from_body.rotation))
        tables.append(uncontrolled_kinds(result.tied))
    if strips.uncontrolled is not None:
        tables.insert(0, not_seen_since(strips.uncontrolled, block, seen_twice))
    return stacked([Uncontrolled.empty(), *tables])


TP = "tp"
"""Transformation, and id of the frame."""


def tp_rows(block: Block, strips: Strips, part: OrientedPart) -> StripTransformations:
    """Parameters of the frame of a component, its levelled axes and unit; none if two points are not known in full.

    (X, Y)tp = [b a; a -b] (N - N1, E - E1) + (X1, Y1),   Ztp = lambda (H - H1) + Z1
    """
    component, control = part.component, control_of(block)
    _, rotations, _ = free_images(strips, component)
    level = component.xyz @ levelling(rotations[:, :, 2].mean(axis=0)).T
    in_full = np.isin(control.point, component.point) & control.given.all(axis=1)
    xyz_m, place = control.xyz_m[in_full], np.searchsorted(component.point, control.point[in_full])
    if len(xyz_m) < 2:
        return StripTransformations.empty()
    ends = farthest_apart(xyz_m[:, :2])
    frame = two_point_frame(level[place[ends]], xyz_m[ends][:, [1, 0, 2]])
    names = ("a", "b", "lambda", "N1_m", "E1_m", "H1_m", "X1", "Y1", "Z1")
    values = [frame.a, frame.b, frame.scale, *frame.north_east_height_m, *frame.xyz_tp]
    return StripTransformations.of(id=TP, model=TP, parameter=names, value=values)
