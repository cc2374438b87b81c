"""What the first page says of how the result was made."""

from dataclasses import replace
from typing import Any

import numpy as np

from aatri.evaluation.accuracy import evaluate
from aatri.report.facts import was_done
from aatri.report.sections.evaluation import show
from aatri.report.sections.parts import PageSection, Surroundings
from tests.made_solutions import made_block, made_solution

BUNDLE = "bundle_adjustment/bundle"


def test_counts_of_what_was_adjusted_and_how_are_sentences() -> None:
    block = made_block()
    solution = made_solution(block)
    options: dict[str, Any] = {"datum": "given", "self_calibration": {"set": "brown"}, "blunders": {"method": "none"}}
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
    assert "The datum is free: nothing ties the block to the ground." in text
    assert was_done(None, block, BUNDLE, {}) == ""


def test_each_sentence_on_the_accuracy_is_a_line() -> None:
    block = made_block()
    solution = made_solution(block)
    evaluation = evaluate(block, solution)
    section = PageSection("accuracy", "")
    show(section, evaluation, Surroundings(block, None, solution))
    assert len(section.notes) == evaluation.verdict.count(". ") + 1 > 2
    assert " ".join(section.notes) == evaluation.verdict
