"""Geodetic observations and relative control of a Solution: the network drawn, its points, residuals, tests, shapes."""

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.report.drawing.network import ellipses, network_picture, observed_lines
from aatri.report.sections.observations import of_the_network
from aatri.report.sections.parts import PageSection, present
from aatri.report.sections.shapes import shapes_table
from aatri.report.sections.tables import Columns, PageTable, all_rows, axes
from aatri.report.view.numbers import digits, metres


def show(made: PageSection, block: Block | None, solution: Solution) -> None:
    """Add what there is of a network or of relative control."""
    if block is None or not (len(block.geodetic) or len(block.relative_control)):
        return
    made.tables.extend(present(_points(block, solution), of_the_network(solution), shapes_table(block, solution)))
    made.pictures.extend(present(network_picture(block, solution)))


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
        **axes(("X m", "Y m", "Z m"), points.xyz_m, digits(4)),
        **axes(("sX m", "sY m", "sZ m"), sigma, metres),
        **axes(("ellipse a m", "b m"), semi_axes_m, metres),
        "bearing deg": (bearing_deg, digits(0)),
    }
    return all_rows("Points of the network, with standard ellipses in plan", columns, rows)
