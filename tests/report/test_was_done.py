"""What the first page says of how the result was made."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from aatri.artifacts.block import Points
from aatri.artifacts.solution import CalibratedSets, Parameters
from aatri.codes import CHECK, CONTROL
from aatri.evaluation.accuracy import evaluate
from aatri.report.facts import was_done
from aatri.report.page import _was_done
from aatri.report.sections.evaluation import show
from aatri.report.sections.parts import PageSection, Surroundings
from tests.made_solutions import made_block, made_solution

BUNDLE = "bundle_adjustment/bundle"


def test_counts_of_what_was_adjusted_and_how_are_sentences() -> None:
    block = made_block()
    solution = made_solution(block)
    options: dict[str, Any] = {"datum": "given", "self_calibration": {"set": "brown"}, "blunders": {"method": "none"}}
    solution = replace(solution, parameters=_estimated("additional"), calibrated_sets=_sets("brown"))
    text = was_done(solution, block, BUNDLE, options)
    images, points = solution.metrics()["images"], solution.metrics()["points"]
    assert text.startswith(f"Bundle adjustment of {images} images and {points} points by ")
    assert "Cameras are estimated (brown). The search for gross errors was set to none." in text
    assert "nothing ties" not in text
    assert "check points took no part." in text


def test_exact_control_and_a_free_datum_are_named() -> None:
    block = made_block()
    solution = made_solution(block)
    residuals = solution.residuals
    sigma = np.where((residuals.kind == "control")[:, None], 0.0, residuals.sigma)
    exact = replace(solution, residuals=replace(residuals, sigma=sigma))
    text = was_done(exact, block, BUNDLE, {"datum": "free"})
    assert "control points (held exactly)" in text
    assert "What control leaves open of the datum is free." in text
    untied = replace(solution, residuals=residuals.take(residuals.kind != "control"))
    assert "The datum is free: nothing ties the block to the ground." in was_done(
        untied, block, BUNDLE, {"datum": "free"}
    )
    assert was_done(None, block, BUNDLE, {}) == ""


def test_cameras_with_open_parameters_of_their_own_or_calibrated_before_are_estimated() -> None:
    block = made_block()
    solution, options = made_solution(block), {"self_calibration": None}
    assert "Cameras are as the block says." in was_done(solution, block, BUNDLE, options)
    assert "Cameras are estimated." in was_done(
        replace(solution, parameters=_estimated("camera")), block, BUNDLE, options
    )
    calibrated = replace(solution, parameters=_estimated("additional"), calibrated_sets=_sets("ebner"))
    assert "Cameras are estimated (ebner)." in was_done(calibrated, block, BUNDLE, options)
    drift = replace(solution, parameters=_estimated("drift"))
    assert "Cameras are as the block says." in was_done(drift, block, BUNDLE, options)


def test_a_point_that_is_control_in_plan_takes_part() -> None:
    block = made_block()
    ground = block.ground_points
    role = np.where((ground.role == CHECK) & [True, True, False], CONTROL, ground.role)
    in_plan = replace(block, ground_points=replace(ground, role=role))
    assert "took no part" not in was_done(made_solution(block), in_plan, BUNDLE, {})


def test_nothing_is_said_of_a_last_adjustment_that_cannot_be_read() -> None:
    block = made_block()
    around = Surroundings(block, None, made_solution(block))
    first, last = (SimpleNamespace(name=name, use=BUNDLE, record={}) for name in ("first", "last"))
    read = {"first": around.solution}
    run: Any = SimpleNamespace(of_kind=lambda _: [first, last], readable=lambda _: read)
    assert _was_done(run, around) == ""
    read["last"] = around.solution
    assert _was_done(run, around).startswith("Bundle adjustment of")


def test_each_statement_on_the_accuracy_is_a_line_also_with_a_point_in_an_id() -> None:
    block = made_block()
    block = replace(block, points=Points(id=np.where(block.points.id == "p10", "St. Anna", block.points.id)))
    shift = np.where(block.points.id == "St. Anna", 0.9, 0.0)[:, None]
    solution = made_solution(made_block(), shift_m=shift * [0.0, 0.0, 1.0])
    solution = replace(solution, points=replace(solution.points, id=block.points.id))
    section = PageSection("accuracy", "")
    show(section, evaluate(block, solution), Surroundings(block, None, solution))
    assert len(section.notes) > 2
    assert all(note[0].isupper() and note.endswith(".") for note in section.notes)
    assert any(note.startswith("Check points farther off") and "St. Anna (" in note for note in section.notes)


def _estimated(group: str) -> Parameters:
    return Parameters(group=[group], object=["cam"], name=["c"], value=[0.1], sigma=[0.01])


def _sets(name: str) -> CalibratedSets:
    return CalibratedSets(
        object=["cam"],
        camera=["cam"],
        per=["camera"],
        set=[name],
        parameters=[1],
        interior=[False],
        principal_distance_mm=[150.0],
        principal_point_mm=[[0.0, 0.0]],
        half_format_mm=[[115.0, 115.0]],
        base_mm=[90.0],
        distortion=[""],
    )
