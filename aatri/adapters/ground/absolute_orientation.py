"""Absolute orientation of the strips of a block: artifacts to components, and components to a Solution."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adapters.ground import absolute_tables as tables
from aatri.adapters.ground.absolute_datum import free_images, oriented_part
from aatri.adapters.ground.absolute_tables import OrientedPart
from aatri.adapters.ground.control_fit import height_notes
from aatri.adapters.ground.ground_observed import GroundObserved
from aatri.adapters.solution import stacked
from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips.tied_tables import components_of, names_of, tests_of
from aatri.adjustment.threads import thread_control
from aatri.arrays import Bool, Float
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Parameters, Residuals, Solution, StripTransformations
from aatri.artifacts.strips import Strips
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.similarity import compose, transform
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bodies.absolute import OrientationRules, OrientedBody
from aatri.orientation.bodies.components import FreeBlock, join_strips, strip_names
from aatri.orientation.bodies.deformation import Misfit, rms_m, search_notes, sigma0_notes

EXTRAPOLATION_WARNED = 3.0

WORST = 5
"""So many observations are named where strips and control do not fit."""


@dataclass(frozen=True)
class OrientedStrips:
    """Components on the ground, reduced to the origin, and what there is to say of them."""

    block: Block
    strips: Strips
    origin_m: Float
    parts: tuple[OrientedPart, ...]
    notes: tuple[Note, ...]


def orient_strips(
    block: Block,
    ground: GroundObserved,
    strips: Strips,
    *,
    tie_limit: float,
    control_limit: float,
    two_points: bool,
    every_component: bool,
    max_sigma0: float | None,
) -> OrientedStrips:
    """Join strips to components and orient each.

    Parameters
    ----------
    block : Block
        In the frame of the adjustment.
    ground : GroundObserved
    strips : Strips
    tie_limit, control_limit : float
        Test statistics of wrong ties, and of what is wrong on the ground.
    two_points : bool
        Each starts from two control points.
    every_component : bool
        A component without a datum is an error; else it is left out with a warning.
    max_sigma0 : float or None

    Raises
    ------
    GeometryError
        If a component is not determined, or none is.
    ConvergenceError
        If an adjustment does not converge, or its result does not fit.
    """
    rules = OrientationRules(control_limit, two_points)
    with thread_control().limit(limits=1, user_api="blas"):  # long matrices of three columns: threads only wait
        free, parts, failed, notes = _joined_and_oriented(ground, strips, rules, tie_limit, weakly=False)
        if any(free.weak) and failed:  # not each has control enough of its own
            free, parts, failed, notes = _joined_and_oriented(ground, strips, rules, tie_limit, weakly=True)
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
            pieces.most_models(strips),
            Misfit(max_sigma0, _distance_m(strips, parts)),
            _misfit_m(parts),
            "absolute orientation",
        )
    except ConvergenceError as error:
        raise ConvergenceError(error.what + _worst(parts), where=error.where, remedy=error.remedy) from error
    return OrientedStrips(block, strips, ground.origin_m, tuple(parts), tuple(notes))


def _joined_and_oriented(
    ground: GroundObserved, strips: Strips, rules: OrientationRules, tie_limit: float, *, weakly: bool
) -> tuple[FreeBlock, list[OrientedPart], list[GeometryError], list[Note]]:
    """Strips joined to components, each of them oriented; those that are not determined with their errors.

    Strips whose common points lie nearly on a line are joined only `weakly`: rigidly joined, they would be turned
    against each other by the errors of these points, magnified, and fit no control.
    """
    names = strips.strips.id.tolist()
    points, usable = pieces.strip_points_of(strips), pieces.usable_ties(strips)
    free = join_strips(points, names, point_ids=strips.points.id, active=usable, limit=tie_limit, weakly=weakly)
    parts, failed = list[OrientedPart](), list[GeometryError]()
    notes = list[Note]()
    for number, component in enumerate(free.components, 1):
        what = f"component {number} ({strip_names(component, names)})"
        try:
            part, more = oriented_part(ground, strips, component, what, rules)
        except GeometryError as error:
            failed.append(error)
            continue
        parts.append(part)
        notes += [*more, *height_notes(ground.block, part.result, what), *_part_notes(part)]
    # Strips tied weakly that stand on control of their own are meant to; without it they are lost.
    joined = [
        Note("note" if weak and not failed else "warning", f"not joined: {text}")
        for text, weak in zip(free.unjoined, free.weak)
    ]
    return free, parts, failed, [*joined, *notes]


def _distance_m(strips: Strips, parts: Sequence[OrientedPart]) -> float:
    """From the projection centres to the points, mean of all components, m."""
    found = []
    for part in parts:
        centres = free_images(strips, part.component)[0]
        found.append(part.result.ground_from_body.scale * pieces.distance_m(centres, part.component.xyz))
    return float(np.mean(found)) if found else 0.0


def _misfit_m(parts: Sequence[OrientedPart]) -> float:
    """The largest RMS by which control and positions, or strips, do not fit."""
    found = [rms_m(*_off(part.result)) for part in parts]
    for part in parts:
        ties = part.component.tied
        if ties is not None:
            found.append(part.result.ground_from_body.scale * rms_m(ties.residuals, ties.active))
    return max(found, default=0.0)


def _off(result: OrientedBody) -> tuple[Float, Bool]:
    """Body on the ground minus given coordinates, NaN where not given; and which of them are used."""
    places = result.places
    return np.where(places.given, places.xyz - places.observed_m, np.nan), result.tied.active[places.row]


def _worst(parts: Sequence[OrientedPart]) -> str:
    """The given coordinates that are farthest from where the strips put them, for an error."""
    told = []
    for part in parts:
        off = np.linalg.norm(np.nan_to_num(_off(part.result)[0]), axis=1)
        rows = np.argsort(-off, kind="stable")[:WORST]
        told += list(zip(off[rows].tolist(), names_of(part.result.tied, part.result.places.row[rows])))
    worst = [f"{name} {m:.3g} m" for m, name in sorted(told, reverse=True)[:WORST] if m > 0]
    return f"; farthest off: {', '.join(worst)}" if worst else ""


def _part_notes(part: OrientedPart) -> list[Note]:
    factor, tied = part.result.analysis.extrapolation, part.result.tied
    kinds = Counter(o.kind for o in tied.problem.ground for _ in range(len(o)))
    counts = [f"{kinds.pop(kind, 0)} {name}" for kind, name in ((CONTROL, "control points"), (POSITION, "positions"))]
    counts += [f"{n} of kind {kind}" for kind, n in kinds.items()]
    notes = [
        Note(
            "note",
            f"{part.what}: {', '.join(counts)}, errors of control "
            f"magnified up to {factor:.2g} times; it fits the ground to {tied.tau_m:.3f} m beyond the "
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
    block, strips, parts = oriented.block, oriented.strips, oriented.parts
    position, rotation = np.full((len(block.images), 3), np.nan), np.full((len(block.images), 3, 3), np.nan)
    points = np.full((len(block.points), 3), np.nan)
    transformations, parameters, residuals = [StripTransformations.empty()], [Parameters.empty()], [Residuals.empty()]
    suspects = [tables.carried(strips, parts)]
    for part in parts:
        to_ground, component = part.result.ground_from_body, part.component
        centres, rotations, image = free_images(strips, component)
        position[image] = transform(to_ground, centres) + oriented.origin_m
        rotation[image] = to_ground.rotation @ rotations
        points[component.point] = transform(to_ground, component.xyz) + oriented.origin_m
        for strip, pose in zip(component.strips, component.component_from_strip):
            name = str(strips.strips.id[strip])
            transformations.append(pieces.similarity_rows(name, compose(to_ground, pose), oriented.origin_m))
        parameters += tables.precisions(strips, part)
        residuals += tables.residual_tables(part)
        suspects += tables.suspect_tables(strips, part)
    counts, sigma0 = tables.pooled(parts)
    uncontrolled = tables.uncontrolled_tables(block, strips, parts)
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
        components=stacked([components_of(tied) for part in parts for _, tied in part.adjusted()]) if tests else None,
    )
    return solution, pieces.left_out(block, np.isfinite(position).all(1))
