"""Reliability: redundancy, detectable gross errors, their effect, the largest tests, what nothing controls."""

from collections.abc import Callable

import numpy as np

from aatri.adjustment.statistics.limits import LEAST_CONTROLLED
from aatri.arrays import Float, Int
from aatri.artifacts.solution import Solution
from aatri.evaluation.statistics import rmse_interval
from aatri.report.sections.limits import LEAST_REDUNDANCY_OF_CLASS
from aatri.report.sections.observations import uncontrolled_table
from aatri.report.sections.parts import present
from aatri.report.sections.tables import MOST_ROWS, Columns, PageTable, all_rows, errors, lengths
from aatri.report.view.numbers import angle_units, in_trade_unit, number, spoken
from aatri.units import DASH, digits


def reliability_tables(solution: Solution) -> list[PageTable]:
    """By kind, and the observations with the largest tests, where they were computed; what nothing controls."""
    loose = uncontrolled_table(solution.uncontrolled)
    if solution.tests is None:
        return present(loose)
    return present(_by_kind(solution), _largest(solution), _worst_effects(solution), loose)


def variance_table(solution: Solution) -> PageTable | None:
    """Variance components: what the residuals say of the standard deviations."""
    c = solution.variance_components
    if c is None:
        return None
    columns: Columns = {
        "group": c.group,
        "verdict": c.verdict,
        "observations": c.observations,
        "redundancy": c.redundancy,
        "factor": c.factor,
        "from": c.low,
        "to": c.high,
    }
    return all_rows("Variance components: factors on the standard deviations given, with 95 % limits", columns)


def groups(solution: Solution) -> list[tuple[str, float, float, float, str]]:
    """Factors on the standard deviations of groups with 95 % limits: variance components, else by kind.

    Without variance components it is the root of v'Pv over the redundancy of the kind, where redundancy numbers were
    computed (`reliability: true`): what the first step of the variance components says.
    """
    c, residuals, tests = solution.variance_components, solution.residuals, solution.tests
    if c is not None:
        verdicts = [f", {verdict}" for verdict in c.verdict]
        return list(zip(c.group.tolist(), c.factor.tolist(), c.low.tolist(), c.high.tolist(), verdicts))
    made: list[tuple[str, float, float, float, str]] = []
    if tests is None:
        return made
    for kind in residuals.kinds:
        used = residuals.used(kind)
        v, sigma, r = residuals.residual[used], residuals.sigma[used], tests.redundancy[used]
        weighted = np.isfinite(v) & (np.nan_to_num(sigma) > 0) & np.isfinite(r)
        redundancy = float(r[weighted].sum())
        if redundancy > LEAST_REDUNDANCY_OF_CLASS:
            factor = float(np.sqrt(np.sum((v[weighted] / sigma[weighted]) ** 2) / redundancy))
            (low,), (high,) = rmse_interval(np.array([factor]), np.array([redundancy]), 0.95)
            made.append((spoken(kind), factor, float(low), float(high), ""))
    return made


def _by_kind(solution: Solution) -> PageTable | None:
    residuals, tests = solution.residuals, solution.tests
    assert tests is not None
    rows = []
    for kind in residuals.kinds:
        of_kind = residuals.used(kind)
        r, w, size = tests.redundancy[of_kind], tests.test[of_kind], tests.detectable[of_kind]
        finite = np.isfinite(r)
        if not finite.any():
            continue
        factor, unit = in_trade_unit(str(residuals.unit[of_kind[0]]))
        effect = tests.external[of_kind]
        rows.append(
            (
                spoken(kind),
                unit,
                number(int(finite.sum())),
                number(float(r[finite].mean())),
                number(float(r[finite].min())),
                number(int((r[finite] < LEAST_CONTROLLED).sum())),
                _of(np.median, factor * size),
                _of(np.max, factor * size),
                _of(np.median, effect),
                _of(np.max, effect),
                _of(np.max, 1e3 * tests.point_moved_m[of_kind]),
                _of(np.max, np.abs(w)),
            )
        )
    heads = (
        *("observations", "unit", "tested", "mean redundancy", "smallest", "uncontrolled", "median detectable error"),
        *("largest", "median external", "largest external", "largest effect on a point mm", "largest |w|"),
    )
    caption = (
        "Reliability by kind; detectable with 80 % at a level of 0.1 %; external: largest effect of such an error on "
        "any function of the unknowns, in its standard deviations"
    )
    return PageTable(caption, heads, rows, 2) if rows else None


def _of(figure: Callable[[Float], float], values: Float) -> str:
    finite = values[np.isfinite(values)]
    return number(float(figure(finite))) if len(finite) else DASH


def _worst_effects(solution: Solution) -> PageTable | None:
    """Observations whose undetected errors do most to the result."""
    residuals, tests, units = solution.residuals, solution.tests, angle_units.get()
    assert tests is not None
    effect = np.where(residuals.active[:, None] & np.isfinite(tests.external), tests.external, -1.0)
    most = effect.max(axis=1)
    rows = np.argsort(-most, kind="stable")[:MOST_ROWS]
    rows = rows[most[rows] > 0]
    at = (rows, effect[rows].argmax(axis=1))
    columns: Columns = {
        **_observation(solution, *at),
        **errors(residuals.unit[rows].tolist(), {"detectable": tests.detectable[at]}, residuals.sigma[at]),
        "external": (tests.external[at], digits(1)),
        **lengths("moves_its_point", tests.point_moved_m[at]),
        **lengths("its_image", tests.image_moved_m[at]),
        f"turns it {units.small}": units.small_per_rad * tests.image_turned_rad[at],
    }
    return all_rows("Detectable errors with the largest effect on the unknowns", columns)


def _observation(solution: Solution, rows: Int, axis: Int) -> Columns:
    """Columns that say which observation it is, and which axis of each."""
    r = solution.residuals
    return {
        "observation": (r.kind[rows], spoken),
        "image": r.image[rows],
        "point": r.point[rows],
        "axis": np.array(list("xyz"))[axis],
    }


def _largest(solution: Solution) -> PageTable | None:
    residuals, tests = solution.residuals, solution.tests
    assert tests is not None
    w = np.where(np.isfinite(tests.test) & residuals.active[:, None], np.abs(tests.test), -1.0)
    rows = np.argsort(-w.max(axis=1), kind="stable")[:MOST_ROWS]
    rows = rows[w[rows].max(axis=1) >= 0]
    at = (rows, w[rows].argmax(axis=1))
    sizes = {"residual": residuals.residual[at], "detectable": tests.detectable[at]}
    columns: Columns = {
        **_observation(solution, *at),
        **errors(residuals.unit[rows].tolist(), sizes, residuals.sigma[at]),
        "w": (tests.test[at], digits(2)),
        "redundancy": (tests.redundancy[at], digits(3)),
    }
    return all_rows("Largest tests of observations in use", columns)
