"""Residuals, suspects and parameters of the absolute orientation, as tables of a Solution."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.ground.initial_observed import Ground
from aatri.adapters.solution import stacked
from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips.tied_tables import (
    component_residuals,
    not_rejected,
    not_tested,
    residuals_of,
    suspects_of,
    uncontrolled_kinds,
)
from aatri.adapters.uncontrolled_before import not_seen_since
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjusting.tied_adjustment import TiedResult
from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Parameters, Residuals
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects
from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.geometry.similarity import Similarity
from aatri.observations.control import KIND as CONTROL
from aatri.observations.observed import Spread
from aatri.observations.positions import KIND as POSITION
from aatri.observations.ties import STRIP_TIE
from aatri.orientation.bodies.absolute import OrientedComponent
from aatri.orientation.bodies.components import Component, strip_names

ROLE_NAME = "absolute_orientation"


@dataclass(frozen=True)
class GroundOfStrips(Ground):
    """What is known of the ground of strips, and these."""

    block: Block
    strips: Strips


@dataclass(frozen=True)
class OrientedPart:
    """A component on the ground; rows of control and positions as in the ground."""

    what: str
    component: Component
    control: Int
    positions: Int
    result: OrientedComponent

    def adjusted(self) -> list[tuple[str, TiedResult]]:
        """Its adjustments: to the ground, and of its strips to each other if they are several."""
        found: list[tuple[str, TiedResult]] = [(f"{self.what} to the ground", self.result.tied)]
        if self.component.tied is not None:
            found.append((f"{self.what}, strips to each other", self.component.tied))
        return found


def pooled(parts: Sequence[OrientedPart]) -> tuple[tuple[int, int], float]:
    """Observations and unknowns, and sigma0: the ratio to the a priori standard deviations, of all components."""
    observations, unknowns, squares = 0, 0, 0.0
    for part in parts:
        for k, (_, tied) in enumerate(part.adjusted()):
            squares += tied.sigma0**2 * tied.redundancy if tied.redundancy > 0 else 0.0
            if k:
                observations, unknowns = observations + tied.counts[0], unknowns + tied.counts[1]
            else:  # the component's points are no observations of their own: given coordinates against seven parameters
                given = np.isfinite(part.result.residual_m)[part.result.active]
                turned = 3 * int(tied.active[2 * len(part.result.active) :].sum())
                observations, unknowns = observations + int(given.sum()) + turned, unknowns + 7
    redundancy = observations - unknowns
    return (observations, unknowns), float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan")


def precisions(ground: GroundOfStrips, part: OrientedPart) -> list[Parameters]:
    """Deformation of a component towards the ground, and of its strips towards each other."""
    name = strip_names(part.component, ground.strips.strips.id.tolist())
    rows = [pieces.precision_row(f"{name} to the ground", part.result.tied.tau_m)]
    if part.component.tied is not None:
        scale = part.result.ground_from_component.scale
        rows.append(pieces.precision_row(f"{name} to each other", scale * part.component.tied.tau_m))
    return rows


def residual_tables(part: OrientedPart) -> Iterator[Residuals]:
    """Component on the ground minus what is observed, and the ties in metres along the ground axes."""
    yield component_residuals(part.result.tied)
    if (ties := part.component.tied) is not None:
        to = part.result.ground_from_component
        made = residuals_of(replace(ties, observations=tuple(_on_ground(found, to) for found in ties.observations)))
        yield replace(made, residual=to.scale * made.residual @ to.rotation.T)


def _on_ground(found: AdjustedObservations, to: Similarity) -> AdjustedObservations:
    """Ties of a component, with their standard deviations on the ground."""
    spread = found.observed.spread
    assert spread is not None
    turned = Spread(to.scale**2 * spread.values, to.rotation @ spread.vectors, spread.at)
    return replace(found, observed=replace(found.observed, spread=turned))


def carried(ground: GroundOfStrips, parts: Sequence[OrientedPart]) -> Suspects:
    """Suspects of earlier stages but those that were tested here anew."""
    before = ground.strips.suspects
    for part in parts:
        for _, tied in part.adjusted():
            before = not_tested(before, tied, ground.strips.strips.id[part.component.strips])
    return before


def suspect_tables(ground: GroundOfStrips, part: OrientedPart) -> Iterator[Suspects]:
    """Control, positions and ties that were tested and not believed, or believed again."""
    tied, ties = part.result.tied, part.component.tied
    before = dict.fromkeys((CONTROL, POSITION, STRIP_TIE), ground.strips.suspects)
    yield suspects_of(tied, ROLE_NAME, not_rejected(tied.problem.observed, before))
    if ties is not None:
        began = not_rejected(ties.problem.observed, before)
        yield suspects_of(ties, ROLE_NAME, began, part.result.ground_from_component)


def uncontrolled_tables(ground: GroundOfStrips, parts: Sequence[OrientedPart]) -> Uncontrolled:
    """Image points that no second model, strip or control has seen; control, positions and ties nothing controls."""
    block, table = ground.block, ground.strips.strip_points
    held, tables = np.zeros(len(block.points), dtype=bool), list[Uncontrolled]()
    for part in parts:
        result, rows, ties = part.result, part.component.rows, part.component.tied
        active = np.ones(len(rows), dtype=bool) if ties is None else ties.active
        held |= np.bincount(table.point[rows[active]], minlength=len(block.points)) > 1
        held[ground.control.point[part.control[result.active[: len(part.control)]]]] = True
        if ties is not None:
            tables.append(uncontrolled_kinds(ties, result.ground_from_component.rotation))
        tables.append(uncontrolled_kinds(result.tied))
    return stacked([not_seen_since(ground.strips.uncontrolled, block, held), *tables])
