"""What was estimated of the cameras: values, standard deviations, whether they are significant, correlations."""

from __future__ import annotations

import numpy as np

from aatri.artifacts.solution import Parameters, Solution
from aatri.formats.results.interior_orientation import interior_covariances
from aatri.formats.results.parameter_units import parameter_units
from aatri.formats.results.solution_tables import removed_parameters
from aatri.report.numbers import DASH, number
from aatri.report.sections import tables
from aatri.report.sections.parts import present
from aatri.report.sections.tables import Cells, PageTable

FILM = "film"
MOST_CORRELATIONS = 30
STRONG = 0.5
"""Correlations below this are left out."""


def parameter_tables(solution: Solution) -> list[PageTable]:
    """Parameters but those of single film images, their correlations, and film in figures."""
    p = solution.parameters
    rows = np.flatnonzero(p.group != FILM)
    units, removed = parameter_units(solution), removed_parameters(p)

    def sigma(k: int) -> float:
        return float(p.sigma[rows[k]])

    def value(k: int) -> float:
        return float(p.value[rows[k]])

    columns: Cells = {
        "group": lambda k: str(p.group[rows[k]]),
        "of": lambda k: str(p.object[rows[k]]),
        "parameter": lambda k: str(p.name[rows[k]]),
        "unit": lambda k: units[rows[k]],
        "value": lambda k: "removed" if removed[rows[k]] else f"{value(k):.6g}",
        "sigma": lambda k: DASH if removed[rows[k]] else number(sigma(k)),
        "value / sigma": lambda k: number(abs(value(k)) / sigma(k)) if sigma(k) > 0 else DASH,
    }
    return present(
        _interior(solution), tables.all_rows("Calibration and other parameters", rows, columns, 4),
        _correlations(solution), _film(solution),
    )  # fmt: skip


def _interior(solution: Solution) -> PageTable | None:
    """Principal distance and point of the cameras as adjusted, where they are."""
    cameras, covariance = solution.cameras, interior_covariances(solution)
    rows = np.flatnonzero((np.einsum("nii->ni", covariance) > 0).any(axis=1))
    if not len(rows):
        return None
    values = np.column_stack([cameras.principal_distance_mm, cameras.principal_point_mm])
    sigma = np.sqrt(np.einsum("nii->ni", covariance))
    columns: Cells = {"camera": lambda k: str(cameras.id[rows[k]])}
    for axis, name in enumerate(("c mm", "x0 mm", "y0 mm")):
        columns[name] = lambda k, axis=axis: f"{values[rows[k], axis]:.5f}"  # type: ignore[misc]
        columns[f"sigma {name}"] = lambda k, axis=axis: number(float(sigma[rows[k], axis]))  # type: ignore[misc]
    caption = "Interior orientations as adjusted; the principal point from the fiducial or image centre, x right, y up"
    return tables.all_rows(caption, rows, columns, 1)


def _correlations(solution: Solution) -> PageTable | None:
    """The strongest correlations of the camera parameters."""
    p, c = solution.parameters, solution.parameter_covariances
    if c is None or not len(c):
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        r = c.covariance / (p.sigma[c.first] * p.sigma[c.second])
    pairs = np.flatnonzero((c.first != c.second) & (np.abs(np.nan_to_num(r)) >= STRONG))
    pairs = pairs[np.argsort(-np.abs(r[pairs]), kind="stable")]
    if not len(pairs):
        return None
    columns: Cells = {
        "of": lambda k: str(p.object[c.first[pairs[k]]]),
        "parameter": lambda k: str(p.name[c.first[pairs[k]]]),
        "with": lambda k: _of_other(p, int(c.first[pairs[k]]), int(c.second[pairs[k]])),
        "correlation": lambda k: f"{r[pairs[k]]:.3f}",
    }
    return tables.all_rows(f"Correlations of {STRONG} or more, the strongest first", pairs, columns, 3)


def _of_other(p: Parameters, first: int, second: int) -> str:
    of = "" if p.object[first] == p.object[second] else f" of {p.object[second]}"
    return f"{p.name[second]}{of}"


def _film(solution: Solution) -> PageTable | None:
    """The corrections of single film images: how many, how large; the values are in the export."""
    p = solution.parameters
    film = p.group == FILM
    if not film.any():
        return None
    units = np.array(parameter_units(solution))
    rows = []
    for name in np.unique(p.name[film]):
        mine = np.flatnonzero(film & (p.name == name))
        sigma = p.sigma[mine][np.isfinite(p.sigma[mine])]  # none where the bundle gave no standard deviations
        worst = mine[int(np.argmax(np.abs(p.value[mine])))]
        rows.append((str(name), str(units[worst]), str(p.object[worst]), number(len(mine)),
                     number(float(np.sqrt((p.value[mine] ** 2).mean()))),
                     number(float(np.sqrt((sigma**2).mean())) if len(sigma) else np.nan),
                     number(float(np.abs(p.value[worst])))))  # fmt: skip
    heads = ("film correction", "unit", "largest in", "images", "RMS", "RMS sigma", "largest")
    return PageTable("Film corrections per image, in figures", heads, rows, 3)
