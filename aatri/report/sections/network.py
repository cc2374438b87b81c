"""Geodetic observations and relative control of a Solution: the network drawn, its points, residuals, tests, shapes."""

from __future__ import annotations

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.report.drawing.network import ellipses, network_picture, observed_lines
from aatri.report.numbers import DASH, metres
from aatri.report.sections import tables
from aatri.report.sections.observations import of_the_network
from aatri.report.sections.parts import Section, present
from aatri.report.sections.shapes import shapes_table
from aatri.report.sections.tables import Cells, PageTable


def show(made: Section, block: Block | None, solution: Solution) -> None:
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
    if not len(rows):
        return None
    C = points.covariance_m2[rows]
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.einsum("nii->ni", C))
    axes, bearing = ellipses(C)
    columns: Cells = {"point": lambda k: str(points.id[rows[k]])}
    columns |= {f"{a} m": tables.formatted(points.xyz_m[rows, i], _tenths) for i, a in enumerate("XYZ")}
    columns |= {f"s{a} m": tables.formatted(sigma[:, i], metres) for i, a in enumerate("XYZ")}
    columns["ellipse a m"] = tables.formatted(axes[:, 0], metres)
    columns["b m"] = tables.formatted(axes[:, 1], metres)
    columns["bearing deg"] = lambda k: f"{np.degrees(bearing[k]):.0f}" if axes[k, 0] > axes[k, 1] else DASH
    return tables.all_rows("Points of the network, with standard ellipses in plan", rows, columns, 1)


def _tenths(value: float) -> str:
    return DASH if value != value else f"{value:.4f}"
