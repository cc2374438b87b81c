"""What is to be thought of a run, in a few plain sentences.

The judgement says how the result agrees with what it never saw, whether its standard deviations explain that, and what
is wrong. It uses the figures of the last evaluation and the last adjustment, and none of its own.
"""

from collections.abc import Mapping

import numpy as np

from aatri.adjustment.statistics.global_test import global_test
from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.evaluation.verdict import RATIOS, outside_expected
from aatri.ids import shown
from aatri.report.facts import has_scale, without_comparison
from aatri.report.limits import ALONG_AXIS
from aatri.report.verdict import far_off, with_check_counts
from aatri.report.view.numbers import counted, number, small_angle, spoken
from aatri.report.view.run_view import RunView
from aatri.units import listed, of_model, rms_alike, together

CONTRADICTORY = "The result contradicts its own tests: do not use it before the first warning is answered."

MOST_NAMED = 3
"""Of one kind in a sentence."""


def judgement(run: RunView) -> str:
    """A few sentences on the result of a run."""
    failed = [stage for stage in run.stages if stage.status == "failed"]
    solutions, solution = run.of_kind(Solution), run.last(Solution)
    if failed:
        return f"The run failed in stage {failed[0].name}; what stands here was made before."
    if run.overview.get("refused"):
        return "The pipeline does not fit the block and was not run on; what stands here was made before."
    left, to_follow = _left_to_do(run), run.to_follow()
    purpose = _of_purpose(run)
    if not solutions or solution is None:
        return " ".join(filter(None, [left, purpose or "Nothing has been adjusted yet."]))
    evaluations = run.evaluated()
    figures = with_check_counts(evaluations[-1].metrics) if evaluations else {}
    sentences = [
        left,
        CONTRADICTORY if solution.contradictions else "",
        purpose or _accuracy(figures, run.last(Block)),
        _far_off(run.last(Evaluation)),
        not_oriented(solution),
        "" if to_follow else _sigma0(solutions[-1].metrics),
        *wrong_observations(solution, MOST_NAMED).values(),
        _of_image_points(_image_points_left_out(solution), run.last(Block)),
    ]
    return " ".join(sentence for sentence in sentences if sentence)


def _left_to_do(run: RunView) -> str:
    """How far a run came that was stopped, and whose result it has."""
    done = sum(stage.status == "done" for stage in run.stages)
    if done == len(run.stages):
        return ""
    last = run.to_follow() and f", the last of them {run.of_kind(Solution)[-1].name}; {run.to_follow()} comes next"
    return f"The run is not complete: {done} of {len(run.stages)} stages are done{last}."


def _far_off(evaluation: Evaluation | None) -> str:
    """Check points that are wrong, or show that the block is, by name."""
    far = far_off(evaluation)
    named = shown([f"{name}, {together([size])}" for name, _, size in far], MOST_NAMED)
    return f"{counted(len(far), 'check')} {'is' if len(far) == 1 else 'are'} far off: {named}." if far else ""


def _of_purpose(run: RunView) -> str:
    """What evaluations say that are not of differences at points: of epochs, designs, free strips."""
    of_results = {stage.name for stage in run.of_kind(Evaluation) if "check_points" in stage.metrics}
    verdicts = {
        name: f"{e.verdict[0].upper()}{e.verdict[1:].rstrip('.')}."
        for name, e in reversed(run.readable(Evaluation).items())
        if e.verdict and name not in of_results
    }
    return " ".join(f"{name}: {verdict}" if len(verdicts) > 1 else verdict for name, verdict in verdicts.items())


def _accuracy(figures: Mapping[str, float], block: Block | None) -> str:
    """How far off check points are, else control predicted without itself, else the truth of a simulation."""
    for what, count, text in (
        ("check_rmse", "check_points", "Check points agree to {} in {} (RMSE of {})"),
        (
            "left_out_rmse",
            "left_out_points",
            "No check point was measured; control predicted without itself agrees to {} in {} (RMSE of {})",
        ),
        ("truth_rmse", "truth_points", "New points of this simulated block are right to {} in {} (RMSE of {})"),
    ):
        values = {axis.upper(): figures[f"{what}_{axis}_m"] for axis in "xyz" if f"{what}_{axis}_m" in figures}
        if figures.get(count) and values:
            n = int(figures[count])
            lengths = listed(*rms_alike(values.values(), n))
            fitted = f"{what.partition('_')[0]}_aligned_components"
            after = " after the open datum was fitted to them" if figures.get(fitted, 0) > 0 else ""
            return f"{text.format(lengths, _and(values), counted(n, 'point'))}{after}{_theory(figures, what)}."
    if not figures:
        return "The accuracy was not evaluated."
    theory = {axis.upper(): figures[name] for axis in "xyz" if (name := f"theory_rmse_{axis}_m") in figures}
    size = (together(theory.values()) if has_scale(block) else listed(*of_model(theory.values()))) if theory else ""
    expected = f"; by their standard deviations new points are known to {size} in {_and(theory)}" if theory else ""
    return f"Nothing independent is known of the accuracy ({without_comparison(block, figures)}){expected}."


def _theory(figures: Mapping[str, float], what: str) -> str:
    """Whether the standard deviations explain the errors."""
    points = {"check_rmse": "check", "left_out_rmse": "left_out", "truth_rmse": "new"}[what]
    name, ratio = RATIOS[points]
    counted = [axis for axis in "xyz" if f"{name}_independent_{axis}" in figures]
    ratios = {axis: figures[f"{ratio}_{axis}"] for axis in counted if f"{ratio}_{axis}" in figures}
    if not ratios:  # what chance allows is not known
        return ""
    if not outside_expected(figures, points):
        return ", as the standard deviations say"
    axis = max(ratios, key=lambda a: abs(np.log(max(ratios[a], 1e-9))))
    return f", {ratios[axis]:.2g} times what the standard deviations say in {axis.upper()}"


def _sigma0(metrics: Mapping[str, float | int | None]) -> str:
    sigma0 = metrics.get("sigma0")
    redundancy = round(metrics.get("sigma0_redundancy") or metrics.get("redundancy") or 0)
    if sigma0 is None or redundancy < 1 or (test := global_test(float(sigma0), redundancy)).verdict == "fits":
        return ""
    if f"{test.sigma0:.2f}" == "1.00":  # of millions of observations, and in no digit that is shown
        return ""
    size = "larger" if test.sigma0 > test.high else "smaller"
    follows = ", and those of the result follow what fits" if metrics.get("sigma_scale") else ""
    return f"Residuals are {size} than the standard deviations given allow (sigma0 {test.sigma0:.2f} for 1){follows}."


def wrong_observations(solution: Solution, most: int) -> dict[str, str]:
    """A sentence for each kind of observation that is left out, the worst by name, so many at most.

    Image points have a sentence of their own, and so have the ties that are made of them.
    """
    s, out = solution.suspects, solution.suspects.staying_out
    sentences = {}
    of_images = ("image_point", "model_tie", "strip_tie") if len(solution.images) else ("image_point",)
    for kind in np.unique(s.kind[out & ~np.isin(s.kind, of_images)]).tolist():
        rows = np.flatnonzero(out & (s.kind == kind))
        head = f"One {spoken(kind)} is left out" if len(rows) == 1 else f"{counted(len(rows), kind)} are left out"
        undecided = " (nothing tells which of them is wrong)" if (s.verdict[rows] == "undecidable").any() else ""
        sentences[kind] = f"{head}: {_worst(s, rows, most)}{undecided}."
    return sentences


def wrong_image_points(solution: Solution, block: Block | None, most: int) -> str:
    """How many image points are left out, the worst by name, so many at most; empty where there are none."""
    rows = _image_points_left_out(solution)
    head = _of_image_points(rows, block).rstrip(".")
    return f"{head}: {_worst(solution.suspects, rows, most)}." if head else ""


def not_oriented(solution: Solution) -> str:
    """How many images have no orientation, the first of them by name; empty without any, and of a network."""
    missing = solution.images.id[~solution.images.oriented]
    if not 0 < len(missing) < len(solution.images):
        return ""
    count = f"{number(len(missing))} of {number(len(solution.images))} images {'is' if len(missing) == 1 else 'are'}"
    return f"{count} not oriented: {shown(missing.tolist(), MOST_NAMED)}."


def _image_points_left_out(solution: Solution) -> Int:
    return np.flatnonzero(solution.suspects.staying_out & (solution.suspects.kind == "image_point"))


def _of_image_points(out: Int, block: Block | None) -> str:
    of = f" of {number(len(block.image_points))}" if block is not None else ""
    return f"{number(len(out))}{of} image points {'is' if len(out) == 1 else 'are'} left out." if len(out) else ""


def _worst(s: Suspects, rows: Int, most: int) -> str:
    """Names and sizes, the largest test first: `GCP27, 1.03 m in height; GCP05, 81 mm in X; and 2 more`."""
    rows = rows[np.argsort(-np.nan_to_num(s.test[rows]), kind="stable")]
    more = [f"and {number(len(rows) - most)} more"] if len(rows) > most else []
    return "; ".join([_named(s, k) for k in rows[:most].tolist()] + more)


def _named(s: Suspects, k: int) -> str:
    """`GCP27, 1.03 m in height`."""
    name = "/".join(text for text in (str(s.image[k]), str(s.point[k])) if text)
    size, unit = float(s.size[k]), str(s.unit[k])
    if not np.isfinite(size):
        return name
    if unit == "rad":
        return f"{name}, {small_angle(size)}"
    if unit == "mm":
        return f"{name}, {together([size * 1e-3])}"
    if unit != "m":
        return f"{name}, {size:.3g} {unit}"
    in_axes = s.kind[k] in ("control", "position") and size > 0
    share = np.nan_to_num(np.abs(s.error[k])) / size if in_axes else np.zeros(3)
    where = (" in X", " in Y", " in height")[int(share.argmax())] if share.max() > ALONG_AXIS else ""
    return f"{name}, {together([size])}{where}"


def _and(names: Mapping[str, float]) -> str:
    listed = list(names)
    return " and ".join([", ".join(listed[:-1]), listed[-1]] if len(listed) > 1 else listed)
