"""Transformations, residuals and suspects of the strip block adjustment, as tables of a Solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adapters.strips import strips as pieces
from aatri.adapters.uncontrolled_before import not_seen_since, of_observations
from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Residuals, StripTransformations
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects
from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.geometry.polynomials import StripAxes
from aatri.geometry.similarity import Similarity
from aatri.geometry.vectors import finite_rows
from aatri.observations.control import Control
from aatri.orientation.free_block.component_growth import StripPoints
from aatri.orientation.free_block.strip_polynomials import StripPolynomials

ROLE_NAME = "strip_adjustment"


@dataclass(frozen=True)
class StripsOnGround:
    """Oriented strips on the ground, reduced to the origin; `rows` are those of the strip points in the Strips."""

    origin: Float
    strips: Int
    similarity: list[Similarity]
    axes: list[StripAxes]
    rows: Int
    points: StripPoints
    control: Control


def tie_names(block: Block, strips: Strips, ground: StripsOnGround) -> tuple[Text, Text]:
    """Ids of strip and point of every strip point."""
    return strips.strips.id[ground.strips[ground.points.strip]], block.points.id[ground.points.point]


def transformation_tables(
    result: StripPolynomials, ground: StripsOnGround, strips: Strips, sigma_m: Float
) -> StripTransformations:
    """Per strip: the similarity, the axes, and the coefficients a of dU, b of dV, c of dW in metres."""
    tables = [StripTransformations.empty()]
    for k, strip in enumerate(ground.strips):
        name, axes = str(strips.strips.id[strip]), ground.axes[k]
        tables.append(pieces.similarity_rows(name, ground.similarity[k], ground.origin))
        plan, height = (int(degree) for degree in result.degree[k])
        tables.append(
            pieces.transformation_rows(
                name,
                result.basis.model(max(plan, height)),
                ("origin_X_m", "origin_Y_m", "origin_Z_m", "half_range_U_m", "half_range_V_m", "azimuth_of_U_rad"),
                [
                    *(axes.origin_m + ground.origin),
                    *axes.half_range_m,
                    np.arctan2(axes.ground_from_axes[0, 0], axes.ground_from_axes[1, 0]),
                ],
            )
        )
        for part, degree in enumerate((plan, height)):
            mine = np.flatnonzero((result.basis.part == part) & (result.basis.degree <= degree))
            names = tuple(result.basis.labels[c] for c in mine)
            values, sigma = result.coefficients_m[k, mine], sigma_m[k, mine]
            tables.append(pieces.transformation_rows(name, result.basis.model(degree), names, values, sigma))
    return assemble.stacked(tables)


def residual_tables(block: Block, strips: Strips, ground: StripsOnGround, result: StripPolynomials) -> Residuals:
    """Adjusted minus given at control, the strips' mean minus the single strip at ties."""
    n, control = len(ground.rows), ground.control
    given = control.given
    strip, point = tie_names(block, strips, ground)
    shared = np.flatnonzero(np.bincount(ground.points.point, minlength=len(block.points))[ground.points.point] > 1)
    at_control = result.point_m[control.point] - control.xyz_m
    known = np.flatnonzero(finite_rows(result.point_m[control.point]))
    return assemble.stacked([
        assemble.residuals(
            "control", control.row[known], np.full(len(known), ""), block.points.id[control.point[known]],
            np.where(given, at_control, np.nan)[known],
            np.where(given, np.sqrt(np.einsum("nii->ni", control.covariance_m2)), np.nan)[known],
            result.tied.active[n:][known],
        ),
        assemble.residuals(
            "strip_tie", np.full(len(shared), -1), strip[shared], point[shared],
            (result.point_m[ground.points.point] - result.corrected_m)[shared],
            np.sqrt(np.einsum("nii->ni", ground.points.covariance))[shared], result.tied.active[:n][shared],
        ),
    ])  # fmt: skip


def suspect_tables(
    block: Block,
    strips: Strips,
    before: Suspects,
    ground: StripsOnGround,
    result: StripPolynomials,
    began: Bool,
) -> Suspects:
    """Suspects of earlier stages, with the ties and control tested here anew."""
    n, control = len(ground.rows), ground.control
    strip, point = tie_names(block, strips, ground)
    tied, m = result.tied, len(control.row)
    again = (before.kind == "strip_tie") & np.isin(before.image, strips.strips.id[ground.strips])
    again |= (before.kind == "control") & np.isin(before.row, control.row)
    return assemble.stacked([
        before.take(~again),
        pieces.tested(kind="strip_tie", row=np.full(n, -1), image=strip, point=point, stage=ROLE_NAME,
                      size_m=tied.size_m[:n], test=tied.test[:n], began=began[:n], active=tied.active[:n],
                      above=tied.above[:n]),
        pieces.tested(kind="control", row=control.row, image=np.full(m, ""), point=block.points.id[control.point],
                      stage=ROLE_NAME, size_m=tied.size_m[n:], test=tied.test[n:], began=began[n:],
                      active=tied.active[n:], above=tied.above[n:]),
    ])  # fmt: skip


def uncontrolled_tables(block: Block, strips: Strips, ground: StripsOnGround, result: StripPolynomials) -> Uncontrolled:
    """Image points that no second model, strip or control has seen; ties and control that the others do not control."""
    n, control, active = len(ground.rows), ground.control, result.tied.active
    strip, point = tie_names(block, strips, ground)
    held = np.bincount(ground.points.point[active[:n]], minlength=len(block.points)) > 1
    held[control.point[active[n:]]] = True
    m = len(control.row)
    return assemble.stacked([
        not_seen_since(strips.uncontrolled, block, held),
        of_observations(
            result.tied.uncontrolled, np.repeat(["strip_tie", "control"], [n, m]),
            np.concatenate([np.full(n, -1), control.row]), np.concatenate([strip, np.full(m, "")]),
            np.concatenate([point, block.points.id[control.point]]),
        ),
    ])  # fmt: skip
