"""The lights of the verdict strip, and the problems of the first page."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from aatri.artifacts.block import CHECK, Block
from aatri.artifacts.offers import offers_of
from aatri.artifacts.solution import DatumCarriers, Solution
from aatri.evaluation.accuracy import evaluate
from aatri.notes import EXCHANGED, REJECTED
from aatri.report.judgement import judgement
from aatri.report.page import write_report
from aatri.report.problems import in_words, problems
from aatri.report.verdict import Light, _check, external_lights, internal_lights
from aatri.report.view.run_view import RunView, StageView, view
from tests.made_solutions import made_block, made_solution
from tests.report.test_page import STAGES, made_artifacts, make_run


@pytest.mark.parametrize(
    ("figures", "state"),
    [
        ({"redundancy": 30}, "good"),
        ({"redundancy": 300}, "look"),
        ({"redundancy": 300, "sigma0_redundancy": 29.6}, "good"),
        ({"redundancy": 30, "sigma0_redundancy": 300.2}, "look"),
    ],
)
def test_sigma0_is_tested_with_the_redundancy_that_it_counts(figures: dict[str, float], state: str) -> None:
    """99.9 % limits: 0.600 to 1.439 for a redundancy of 30, 0.868 to 1.136 for 300 (tables of chi-square)."""
    stage = SimpleNamespace(name="bundle", metrics={"sigma0": 1.20, **figures}, status="done")
    run = SimpleNamespace(stages=[stage], of_kind=lambda kind: [stage], evaluated=lambda: [stage], to_follow=str)
    (light,) = [x for x in internal_lights(run, None) if x.title == "sigma0"]  # type: ignore[arg-type]
    assert light.state == state
    assert f"redundancy {round(figures.get('sigma0_redundancy', figures['redundancy']))}," in light.words


@pytest.mark.parametrize(
    ("ratio", "independent", "state"),
    [
        (1.6, {}, "good"),
        (2.4, {}, "look"),
        (1.6, {"check_independent_x": 30.0}, "look"),
        (1.3, {"check_independent_x": 30.0}, "good"),
    ],
)
def test_check_points_are_held_against_theory_by_how_many_independent_errors_they_have(
    ratio: float, independent: dict[str, float], state: str
) -> None:
    """99.9 % limits of sqrt(chi2(n) / n): 0.126 to 2.236 for 4 check points, 0.600 to 1.439 for 30 independent."""
    figures = {"check_points": 4, "check_theory_ratio_x": ratio, "check_theory_ratio_y": 1.0, **independent}
    stage = SimpleNamespace(name="accuracy", metrics=figures, status="done")
    run = SimpleNamespace(evaluated=lambda: [stage], last=lambda kind: None)
    (light,) = [x for x in external_lights(run) if x.title == "Check against theory"]  # type: ignore[arg-type]
    assert light.state == state, light.words


def test_of_several_blocks_that_counts_which_the_last_result_is_of() -> None:
    def stage(name: str, kind: str, inputs: dict[str, str]) -> StageView:
        return StageView(name, "", kind, inputs, {"metrics": {}}, None, ())

    west, east, solution = made_block(), made_block(), made_solution(made_block())
    stages = (
        stage("west", "Block", {}),
        stage("bundle", "Solution", {"block": "west"}),
        stage("east", "Block", {}),
    )
    run = RunView(Path(), {}, stages, {"west": west, "bundle": solution, "east": east})
    assert run.last(Block) is west


def test_the_evaluation_of_a_result_counts_and_not_the_set_ups_that_come_after_it() -> None:
    def stage(name: str, metrics: dict[str, float]) -> StageView:
        return StageView(name, f"accuracy/{name}", "Evaluation", {}, {"metrics": metrics}, None, ())

    accuracy, plotter = stage("evaluation", {"check_points": 5}), stage("plotter", {"single_models": 3})
    assert [s.name for s in RunView(Path(), {}, (accuracy, plotter)).evaluated()] == ["evaluation"]
    assert [s.name for s in RunView(Path(), {}, (plotter,)).evaluated()] == ["plotter"]


@pytest.mark.parametrize(
    ("points", "theory", "state"),
    [(30, "look", "look"), (30, "none", "good"), (16, "good", "good"), (16, "look", "look"), (16, "none", "look")],
)
def test_check_points_are_good_where_theory_explains_their_errors_or_many_without_a_theory(
    points: int, theory: str, state: str
) -> None:
    """Errors nine times their standard deviations were green as soon as there were thirty of them."""
    light = _check({"check_points": points, "check_rmse_x_m": 0.012, "check_rmse_y_m": 0.1}, Light("", theory, ""))
    assert light.state == state
    assert light.words.startswith(f"RMSE X 12, Y 100 mm at {points} check points")


@pytest.mark.slow
def test_the_accuracy_of_a_start_is_not_that_of_a_result_that_is_still_to_be_evaluated(tmp_path: Path) -> None:
    """A run that was stopped between its bundle and the evaluation of it; the start has its own."""
    block = made_block()
    start, evaluation = made_solution(block, shift_m=0.5), evaluate(block, made_solution(block, shift_m=0.5))
    before = [("start", "initial_orientation/graph", {"block": "block"}, "Solution")]
    before += [("accuracy_start", "accuracy/evaluation", {"block": "block", "solution": "start"}, "Evaluation")]
    artifacts = {"block": block, "start": start, "accuracy_start": evaluation, "bundle": made_solution(block)}
    declared = [STAGES[0], *before, *STAGES[1:]]
    stopped = view(make_run(tmp_path / "stopped", artifacts, declared=declared))
    assert [light.words for light in external_lights(stopped)] == ["accuracy was not evaluated"]
    assert "The accuracy was not evaluated." in judgement(stopped)
    done = view(make_run(tmp_path / "done", {**artifacts, "accuracy": evaluation}, declared=declared))
    assert judgement(done).startswith("Check points agree")
    of_start = view(make_run(tmp_path / "start", {k: artifacts[k] for k in list(artifacts)[:3]}, declared=declared))
    assert "Check points agree" in judgement(of_start)


def test_what_the_evaluation_of_a_start_warns_of_is_no_problem_of_the_result(tmp_path: Path) -> None:
    block, warning = made_block(), "heights bend"
    result = made_solution(block)
    declared = [STAGES[0], ("start", "initial_orientation/graph", {"block": "block"}, "Solution")]
    declared += [("accuracy_start", "accuracy/evaluation", {"block": "block", "solution": "start"}, "Evaluation")]
    artifacts = {"block": block, "start": result, "accuracy_start": evaluate(block, result)}
    artifacts |= {"bundle": result, "accuracy": evaluate(block, result)}
    run = view(make_run(tmp_path, artifacts, declared=[*declared, *STAGES[1:]]))
    for stage in run.stages:
        stage.record["warnings"] = [f"{warning} in {stage.name}"]
    texts = [problem.text for problem in problems(run, [])]
    assert [text for text in texts if warning in text.lower() and "accuracy" in text] == ["Heights bend in accuracy"]


def test_a_light_of_sigma0_and_its_warning_are_one_problem_with_the_cause(tmp_path: Path) -> None:
    cause = "sigma0 2.000, expected 0.9 to 1.1 (95 %): gross errors"
    artifacts = made_artifacts()
    artifacts["bundle"] = replace(artifacts["bundle"], sigma0=2.0)
    run = view(make_run(tmp_path / "run", artifacts))
    next(stage for stage in run.stages if stage.name == "bundle").record["warnings"] = [cause]
    lights = internal_lights(run, run.last(Solution))
    assert [(p.text, p.section) for p in problems(run, lights) if "sigma0" in p.text] == [(cause, "residuals")]


def test_a_block_without_a_scale_is_told_in_units_of_the_model(tmp_path: Path) -> None:
    block = made_block(check=False, truth=False)
    block = replace(block, ground_points=block.ground_points.take(np.zeros(0, int)))
    solution = made_solution(block)
    run = make_run(tmp_path / "run", {"block": block, "bundle": solution, "accuracy": evaluate(block, solution)})
    write_report(run)
    page = json.loads((run / "report.json").read_text())
    assert re.search(
        r"new points are known to [\d.]+, [\d.]+ and [\d.]+ units of the model in X, Y and Z\.", page["judgement"]
    )
    assert page["facts"]["m and mm"] == "units of the model: no observation gives the scale"
    bars = re.findall(r'class="scale"[^>]*>([^<]*)<', (run / "report.html").read_text())
    assert bars
    assert all(bar.endswith(" units of the model") for bar in bars)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("free", "count", "reason"),
    [
        (True, 1, "1 check point cannot be compared: the datum is free, and it cannot carry what is open of it"),
        (False, 1, "1 check point cannot be compared: it is not determined"),
        (True, 2, "2 check points cannot be compared: the datum is free, and they cannot carry what is open of it"),
        (False, 2, "2 check points cannot be compared: none of them is determined"),
    ],
)
def test_why_check_points_are_not_compared_is_told(tmp_path: Path, free: bool, count: int, reason: str) -> None:
    """Two points leave a turn about their line open; points without rays are not determined."""
    block = made_block(truth=False)
    ground = block.ground_points
    checks = np.flatnonzero((ground.role == CHECK).any(axis=1))[:count]
    block = replace(block, ground_points=ground.take(checks))
    solution = made_solution(block)
    if free:
        rays = solution.residuals.take(solution.residuals.kind == "image_point")
        carriers = DatumCarriers(kind=np.full(len(block.points), "point"), id=block.points.id)
        solution = replace(solution, residuals=rays, datum=carriers)
    else:
        xyz_m = solution.points.xyz_m.copy()
        xyz_m[ground.point[checks]] = np.nan
        solution = replace(solution, points=replace(solution.points, xyz_m=xyz_m))
    run = make_run(tmp_path / "run", {"block": block, "bundle": solution, "accuracy": evaluate(block, solution)})
    write_report(run)
    page = json.loads((run / "report.json").read_text())
    assert f"({reason})" in page["judgement"]
    assert page["external"][0]["words"] == reason


def test_check_points_to_which_a_free_datum_was_fitted_are_no_independent_check() -> None:
    figures = {"check_points": 40, "check_rmse_x_m": 0.012, "check_aligned_components": 7}
    light = _check(figures, Light("", "good", ""))
    assert light.state == "none"
    assert light.words.endswith("at 40 check points, after the open datum was fitted to them")
    assert _check(figures | {"check_aligned_components": 0}, Light("", "good", "")).state == "good"


def test_what_fits_with_exchanged_numbers_has_a_remedy(tmp_path: Path) -> None:
    write_report(make_run(tmp_path / "run", made_artifacts(), warnings=[f"image_point: {EXCHANGED}: a/1, a/2"]))
    problems = json.loads((tmp_path / "run" / "report.json").read_text())["problems"]
    told = next(problem for problem in problems if EXCHANGED in problem["text"])
    assert told["text"] == f"Image points: {EXCHANGED}: a/1, a/2"
    assert told["remedy"] == "`aatri edit` proposes the exchange"
    page = (tmp_path / "run" / "report.html").read_text()
    assert page.count(f"image_point: {EXCHANGED}") == 0  # nor with its stage


def test_warnings_of_the_way_stand_on_the_first_page_of_a_run_that_was_stopped_there(tmp_path: Path) -> None:
    run = make_run(
        tmp_path / "run", {"block": made_block()}, warnings=["image_point: 2 of 9 are alone", "strip: image_point 7"]
    )
    write_report(run)
    problems = json.loads((run / "report.json").read_text())["problems"]
    assert [p["text"] for p in problems] == ["Image points: 2 of 9 are alone", "strip: image point 7"]


def test_keys_of_files_stay_as_they_are_written() -> None:
    (offer,) = (o for o in offers_of(replace(made_block(), earth_curvature="correct")) if "curvature" in o.name)
    assert in_words(f"{offer.what}: not used") == "`earth_curvature: correct` (block.yaml): not used"


def test_warnings_of_the_result_stand_on_the_first_page_but_for_what_is_named_there_already(tmp_path: Path) -> None:
    told = ["hardly determined: the heights; give `control`", f"control: 1 of 5 {REJECTED}: p00", "close: k2 and k3"]
    run = make_run(tmp_path / "run", made_artifacts(), warnings=told)
    page = write_report(run).read_text()
    problems = json.loads((run / "report.json").read_text())["problems"]
    first = "Hardly determined: the heights; give `control`"
    assert [p["text"] for p in problems if p["stage"] == "bundle"] == [first, told[2]]
    assert "give <code>control</code>" in page


def test_a_pipeline_that_does_not_fit_its_block_is_the_first_problem(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", {"block": made_block()}, status="failed")
    overview = json.loads((run / "run.json").read_text())
    refused = [{"where": "stage absolute", "what": "neither control nor positions", "remedy": "give control"}]
    (run / "run.json").write_text(json.dumps(overview | {"refused": refused}))
    write_report(run)
    page = json.loads((run / "report.json").read_text())
    assert page["problems"][0]["text"] == "stage absolute: neither control nor positions"
    assert page["problems"][0]["remedy"] == "give control"
    assert page["judgement"].startswith("The pipeline does not fit the block")
