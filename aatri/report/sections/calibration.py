"""What was estimated of the cameras: values, standard deviations, whether they are significant, correlations."""

import numpy as np

from aatri.artifacts.solution import Solution
from aatri.formats.results.interior_orientation import interior_covariances
from aatri.formats.results.parameter_units import parameter_units
from aatri.formats.results.solution_tables import removed_parameters
from aatri.report.sections.parts import present
from aatri.report.sections.tables import Columns, PageTable, all_rows
from aatri.report.view.numbers import estimate, in_trade_unit, number
from aatri.units import DASH, decimals, digits

FILM = "film"
STRONG = 0.5
"""Correlations below this are left out."""


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
    p, c = solution.parameters, solution.parameter_covariances
    if c is None or not len(c):
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        r = c.covariance / (p.sigma[c.first] * p.sigma[c.second])
    pairs = np.flatnonzero((c.first != c.second) & (np.abs(np.nan_to_num(r)) >= STRONG))
    pairs = pairs[np.argsort(-np.abs(r[pairs]), kind="stable")]
    one, other = c.first[pairs], c.second[pairs]
    elsewhere = [f" of {there}" if there != here else "" for here, there in zip(p.object[one], p.object[other])]
    columns: Columns = {
        "of": p.object[one],
        "parameter": p.name[one],
        "with": [f"{name}{owner}" for name, owner in zip(p.name[other], elsewhere)],
        "correlation": (r[pairs], "{:.3f}".format),
    }
    return all_rows(f"Correlations of {STRONG} or more, the strongest first", columns)


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
