"""Residuals, suspects and parameters of the absolute orientation, as tables of a Solution."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.ground.control_by_rays import ControlByRays
from aatri.adapters.solution import stacked
from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips.tied_tables import (
    not_rejected,
    not_tested,
    residuals_of,
    seen_points,
    suspects_of,
    uncontrolled_kinds,
)
from aatri.adapters.uncontrolled_before import not_seen_since
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjusting.tied_adjustment import TiedResult
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Parameters, Residuals
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects
from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.geometry.similarity import Similarity
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.observed import Spread
from aatri.observations.ties import STRIP_TIE
from aatri.orientation.bodies.absolute import OrientedBody
from aatri.orientation.bodies.components import Component, strip_names

ROLE_NAME = "absolute_orientation"


@dataclass(frozen=True)
class OrientedPart:
    """A component on the ground."""

    what: str
    by_rays: ControlByRays
    result: OrientedBody

    @property
    def component(self) -> Component:
        """The component itself."""
        return self.by_rays.component

    def adjusted(self) -> list[tuple[str, TiedResult]]:
        """Its adjustments: to the ground, and of its strips to each other if they are several."""
        results: list[tuple[str, TiedResult]] = [(f"{self.what} to the ground", self.result.tied)]
        if self.component.tied is not None:
            results.append((f"{self.what}, strips to each other", self.component.tied))
        return results


def pooled(parts: Sequence[OrientedPart]) -> tuple[tuple[int, int], float]:
    """Observations and unknowns, and sigma0: the ratio to the a priori standard deviations, of all components."""
    observations, unknowns, squares = 0, 0, 0.0
    for part in parts:
        for _, tied in part.adjusted():
            squares += tied.sigma0**2 * tied.redundancy if tied.redundancy > 0 else 0.0
            observations, unknowns = observations + tied.counts[0], unknowns + tied.counts[1]
    redundancy = observations - unknowns
    return (observations, unknowns), float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan")


def precisions(strips: Strips, part: OrientedPart) -> list[Parameters]:
    """Deformation of a component towards the ground, and of its strips towards each other."""
    name = strip_names(part.component, strips.strips.id.tolist())
    rows = [pieces.precision_row(f"{name} to the ground", part.result.tied.tau_m)]
    if part.component.tied is not None:
        scale = part.result.ground_from_body.scale
        rows.append(pieces.precision_row(f"{name} to each other", scale * part.component.tied.tau_m))
    return rows


def residual_tables(part: OrientedPart) -> Iterator[Residuals]:
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


def carried(block: Block, strips: Strips, rays: ImagePointRows, parts: Sequence[OrientedPart]) -> Suspects:
    """Suspects of earlier stages but those that were tested here anew."""
    before = strips.suspects
    for part in parts:
        for _, tied in part.adjusted():
            before = not_tested(before, tied, strips.strips.id[part.component.strips])
        before = part.by_rays.suspects(before, block, rays, ROLE_NAME)
    return before


def suspect_tables(strips: Strips, part: OrientedPart) -> Iterator[Suspects]:
    """What was tested and not believed, or believed again: observations of the ground, and ties."""
    ties = part.component.tied
    yield suspects_of(part.result.tied, ROLE_NAME, part.result.began)
    if ties is not None:
        began = not_rejected(ties.problem.observed, {STRIP_TIE: strips.suspects})
        yield suspects_of(ties, ROLE_NAME, began, part.result.ground_from_body)


def uncontrolled_tables(block: Block, strips: Strips, parts: Sequence[OrientedPart]) -> Uncontrolled:
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
    return stacked([not_seen_since(strips.uncontrolled, block, seen_twice), *tables])
