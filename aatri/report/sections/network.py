"""Geodetic observations and relative control of a Solution: the network drawn, its points, residuals and tests."""

from __future__ import annotations

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.report.drawing.network import ellipses, network_picture, observed_lines
from aatri.report.numbers import DASH, metres, number
from aatri.report.sections import tables
from aatri.report.sections.parts import Section, present
from aatri.report.sections.tables import Cells, PageTable

OF_IMAGES = ("image_point", "control", "position", "attitude")
"""Kinds of observation that have tables and pictures of their own."""


def show(made: Section, block: Block | None, solution: Solution) -> None:
    """Add what there is of a network or of relative control."""
    if block is None or not (len(block.geodetic) or len(block.relative_control)):
        return
    made.tables.extend(present(_points(block, solution), _observations(solution)))
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


def _observations(solution: Solution) -> PageTable | None:
    """Residuals of geodetic observations and relative control, the largest first."""
    residuals, tests = solution.residuals, solution.tests
    mine = ~np.isin(residuals.kind, OF_IMAGES) & np.isfinite(residuals.residual[:, 0]) & (residuals.point != "")
    rows = np.flatnonzero(mine)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.abs(residuals.residual) / np.where(residuals.sigma > 0, residuals.sigma, np.nan)
    rows = rows[np.argsort(-np.nan_to_num(np.fmax.reduce(size[rows], axis=1)), kind="stable")]
    columns: Cells = {
        "observation": lambda k: str(residuals.kind[rows[k]]),
        "between": lambda k: str(residuals.point[rows[k]]),
        "used": lambda k: "yes" if residuals.active[rows[k]] else "rejected",
        "unit": lambda k: str(residuals.unit[rows[k]]),
        "residual": lambda k: _each(residuals.residual[rows[k]]),
        "sigma": lambda k: _each(residuals.sigma[rows[k]]),
    }
    if tests is not None:
        columns |= {
            "redundancy": lambda k: _each(tests.redundancy[rows[k]]),
            "w": lambda k: _each(tests.test[rows[k]]),
        }
    return tables.all_rows("Geodetic observations and relative control, the largest residuals first", rows, columns, 4)


def _each(values: np.ndarray) -> str:
    """The components that there are."""
    return ", ".join(number(float(v)) for v in values[np.isfinite(values)]) or DASH


def _tenths(value: float) -> str:
    return DASH if value != value else f"{value:.4f}"
