"""Residuals, suspects and parameters of the absolute orientation, as tables of a Solution."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adapters.ground.initial_observed import SeenAttitudes
from aatri.adapters.solution import stacked
from aatri.adapters.strips import strips as pieces
from aatri.adapters.uncontrolled_before import not_seen_since, of_observations
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Parameters, Residuals
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects
from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.observations.control import Control
from aatri.observations.positions import Positions
from aatri.orientation.free_block.absolute import OrientedComponent
from aatri.orientation.free_block.components import Component, strip_names
from aatri.orientation.free_block.tied_adjustment import TiedResult

ROLE_NAME = "absolute_orientation"


@dataclass(frozen=True)
class Ground:
    """What the Block knows about the ground."""

    block: Block
    strips: Strips
    control: Control
    positions: Positions
    origin: Float
    attitudes: SeenAttitudes | None


@dataclass(frozen=True)
class OrientedPart:
    """A component on the ground; rows of control and positions as in `Ground`, `began` are those not yet rejected."""

    what: str
    component: Component
    control: Int
    positions: Int
    began: Bool
    result: OrientedComponent

    def adjusted(self) -> list[tuple[str, TiedResult[Any]]]:
        """Its adjustments: to the ground, and of its strips to each other if they are several."""
        found: list[tuple[str, TiedResult[Any]]] = [(f"{self.what} to the ground", self.result.tied)]
        if self.component.tied is not None:
            found.append((f"{self.what}, strips to each other", self.component.tied))
        return found


def pooled(parts: Sequence[OrientedPart]) -> tuple[tuple[int, int], float]:
    """Observations and unknowns, and sigma0: the ratio to the a priori standard deviations, of all components."""
    observations, unknowns, squares = 0, 0, 0.0
    for part in parts:
        for k, (_, tied) in enumerate(part.adjusted()):
            redundancy = tied.observations - tied.unknowns
            squares += tied.sigma0**2 * redundancy if redundancy > 0 else 0.0
            if k:
                observations, unknowns = observations + tied.observations, unknowns + tied.unknowns
            else:  # the component's points are no observations of their own: given coordinates against seven parameters
                given = np.isfinite(part.result.residual_m)[part.result.active]
                turned = 3 * int(tied.active[2 * len(part.result.active) :].sum())
                observations, unknowns = observations + int(given.sum()) + turned, unknowns + 7
    redundancy = observations - unknowns
    return (observations, unknowns), float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan")


def precisions(ground: Ground, part: OrientedPart) -> list[Parameters]:
    """Deformation of a component towards the ground, and of its strips towards each other."""
    name = strip_names(part.component, ground.strips.strips.id.tolist())
    rows = [pieces.precision_row(f"{name} to the ground", part.result.tied.tau_m)]
    if part.component.tied is not None:
        scale = part.result.ground_from_component.scale
        rows.append(pieces.precision_row(f"{name} to each other", scale * part.component.tied.tau_m))
    return rows


def observation_names(ground: Ground, part: OrientedPart) -> list[Callable[[Int], list[str]]]:
    """What messages call some of the observations of each adjustment of a part."""
    block, strips = ground.block, ground.strips
    control = [f"control point {p}" for p in block.points.id[ground.control.point[part.control]]]
    images = [f"position of image {i}" for i in block.images.id[ground.positions.image[part.positions]]]
    table, rows = strips.strip_points, part.component.rows
    turned = [] if ground.attitudes is None else block.images.id[ground.attitudes.image].tolist()
    attitudes = [f"attitude of image {i}" for i in turned]
    twice = 2 * (control + images) + attitudes

    def of_ties(some: Int) -> list[str]:
        names = zip(block.points.id[table.point[rows[some]]], strips.strips.id[table.strip[rows[some]]])
        return [f"point {p} in strip {s}" for p, s in names]

    def of_given(some: Int) -> list[str]:
        return [twice[k] for k in some.tolist()]

    return [of_given] if part.component.tied is None else [of_given, of_ties]


def _sigma(covariance: Float, given: Bool) -> Float:
    return np.where(given, np.sqrt(np.einsum("nii->ni", covariance)), np.nan)


def residual_tables(ground: Ground, part: OrientedPart) -> list[Residuals]:
    """Component on the ground minus control, and the ties in metres along the ground axes."""
    block, n, result = ground.block, len(part.control), part.result
    control, image = part.control, ground.positions.image[part.positions]
    none = np.full(n, ""), np.full(len(image), "")
    tables = [
        assemble.residuals(
            "control", ground.control.row[control], none[0], block.points.id[ground.control.point[control]],
            result.residual_m[:n], _sigma(ground.control.covariance_m2[control], ground.control.given[control]),
            result.active[:n],
        ),
        assemble.residuals(
            "position", ground.positions.row[part.positions], block.images.id[image], none[1],
            result.residual_m[n:],
            _sigma(ground.positions.covariance_m2[part.positions], ground.positions.given[part.positions]),
            result.active[n:],
        ),
    ]  # fmt: skip
    tied = part.component.tied
    if tied is not None:
        rows, to_ground = part.component.rows, result.ground_from_component
        table = ground.strips.strip_points
        shared = np.bincount(table.point[rows])[table.point[rows]] > 1
        scale = np.empty(len(rows))
        for strip, pose in zip(part.component.strips, part.component.component_from_strip):
            scale[table.strip[rows] == strip] = to_ground.scale * pose.scale
        sigma = scale[:, None] * np.sqrt(np.einsum("nii->n", table.covariance[rows]) / 3)[:, None] * np.ones(3)
        value = to_ground.scale * tied.residual_m @ to_ground.rotation.T
        tables.append(assemble.residuals(
            "strip_tie", np.full(int(shared.sum()), -1), ground.strips.strips.id[table.strip[rows[shared]]],
            block.points.id[table.point[rows[shared]]], value[shared], sigma[shared], tied.active[shared],
        ))  # fmt: skip
    return tables


def carried(ground: Ground, parts: Sequence[OrientedPart]) -> Suspects:
    """Suspects of earlier stages but those that were tested here anew."""
    before = ground.strips.suspects
    again = np.zeros(len(before.kind), dtype=bool)
    for part in parts:
        again |= (before.kind == "control") & np.isin(before.row, ground.control.row[part.control])
        again |= (before.kind == "position") & np.isin(before.row, ground.positions.row[part.positions])
        if part.component.tied is not None:
            strips = ground.strips.strips.id[part.component.strips]
            again |= (before.kind == "strip_tie") & np.isin(before.image, strips)
    return before.take(~again)


def suspect_tables(ground: Ground, part: OrientedPart) -> list[Suspects]:
    """Control, positions and ties that were tested and not believed, or believed again."""
    block, result = ground.block, part.result
    n, total = len(part.control), len(result.active)
    tied = result.tied
    mine = slice(total, 2 * total)  # behind the component's points, before attitudes
    size, test, above = tied.size_m[mine], tied.test[mine], tied.above[mine]
    image = ground.positions.image[part.positions]
    tables = [
        pieces.tested(
            kind="control", row=ground.control.row[part.control], image=np.full(n, ""),
            point=block.points.id[ground.control.point[part.control]], stage=ROLE_NAME,
            size_m=size[:n], test=test[:n], began=part.began[:n], active=result.active[:n], above=above[:n],
        ),
        pieces.tested(
            kind="position", row=ground.positions.row[part.positions], image=block.images.id[image],
            point=np.full(len(image), ""), stage=ROLE_NAME,
            size_m=size[n:], test=test[n:], began=part.began[n:], active=result.active[n:], above=above[n:],
        ),
    ]  # fmt: skip
    ties = part.component.tied
    if ties is not None:
        table, rows = ground.strips.strip_points, part.component.rows
        tables.append(pieces.tested(
            kind="strip_tie", row=np.full(len(rows), -1), image=ground.strips.strips.id[table.strip[rows]],
            point=block.points.id[table.point[rows]], stage=ROLE_NAME,
            size_m=result.ground_from_component.scale * ties.size_m, test=ties.test,
            began=pieces.usable_ties(ground.strips)[rows], active=ties.active, above=ties.above,
        ))  # fmt: skip
    return tables


def uncontrolled_tables(ground: Ground, parts: Sequence[OrientedPart]) -> Uncontrolled:
    """Image points that no second model, strip or control has seen; control, positions and ties nothing controls."""
    block, table = ground.block, ground.strips.strip_points
    held, tables = np.zeros(len(block.points), dtype=bool), list[Uncontrolled]()
    for part in parts:
        result, n, control = part.result, len(part.control), ground.control
        rows, ties = part.component.rows, part.component.tied
        active = np.ones(len(rows), dtype=bool) if ties is None else ties.active
        held |= np.bincount(table.point[rows[active]], minlength=len(block.points)) > 1
        held[control.point[part.control[result.active[:n]]]] = True
        if ties is not None:
            names = ground.strips.strips.id[table.strip[rows]], block.points.id[table.point[rows]]
            few, least, direction = ties.uncontrolled
            on_ground = direction @ result.ground_from_component.rotation.T
            tables.append(of_observations((few, least, on_ground), np.full(len(rows), "strip_tie"),
                                          np.full(len(rows), -1), *names))  # fmt: skip
        total, image = len(result.active), ground.positions.image[part.positions]
        few, least, direction = result.tied.uncontrolled
        given = few >= total  # the component's points are no observations of their own
        tables.append(of_observations(
            (few[given] - total, least[given], direction[given]),
            np.repeat(["control", "position"], [n, len(image)]),
            np.concatenate([control.row[part.control], ground.positions.row[part.positions]]),
            np.concatenate([np.full(n, ""), block.images.id[image]]),
            np.concatenate([block.points.id[control.point[part.control]], np.full(len(image), "")]),
        ))  # fmt: skip
    return stacked([not_seen_since(ground.strips.uncontrolled, block, held), *tables])
