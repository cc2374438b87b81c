"""Absolute orientation of the strips of a block: artifacts to components, and components to a Solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adapters.ground import absolute_tables as tables
from aatri.adapters.ground.absolute_datum import free_images, oriented_part
from aatri.adapters.ground.absolute_tables import GroundOfStrips, OrientedPart
from aatri.adapters.ground.control_fit import height_notes
from aatri.adapters.ground.initial_observed import ground_of
from aatri.adapters.solution import stacked
from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips.tied_tables import names_of, tests_of
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Parameters, Residuals, Solution, StripTransformations
from aatri.artifacts.strips import Strips
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.similarity import compose, transform
from aatri.notes import Note
from aatri.orientation.bodies.components import FreeBlock, join_strips, strip_names
from aatri.orientation.bodies.deformation import Misfit, rms_m, search_notes, sigma0_notes

EXTRAPOLATION_WARNED = 3.0

WORST = 5
"""So many observations are named where strips and control do not fit."""


@dataclass(frozen=True)
class OrientedStrips:
    """Components on the ground, and what there is to say of them."""

    ground: GroundOfStrips
    parts: tuple[OrientedPart, ...]
    notes: tuple[Note, ...]


def ground_of_strips(block: Block, as_given: Block, strips: Strips, *, use_positions: bool) -> GroundOfStrips:
    """What a block in the frame of the adjustment knows of the ground; attitudes from that in its own frame."""
    known = ground_of(block, as_given, use_positions=use_positions)
    return GroundOfStrips(known.control, known.positions, known.origin_m, (), known.attitudes, (), block, strips)


def orient_strips(
    ground: GroundOfStrips,
    *,
    tie_limit: float,
    control_limit: float,
    every_component: bool,
    max_sigma0: float | None,
    two_points: bool = False,
) -> OrientedStrips:
    """Join strips to components and orient each.

    Parameters
    ----------
    ground : GroundOfStrips
    tie_limit, control_limit : float
        Test statistics of wrong ties and of wrong control.
    every_component : bool
        A component without a datum is an error; else it is left out with a warning.
    max_sigma0 : float or None
    two_points : bool
        Each starts from two control points.

    Raises
    ------
    GeometryError
        If a component is not determined, or none is.
    ConvergenceError
        If an adjustment does not converge, or its result does not fit.
    """
    how = (tie_limit, control_limit, two_points)
    free, parts, failed, notes = _joined_and_oriented(ground, *how, weakly=False)
    if any(free.weak) and failed:  # not each has control enough of its own
        free, parts, failed, notes = _joined_and_oriented(ground, *how, weakly=True)
    if not free.components:
        raise GeometryError("there are no strips to orient", remedy="see the gaps of the strip formation")
    if failed and (every_component or not parts):
        raise _all_of(failed, free)
    notes += [Note("warning", f"not oriented: {error.what}") for error in failed]
    adjusted = [(name, tied) for part in parts for name, tied in part.adjusted()]
    try:
        notes += sigma0_notes(
            [tied for _, tied in adjusted],
            [name for name, _ in adjusted],
            tables.pooled(parts)[1],
            pieces.most_models(ground.strips),
            Misfit(max_sigma0, _distance_m(ground, parts)),
            _misfit_m(parts),
            "absolute orientation",
        )
    except ConvergenceError as error:
        raise ConvergenceError(error.what + _worst(parts), where=error.where, remedy=error.remedy) from error
    return OrientedStrips(ground, tuple(parts), tuple(notes))


def _joined_and_oriented(
    ground: GroundOfStrips, tie_limit: float, control_limit: float, two_points: bool, *, weakly: bool
) -> tuple[FreeBlock, list[OrientedPart], list[GeometryError], list[Note]]:
    """Strips joined to components, each of them oriented; those that are not determined with their errors.

    Strips whose common points lie nearly on a line are joined only `weakly`: rigidly joined, they would be turned
    against each other by the errors of these points, magnified, and fit no control.
    """
    strips = ground.strips
    names = strips.strips.id.tolist()
    points, usable = pieces.strip_points_of(strips), pieces.usable_ties(strips)
    free = join_strips(points, names, point_ids=strips.points.id, active=usable, limit=tie_limit, weakly=weakly)
    parts, failed = list[OrientedPart](), list[GeometryError]()
    notes = list[Note]()
    for number, component in enumerate(free.components, 1):
        what = f"component {number} ({strip_names(component, names)})"
        try:
            part, more = oriented_part(ground, component, what, control_limit, two_points=two_points)
        except GeometryError as error:
            failed.append(error)
            continue
        parts.append(part)
        notes += [*more, *_height_notes(ground, part), *_part_notes(part)]
    # Strips tied weakly that stand on control of their own are meant to; without it they are lost.
    joined = [
        Note("note" if weak and not failed else "warning", f"not joined: {text}")
        for text, weak in zip(free.unjoined, free.weak)
    ]
    return free, parts, failed, [*joined, *notes]


def _distance_m(ground: GroundOfStrips, parts: Sequence[OrientedPart]) -> float:
    """From the projection centres to the points, mean of all components, m."""
    found = []
    for part in parts:
        centres = free_images(ground.strips, part.component)[0]
        found.append(part.result.ground_from_component.scale * pieces.distance_m(centres, part.component.xyz))
    return float(np.mean(found)) if found else 0.0


def _misfit_m(parts: Sequence[OrientedPart]) -> float:
    """The largest RMS by which control and positions, or strips, do not fit."""
    found = [rms_m(part.result.residual_m, part.result.active) for part in parts]
    for part in parts:
        ties = part.component.tied
        if ties is not None:
            found.append(part.result.ground_from_component.scale * rms_m(ties.residuals, ties.active))
    return max(found, default=0.0)


def _worst(parts: Sequence[OrientedPart]) -> str:
    """The given coordinates that are farthest from where the strips put them, for an error."""
    told = []
    for part in parts:
        off = np.linalg.norm(np.nan_to_num(part.result.residual_m), axis=1)
        rows = np.argsort(-off, kind="stable")[:WORST]
        names = names_of(part.result.tied, rows + part.result.tied.problem.n_ties)
        told += list(zip(off[rows].tolist(), names))
    worst = [f"{name} {m:.3g} m" for m, name in sorted(told, reverse=True)[:WORST] if m > 0]
    return f"; farthest off: {', '.join(worst)}" if worst else ""


def _height_notes(ground: GroundOfStrips, part: OrientedPart) -> list[Note]:
    component, control = part.component, ground.control
    x = component.xyz[np.searchsorted(component.point, control.point[part.control])]
    model = ground.origin_m + transform(part.result.ground_from_component, x)
    return height_notes(ground.block, control, part.control, model, part.what)


def _part_notes(part: OrientedPart) -> list[Note]:
    factor, tied = part.result.analysis.extrapolation, part.result.tied
    notes = [
        Note(
            "note",
            f"{part.what}: {len(part.control)} control points, {len(part.positions)} positions, errors of "
            f"control magnified up to {factor:.2g} times; it fits the ground to {tied.tau_m:.3f} m beyond the "
            "standard deviations of its points",
        )
    ]
    if factor > EXTRAPOLATION_WARNED:
        text = f"{part.what}: control is in one part of it; its errors are magnified up to {factor:.1f} times"
        notes.append(Note("warning", text))
    for what, adjusted in part.adjusted():
        notes += search_notes(adjusted, names_of, what)
    return notes


def _all_of(failed: Sequence[GeometryError], free: FreeBlock) -> GeometryError:
    texts = [error.what for error in failed] + [f"not joined: {text}" for text in free.unjoined[:10]]
    remedies = [failed[0].remedy]
    if len(free.components) > 1:
        remedies.append("or measure at least 3 points common to the strips, not on a line")
    if len(failed) < len(free.components):
        remedies.append("or set `components: largest` to orient the rest")
    return GeometryError("; ".join(texts), remedy="; ".join(remedies))


def absolute_solution(
    oriented: OrientedStrips, image_points: ImagePoints, method: str, *, tests: bool = False
) -> tuple[Solution, list[Note]]:
    """The Solution of oriented components, and which images are left out."""
    ground, parts = oriented.ground, oriented.parts
    block, strips = ground.block, ground.strips
    position, rotation = np.full((len(block.images), 3), np.nan), np.full((len(block.images), 3, 3), np.nan)
    points = np.full((len(block.points), 3), np.nan)
    transformations, parameters, residuals = [StripTransformations.empty()], [Parameters.empty()], [Residuals.empty()]
    suspects = [tables.carried(ground, parts)]
    for part in parts:
        to_ground, component = part.result.ground_from_component, part.component
        centres, rotations, image = free_images(strips, component)
        position[image] = transform(to_ground, centres) + ground.origin_m
        rotation[image] = to_ground.rotation @ rotations
        points[component.point] = transform(to_ground, component.xyz) + ground.origin_m
        for strip, pose in zip(component.strips, component.component_from_strip):
            name = str(strips.strips.id[strip])
            transformations.append(pieces.similarity_rows(name, compose(to_ground, pose), ground.origin_m))
        parameters += tables.precisions(ground, part)
        residuals += tables.residual_tables(part)
        suspects += tables.suspect_tables(ground, part)
    counts, sigma0 = tables.pooled(parts)
    uncontrolled = tables.uncontrolled_tables(ground, parts)
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
        uncontrolled=uncontrolled,
        tests=stacked([tests_of(tied) for part in parts for _, tied in part.adjusted()]) if tests else None,
    )
    return solution, pieces.left_out(block, np.isfinite(position).all(1))
