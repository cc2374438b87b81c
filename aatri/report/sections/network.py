"""Geodetic observations and relative control of a Solution: the network drawn, its points, residuals, tests, shapes."""

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.report.drawing.network import ellipses, observed_lines
from aatri.report.sections.observations import of_the_network
from aatri.report.sections.parts import present
from aatri.report.sections.shapes import shapes_table
from aatri.report.sections.tables import Columns, PageTable, all_rows, axes, lengths
from aatri.units import decimals, digits


def tables(block: Block, solution: Solution) -> list[PageTable]:
    """Points, observations and shapes of a network or of relative control."""
    return present(_points(block, solution), of_the_network(solution), shapes_table(block, solution))


def _points(block: Block, solution: Solution) -> PageTable | None:
    """Coordinates of the observed points with standard deviations and ellipses."""
    rows = np.unique(observed_lines(block, solution)[0])
    points = solution.points
    rows = rows[np.isfinite(points.xyz_m[rows]).any(axis=1)]
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.einsum("nii->ni", points.covariance_m2))
    semi_axes_m, bearing_rad = ellipses(points.covariance_m2)
    bearing_deg = np.where(semi_axes_m[:, 0] > semi_axes_m[:, 1], np.degrees(bearing_rad), np.nan)
    columns: Columns = {
        "point": points.id,
        **axes(
            ("X m", "Y m", "Z m"),
            points.xyz_m,
            digits(decimals(float(np.median(sigma[sigma > 0])) if (sigma > 0).any() else np.nan)),
        ),
        **lengths("sX sY sZ", sigma),
        **lengths("ellipse_a b", semi_axes_m),
        "bearing deg": (bearing_deg, digits(0)),
    }
    return all_rows("Points of the network, with standard ellipses in plan", columns, rows, kept=True)
