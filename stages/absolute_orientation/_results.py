"""Residuals, suspects and parameters of the absolute orientation, as tables of a Solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adapters import strips as pieces
from aatri.observations.control import Control
from aatri.observations.positions import Positions
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Parameters, Residuals
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects
from aatri.orientation.free_block.absolute import OrientedComponent
from aatri.orientation.free_block.components import Component, strip_names

ROLE_NAME = "absolute_orientation"


@dataclass(frozen=True)
class Given:
    """What the Block knows about the ground."""

    block: Block
    strips: Strips
    control: Control
    positions: Positions
    origin: Float


@dataclass(frozen=True)
class OrientedPart:
    """A component on the ground; rows of control and positions are those of `Given`."""

    component: Component
    control: Int
    positions: Int
    result: OrientedComponent


def control_counts(found: OrientedPart) -> Int:
    """Coordinates of control and positions, and the seven parameters."""
    coordinates = np.isfinite(found.result.residual_m)[found.result.active]
    return np.array([int(coordinates.sum()), 7])


def precisions(given: Given, found: OrientedPart) -> list[Parameters]:
    """Deformation of a component towards the ground, and of its strips towards each other."""
    name = strip_names(found.component, given.strips.strips.id.tolist())
    rows = [pieces.precision_row(f"{name} to the ground", found.result.tied.tau_m)]
    if found.component.tied is not None:
        scale = found.result.ground_from_component.scale
        rows.append(pieces.precision_row(f"{name} to each other", scale * found.component.tied.tau_m))
    return rows


def _sigma(covariance: Float, given: Bool | bool = True) -> Float:
    return np.where(given, np.sqrt(np.einsum("nii->ni", covariance)), np.nan)


def residual_tables(given: Given, found: OrientedPart) -> list[Residuals]:
    """Component on the ground minus control, and the ties in metres along the ground axes."""
    block, n, result = given.block, len(found.control), found.result
    control, image = found.control, given.positions.image[found.positions]
    none = np.full(n, ""), np.full(len(image), "")
    tables = [
        assemble.residuals(
            "control", given.control.row[control], none[0], block.points.id[given.control.point[control]],
            result.residual_m[:n],
            _sigma(given.control.covariance_m2[control], given.control.given[control]),
            result.active[:n],
        ),
        assemble.residuals(
            "position", given.positions.row[found.positions], block.images.id[image], none[1],
            result.residual_m[n:], _sigma(given.positions.covariance_m2[found.positions]), result.active[n:],
        ),
    ]  # fmt: skip
    tied = found.component.tied
    if tied is not None:
        rows, to_ground = found.component.rows, result.ground_from_component
        table = given.strips.strip_points
        shared = np.bincount(table.point[rows])[table.point[rows]] > 1
        scale = np.empty(len(rows))
        for strip, pose in zip(found.component.strips, found.component.component_from_strip):
            scale[table.strip[rows] == strip] = to_ground.scale * pose.scale
        sigma = scale[:, None] * np.sqrt(np.einsum("nii->n", table.covariance[rows]) / 3)[:, None] * np.ones(3)
        value = to_ground.scale * tied.residual_m @ to_ground.rotation.T
        tables.append(assemble.residuals(
            "strip_tie", np.full(int(shared.sum()), -1), given.strips.strips.id[table.strip[rows[shared]]],
            block.points.id[table.point[rows[shared]]], value[shared], sigma[shared], tied.active[shared],
        ))  # fmt: skip
    return tables


def suspect_tables(given: Given, found: OrientedPart) -> list[Suspects]:
    """Rejected control, positions and ties."""
    block, result = given.block, found.result
    n, total = len(found.control), len(result.active)
    size, test = result.tied.size_m[total:], result.tied.test[total:]
    image = given.positions.image[found.positions]
    all_began = np.ones(total, dtype=bool)
    tables = [
        pieces.tested(
            kind="control", row=given.control.row[found.control], image=np.full(n, ""),
            point=block.points.id[given.control.point[found.control]], stage=ROLE_NAME,
            size_m=size[:n], test=test[:n], began=all_began[:n], active=result.active[:n],
        ),
        pieces.tested(
            kind="position", row=given.positions.row[found.positions], image=block.images.id[image],
            point=np.full(len(image), ""), stage=ROLE_NAME,
            size_m=size[n:], test=test[n:], began=all_began[n:], active=result.active[n:],
        ),
    ]  # fmt: skip
    tied = found.component.tied
    if tied is not None:
        table, rows = given.strips.strip_points, found.component.rows
        tables.append(pieces.tested(
            kind="strip_tie", row=np.full(len(rows), -1), image=given.strips.strips.id[table.strip[rows]],
            point=block.points.id[table.point[rows]], stage=ROLE_NAME,
            size_m=result.ground_from_component.scale * tied.size_m, test=tied.test,
            began=np.ones(len(rows), dtype=bool), active=tied.active,
        ))  # fmt: skip
    return tables
