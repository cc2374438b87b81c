"""Transformations, residuals and suspects of the strip block adjustment, as tables of a Solution."""

from dataclasses import dataclass

import numpy as np

from aatri.adapters.strips import oriented_strips as pieces
from aatri.arrays import Float, Int
from aatri.artifacts.solution import StripTransformations
from aatri.artifacts.strips import Strips
from aatri.geometry.similarity import Similarity
from aatri.geometry.strip_bases import StripAxes
from aatri.observations.control import Control
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.strip_polynomials import StripPolynomials


@dataclass(frozen=True)
class StripsOnGround:
    """Oriented strips on the ground, reduced to the origin; `rows` are those of the strip points in the Strips."""

    origin: Float
    strips: Int
    similarity: list[Similarity]
    axes: list[StripAxes]
    rows: Int
    points: BodyPoints
    control: Control


def transformation_tables(
    result: StripPolynomials, ground: StripsOnGround, strips: Strips, sigma_m: Float
) -> list[StripTransformations]:
    """Per strip: the similarity, the axes, and the coefficients a of dU, b of dV, c of dW in metres."""
    tables = []
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
            of_part = np.flatnonzero((result.basis.part == part) & (result.basis.degree <= degree))
            names = tuple(result.basis.labels[c] for c in of_part)
            values, sigma = result.coefficients_m[k, of_part], sigma_m[k, of_part]
            tables.append(pieces.transformation_rows(name, result.basis.model(degree), names, values, sigma))
    return tables
