"""Limits of empirical over theoretical accuracy by the number of independent errors."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aatri.artifacts.solution import IndependentErrors
from aatri.evaluation.accuracy import evaluate
from aatri.evaluation.expected_ratios import expected_ratios, outside_expected
from tests.made_solutions import made_block, made_solution


def _evaluated(counts: list[list[float]], sigma_m: float):
    block = made_block()
    independent = IndependentErrors(points=["new", "check"], count=counts)
    shift = np.full((20, 3), 0.02)
    solution = dataclasses.replace(made_solution(block, shift_m=shift, sigma_m=sigma_m), independent_errors=independent)
    return evaluate(block, solution)


def test_limits_are_those_of_chi_square_tables() -> None:
    figures = _evaluated([[10.0, 20.0, np.nan], [4.0, 4.0, 4.0]], 0.02).metrics()
    # chi-square of 10 degrees of freedom: 3.247 and 20.483 at 2.5 and 97.5 %; of 20: 9.591 and 34.170
    assert figures["truth_over_theory_x_low"] == pytest.approx(np.sqrt(3.247 / 10), rel=1e-4)
    assert figures["truth_over_theory_x_high"] == pytest.approx(np.sqrt(20.483 / 10), rel=1e-4)
    assert figures["truth_over_theory_y_high"] == pytest.approx(np.sqrt(34.170 / 20), rel=1e-4)
    assert "truth_over_theory_z_low" not in figures
    assert figures["check_independent_z"] == 4.0


def test_a_ratio_beyond_chance_is_told_and_one_within_is_not() -> None:
    assert "Beyond chance" not in _evaluated([[10.0] * 3, [4.0] * 3], 0.02).verdict
    verdict = _evaluated([[10.0, 10.0, 3.0], [1.5] * 3], 0.01).verdict  # a ratio of 2
    assert "true errors over theory: X 2.00 (expected 0.3" in verdict
    assert "Y 2.00" in verdict
    assert "Z 2.00" not in verdict
    assert "check errors" not in verdict


def test_the_ratio_of_control_left_out_has_its_number_and_limits() -> None:
    independent = IndependentErrors(points=["left_out"], count=[[10.0, 20.0, 3.0]])
    found = expected_ratios({"left_out_theory_ratio_x": 1.1, "left_out_theory_ratio_z": 3.1}, independent, 0.95)
    assert found["left_out_independent_x"] == 10.0
    assert found["left_out_theory_ratio_x_low"] == pytest.approx(np.sqrt(3.247 / 10), rel=1e-4)
    assert "left_out_independent_y" not in found
    ratios = {"left_out_theory_ratio_x": 1.1, "left_out_theory_ratio_z": 3.1}
    (text,) = outside_expected({**found, **ratios}, "left_out")
    assert text.startswith("Beyond chance, control without itself over theory: Z 3.10")
