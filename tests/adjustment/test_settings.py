"""SolverSettings are given once, as one object or by name."""

from __future__ import annotations

import dataclasses

import pytest

from aatri.adjustment.settings import SolverSettings
from aatri.adjustment.stepping.adjust import adjust_large
from tests.adjustment.block_problem import made_problem


def test_settings_reach_the_problem_as_one_object_or_by_name() -> None:
    problem = made_problem()
    settings = SolverSettings(ordering="minimum_degree", threads=1, tolerance=1e-9)
    one = adjust_large(*problem, settings=settings)
    assert one.problem.settings == settings
    other = adjust_large(*problem, settings=SolverSettings(threads=1, tolerance=1e-9), ordering="minimum_degree")
    assert other.problem.settings == settings
    assert (one.state["a"] == other.state["a"]).all()


def test_an_unknown_setting_is_refused() -> None:
    with pytest.raises(TypeError, match="iterations"):
        adjust_large(*made_problem(), iterations=3)


def test_settings_cannot_be_changed() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        SolverSettings().threads = 2  # type: ignore[misc]
