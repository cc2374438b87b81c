"""Tables of observations one by one: residual, standard deviation, redundancy number and test, the largest first."""

import numpy as np

from aatri.arrays import Bool, Float
from aatri.artifacts.solution import Solution
from aatri.report.sections.tables import Columns, PageTable, all_rows
from aatri.report.view.numbers import in_trade_unit, number, spoken
from aatri.units import DASH

OF_POINTS = ("image_point", "control")
"""Kinds of observation that are too many, or have tables of their own."""


def of_images(solution: Solution) -> PageTable | None:
    """Positions, attitudes and rigs: what is observed of images as a whole."""
    residuals = solution.residuals
    rows = (residuals.image != "") & (residuals.point == "") & (residuals.row >= 0)
    return listed(solution, rows, "image", "Observed positions, attitudes and rigs of images")


def of_the_network(solution: Solution) -> PageTable | None:
    """Geodetic observations and relative control: what is observed between points."""
    residuals = solution.residuals
    rows = (residuals.point != "") & (residuals.image == "") & ~np.isin(residuals.kind, OF_POINTS)
    return listed(solution, rows, "between", "Geodetic observations and relative control")


def listed(solution: Solution, chosen: Bool, names: str, caption: str) -> PageTable | None:
    """Some observations, the largest residuals in sigmas first; `names` is the head of the column of ids."""
    residuals, tests = solution.residuals, solution.tests
    rows = np.flatnonzero(chosen & ~np.isin(residuals.kind, OF_POINTS) & np.isfinite(residuals.residual).any(axis=1))
    sigma = residuals.sigma[rows]
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.abs(residuals.residual[rows]) / np.where(sigma > 0, sigma, np.nan)
    rows = rows[np.argsort(-np.nan_to_num(np.fmax.reduce(size, axis=1)), kind="stable")]
    units = [in_trade_unit(unit) for unit in residuals.unit[rows].tolist()]
    factor = np.array([f for f, _ in units])[:, None]
    columns: Columns = {
        "observation": (residuals.kind[rows], spoken),
        names: (residuals.image if names == "image" else residuals.point)[rows],
        "used": np.where(residuals.active[rows], "yes", "rejected"),
        "unit": [unit for _, unit in units],
        "residual": (factor * residuals.residual[rows], _each),
        "sigma": (factor * residuals.sigma[rows], _each),
    }
    if tests is not None:
        columns |= {"redundancy": (tests.redundancy[rows], _each), "w": (tests.test[rows], _each)}
    return all_rows(f"{caption}, the largest residuals in sigmas first", columns)


def _each(values: Float) -> str:
    """The components that there are."""
    return ", ".join(number(float(v)) for v in values[np.isfinite(values)]) or DASH
