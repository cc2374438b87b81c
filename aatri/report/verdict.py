"""The verdict strip: what can be told at a glance, in words and a colour, internal and external kept apart.

Internal is how well the observations agree with each other; external is how the result agrees with what it never saw.
A good internal light says nothing about the external ones.

A colour has a cause: sigma0 is good within the 99.9 % interval of its global test, bad where it is also beyond 0.5 to
2, else to be looked at; errors of check points and of a simulated block are held against theory by limits of 99.9 %
that count how many independent errors they are (`evaluation.verdict`).
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.global_test import global_test, sigma0_interval
from aatri.adjustment.statistics.limits import ALARM, WRONG_SIGMAS
from aatri.arrays import Bool
from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.evaluation.limits import ENOUGH_CHECK_POINTS
from aatri.evaluation.verdict import outside_expected
from aatri.ids import shown
from aatri.report.facts import without_comparison
from aatri.report.limits import CONVERGED
from aatri.report.view.numbers import counted, number
from aatri.report.view.run_view import RunView, StageView
from aatri.units import rms_alike, together

GOOD, LOOK, BAD, NONE = "good", "look", "bad", "none"
MOST_FAR = 10


@dataclass(frozen=True)
class Light:
    """One light: what is asked, its state (good, look, bad, none) and the answer in words."""

    title: str
    state: str
    words: str


def internal_lights(run: RunView, solution: Solution | None) -> list[Light]:
    """Chain, convergence, sigma0 and suspects; `solution` is the last one."""
    solutions = run.of_kind(Solution)
    best = solutions[-1] if solutions else None
    return [_chain(run), _converged(best, solution), _sigma0(best, run.to_follow()), _suspects(best, solution)]


def external_lights(run: RunView) -> list[Light]:
    """Check points, their bias and, for a simulated block, truth against theory."""
    evaluations = [stage for stage in run.evaluated() if "check_points" in stage.metrics]
    if not evaluations:
        return [Light("Independent check", NONE, "accuracy was not evaluated")]
    figures = evaluations[-1].metrics
    expected = _expected(figures)
    check = Light("Independent check", NONE, without_comparison(run.last(Block), figures))
    if figures.get("check_points"):
        check = _check(figures, expected)
    lights = [check, *_far_off(run.last(Evaluation))]
    if figures.get("check_points"):
        lights.insert(1, expected)
    if figures.get("truth_points"):
        lights.append(_truth(figures))
    return lights


def _chain(run: RunView) -> Light:
    done = [s for s in run.stages if s.status == "done"]
    failed = [s for s in run.stages if s.status == "failed"]
    if failed:
        return Light("Chain", BAD, f"{failed[0].name} failed; {len(done)} of {len(run.stages)} stages done")
    if len(done) < len(run.stages):
        return Light("Chain", LOOK, f"not complete: {len(done)} of {len(run.stages)} stages done")
    return Light("Chain", GOOD, f"complete, {counted(len(done), 'stage')}")


def _converged(stage: StageView | None, solution: Solution | None) -> Light:
    title = "Convergence"
    if stage is None or solution is None:
        return Light(title, NONE, "no solution")
    if not len(solution.history):
        return Light(title, NONE, f"{stage.name} records no iterations")
    decrement = float(solution.history.decrement[-1])
    count = "1 iteration" if solution.iterations == 1 else f"{number(solution.iterations)} iterations"
    words = f"{stage.name}: {count}, the last step {decrement:.1e} of the standard deviations"
    return Light(title, GOOD if decrement <= CONVERGED else LOOK, words)


def _sigma0(stage: StageView | None, to_follow: str) -> Light:
    sigma0 = stage.metrics.get("sigma0") if stage else None
    figures = stage.metrics if stage else {}
    redundancy = round(figures.get("sigma0_redundancy") or figures.get("redundancy") or 0)
    if stage is None or sigma0 is None or redundancy < 1:
        lacks = f"{stage.name} has no {'redundancy' if redundancy < 1 else 'sigma0'}" if stage else "no solution"
        return Light("sigma0", NONE, lacks)
    scale = float(figures.get("sigma_scale") or 1.0)
    if to_follow:  # strips and similarities leave to it what they do not model
        return Light("sigma0", NONE, f"{stage.name}: {sigma0:.3f}, not judged before {to_follow} is done")
    test = global_test(float(sigma0) / scale, redundancy)
    low, high = sigma0_interval(redundancy, ALARM)
    expected = f"expected {low:.3f} to {high:.3f} ({100 * (1 - ALARM):g} %)"
    words = f"{stage.name}: {sigma0:.3f}, redundancy {number(redundancy)}, {expected}"
    if scale != 1.0:
        return Light("sigma0", LOOK, f"{words}: standard deviations of the result follow what fits, {scale:.3g} times")
    if test.verdict == "fits":
        return Light("sigma0", GOOD, words)
    size = "too large" if test.sigma0 > test.high else "too small"
    return Light("sigma0", BAD if test.verdict == "far" else LOOK, f"{words}: {size}")


def _suspects(stage: StageView | None, solution: Solution | None) -> Light:
    title = "Suspects"
    if stage is None or solution is None:
        return Light(title, NONE, "no solution")
    rejected = solution.suspects.staying_out
    others = int((~rejected).sum())
    of_stage = solution.suspects.stage == stage.use.partition("/")[0]
    own = rejected & (of_stage | np.isin(solution.suspects.kind, solution.residuals.kinds))
    words = f"{stage.name}: {_by_kind(solution, own)} rejected"
    words += f", {number(others)} kept or readmitted" if others else ""
    if (rejected & ~own).any():
        words += f"; in stages before it {_by_kind(solution, rejected & ~own)}"
    if not own.any():  # ties of strips and models are tested again by their image points
        return Light(title, GOOD, words)
    share = own.sum() / max(solution.observations, 1)
    return Light(title, LOOK if share <= 0.01 else BAD, f"{words}; listed below")


def _by_kind(solution: Solution, rows: Bool) -> str:
    """Counts of suspects by kind: `3 image points, 1 control point`."""
    counts = sorted(Counter(solution.suspects.kind[rows].tolist()).items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(counted(n, kind) for kind, n in counts) or "none"


def _check(figures: Mapping[str, float | int | None], expected: Light) -> Light:
    """RMSE at check points: good where theory and chance explain it, or of many points without a theory.

    Points to which a free datum was fitted are no independent check.
    """
    n = int(figures["check_points"] or 0)
    values = {axis.upper(): figures[name] for axis in "xyz" if figures.get(name := f"check_rmse_{axis}_m") is not None}
    texts, unit = rms_alike([float(value) for value in values.values() if value is not None], n)
    words = f"RMSE {', '.join(f'{axis} {text}' for axis, text in zip(values, texts))} {unit} at {counted(n, 'check')}"
    if (figures.get("check_aligned_components") or 0) > 0:
        return Light("Independent check", NONE, f"{words}, after the open datum was fitted to them")
    enough = n >= ENOUGH_CHECK_POINTS
    state = GOOD if expected.state == GOOD or (enough and expected.state == NONE) else LOOK
    return Light("Independent check", state, words if enough else f"{words}, fewer than {ENOUGH_CHECK_POINTS}")


def _far_off(evaluation: Evaluation | None) -> list[Light]:
    """Check points that no standard deviation explains, by name, the worst first."""
    far = far_off(evaluation)
    named = [f"{name} ({number(round(sigmas, 1))} sigma, {together([size])})" for name, sigmas, size in far]
    return [Light("Check points far off", BAD, shown(named, MOST_FAR))] if far else []


def far_off(evaluation: Evaluation | None) -> list[tuple[str, float, float]]:
    """Check points that no standard deviation explains, the worst first: name, in standard deviations, in metres."""
    if evaluation is None:
        return []
    d = evaluation.differences
    checks = np.flatnonzero(d.kind == "check")
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.fmax.reduce(
            np.where(d.sigma_m[checks] > 0, np.abs(d.difference_m[checks]) / d.sigma_m[checks], np.nan), axis=1
        )
    size = np.nan_to_num(size)
    worst = np.argsort(-size, kind="stable")[: int((size > WRONG_SIGMAS).sum())]
    return [
        (str(d.point[checks[k]]), float(size[k]), float(np.nanmax(np.abs(d.difference_m[checks[k]])))) for k in worst
    ]


def _expected(figures: Mapping[str, float | int | None]) -> Light:
    """Whether the errors at check points are those that the standard deviations say."""
    title, numbers = "Check against theory", with_check_counts(figures)
    if not any(f"check_theory_ratio_{axis}" in numbers for axis in "xyz"):
        return Light(title, NONE, "no theoretical standard deviations at check points")
    beyond = outside_expected(numbers, "check")
    return Light(title, LOOK, " ".join(beyond)) if beyond else Light(title, GOOD, "as the standard deviations say")


def _truth(figures: Mapping[str, float | int | None]) -> Light:
    title, numbers = "Truth against theory", numbers_of(figures)
    ratios = {axis: numbers[name] for axis in "xyz" if (name := f"truth_over_theory_{axis}") in numbers}
    count = counted(int(figures["truth_points"] or 0), "new point")
    if not ratios:
        return Light(title, NONE, f"{count}, no theoretical standard deviations")
    if beyond := outside_expected(numbers, "new"):
        return Light(title, LOOK, " ".join(beyond))
    return Light(
        title, GOOD, f"ratio {', '.join(f'{a.upper()} {r:.2f}' for a, r in ratios.items())} at {count} (simulated)"
    )


def with_check_counts(figures: Mapping[str, float | int | None]) -> dict[str, float]:
    """Figures that were determined; each check point is one error where nobody counted the independent ones."""
    numbers = numbers_of(figures)
    axes = [axis for axis in "xyz" if f"check_theory_ratio_{axis}" in numbers]
    return {f"check_independent_{axis}": numbers["check_points"] for axis in axes} | numbers


def numbers_of(figures: Mapping[str, float | int | None]) -> dict[str, float]:
    """The figures that were determined."""
    return {name: float(value) for name, value in figures.items() if value is not None}
