"""What was estimated of the cameras: values, standard deviations, whether they are significant, correlations."""

from typing import Any

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.solution import Solution
from aatri.formats.results.column_names import parameter_units
from aatri.formats.results.interior_orientation import interior_covariances
from aatri.formats.results.solution_tables import removed_parameters
from aatri.ids import several
from aatri.report.sections.limits import STRONG_CORRELATION
from aatri.report.sections.parts import present
from aatri.report.sections.tables import Columns, PageTable, all_rows
from aatri.report.view.numbers import estimate, in_trade_unit, number
from aatri.units import DASH, decimals, digits

FILM = "film"
OF_IMAGES = ("film", "velocity")
"""Groups whose parameters are those of single images: hundreds, which are counted."""
CHANGES = ("c", "x0", "y0")
"""Of a set beside the camera's own: changes of what is given, as are all parameters of a set."""
MOST_ROWS, HARDLY_SEPARATED = 40, 0.9
"""Of parameters and correlations on the first page."""


def parameter_summary(stage: str, solution: Solution) -> dict[str, Any]:
    """What a stage estimated, for the first page: at most 40 parameters, and pairs that the data hardly separate.

    Returns
    -------
    dict
        `stage`; `rows` of name, value, standard deviation and unit; `left_off` and `correlations` in words. Empty where
        nothing but parameters of single images was estimated.
    """
    p, units, removed = solution.parameters, parameter_units(solution), removed_parameters(solution.parameters)
    estimated = [k for k in range(len(p)) if removed[k] or p.sigma[k] != 0]
    rows = [k for k in estimated if p.group[k] not in OF_IMAGES]
    if not rows:
        return {}
    texts = [
        (
            f"{p.object[k]} {p.name[k]}{' (change)' * (p.name[k] in CHANGES)}",
            *(("removed", "", units[k]) if removed[k] else estimate(float(p.value[k]), float(p.sigma[k]), units[k])),
        )
        for k in rows[:MOST_ROWS]
    ]
    counts = [(len(rows[MOST_ROWS:]), "more"), (len(estimated) - len(rows), "of single images")]
    left_off = ", ".join(f"{count} {which}" for count, which in counts if count)
    return {"stage": stage, "rows": texts, "left_off": left_off, "correlations": _hardly_separated(solution)}


def _hardly_separated(solution: Solution) -> list[str]:
    """The strongest correlation of every pair of names, and of how many cameras, sessions ... it is as strong."""
    first, second, r = correlations(solution, HARDLY_SEPARATED)
    names, owners = solution.parameters.name, solution.parameters.object
    of_names: dict[tuple[str, str, bool], list[int]] = {}
    for k, (i, j) in enumerate(zip(first.tolist(), second.tolist())):
        of_names.setdefault((str(names[i]), str(names[j]), owners[i] == owners[j]), []).append(k)
    lines = [
        f"{owners[first[k]]}: {a} and {b}{_of_other(owners[first[k]], owners[second[k]])} correlate by {r[k]:.3f}"
        + (f", and in {several(len(more), 'further pair')} by {HARDLY_SEPARATED} or more" if more else "")
        for (a, b, _), (k, *more) in of_names.items()
    ]
    return lines[:MOST_ROWS]


def _of_other(owner: str, other: str) -> str:
    return "" if owner == other else f" of {other}"


def correlations(solution: Solution, least: float) -> tuple[Int, Int, Float]:
    """Pairs of parameters that correlate by `least` and more, the strongest first, and their correlations."""
    p, c = solution.parameters, solution.parameter_covariances
    if c is None or not len(c):
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = c.covariance / (p.sigma[c.first] * p.sigma[c.second])
    pairs = np.flatnonzero((c.first != c.second) & (np.abs(np.nan_to_num(r)) >= least))
    pairs = pairs[np.argsort(-np.abs(r[pairs]), kind="stable")]
    return c.first[pairs], c.second[pairs], r[pairs]


def parameter_tables(solution: Solution) -> list[PageTable]:
    """Parameters that were estimated but those of single film images, their correlations, and film in figures."""
    p = solution.parameters
    removed = removed_parameters(p)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(p.sigma > 0, np.abs(p.value) / p.sigma, np.nan)
    texts = [estimate(*row) for row in zip(p.value.tolist(), p.sigma.tolist(), parameter_units(solution))]
    columns: Columns = {
        "group": p.group,
        "of": p.object,
        "parameter": p.name,
        "unit": [unit for _, _, unit in texts],
        "value": (np.where(removed, "removed", [value for value, _, _ in texts]), str),
        "sigma": (np.where(removed, DASH, [sigma for _, sigma, _ in texts]), str),
        "value / sigma": (ratio, digits(1)),
    }
    estimated = (p.group != FILM) & (removed | (np.nan_to_num(p.sigma, nan=1.0) > 0))
    listed = all_rows("Calibration and other parameters", columns, np.flatnonzero(estimated))
    return present(_interior(solution), listed, _correlations(solution), _film(solution))


def _interior(solution: Solution) -> PageTable | None:
    """Principal distance and point of the cameras as adjusted, where they are."""
    cameras, covariance = solution.cameras, interior_covariances(solution)
    rows = np.flatnonzero((np.einsum("nii->ni", covariance) > 0).any(axis=1))
    if not len(rows):
        return None
    values = np.column_stack([cameras.principal_distance_mm, cameras.principal_point_mm])
    sigma = np.sqrt(np.einsum("nii->ni", covariance))
    columns: Columns = {"camera": cameras.id}
    for axis, name in enumerate(("c", "x0", "y0")):
        form = digits(decimals(float(np.median(sigma[rows, axis]))))
        columns |= {f"{name} mm": (values[:, axis], form), f"sigma {name} mm": (sigma[:, axis], form)}
    caption = "Interior orientations as adjusted; the principal point from the fiducial or image centre, x right, y up"
    return all_rows(caption, columns, rows)


def _correlations(solution: Solution) -> PageTable | None:
    """The strongest correlations of the camera parameters."""
    p = solution.parameters
    one, other, r = correlations(solution, STRONG_CORRELATION)
    columns: Columns = {
        "of": p.object[one],
        "parameter": p.name[one],
        "with": [f"{p.name[j]}{_of_other(p.object[i], p.object[j])}" for i, j in zip(one, other)],
        "correlation": (r, "{:.3f}".format),
    }
    return all_rows(f"Correlations of {STRONG_CORRELATION} or more, the strongest first", columns)


def _film(solution: Solution) -> PageTable | None:
    """The corrections of single film images: how many, how large; the values are in the export."""
    p = solution.parameters
    film = p.group == FILM
    if not film.any():
        return None
    units = np.array(parameter_units(solution))
    rows = []
    for name in np.unique(p.name[film]):
        same = np.flatnonzero(film & (p.name == name))
        sigma = p.sigma[same][np.isfinite(p.sigma[same])]  # none where the bundle gave no standard deviations
        worst = same[int(np.argmax(np.abs(p.value[same])))]
        factor, unit = in_trade_unit(str(units[worst]))
        rms_sigma = float(np.sqrt((sigma**2).mean())) if len(sigma) else np.nan
        sizes = (float(np.sqrt((p.value[same] ** 2).mean())), rms_sigma, float(np.abs(p.value[worst])))
        form = digits(decimals(factor * rms_sigma)) if rms_sigma > 0 else number
        rows.append(
            (
                str(name),
                unit,
                str(p.object[worst]),
                number(len(same)),
                *(form(factor * size) for size in sizes),
            )
        )
    heads = ("film correction", "unit", "largest in", "images", "RMS", "RMS sigma", "largest")
    return PageTable("Film corrections per image, in figures", heads, rows, 3)
