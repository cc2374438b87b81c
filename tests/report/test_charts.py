"""Charts: what they say of what they were made of."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.artifacts.solution import Iterations
from aatri.report.drawing.charts import iterations_chart, residual_histogram, sigma0_chart
from tests.made_solutions import made_block, made_solution


def test_sigma0_stands_on_a_logarithmic_axis_each_stage_in_a_row_of_its_own() -> None:
    sigma0 = {"models": 1.0, "absolute": 10.0, "bundle": 0.0}
    picture = sigma0_chart(sigma0)
    assert picture is not None
    _, bars, dots, _ = picture.marks
    np.testing.assert_allclose(dots.xy, [[1.0, 3.0], [10.0, 2.0], [1e-12, 1.0]])
    np.testing.assert_allclose(bars.xy[:, 0, 0], 1.0)
    assert picture.across.logarithmic
    assert picture.up.names == {3.0: "models", 2.0: "absolute", 1.0: "bundle"}
    assert sigma0_chart({}) is None


def test_iterations_tell_sigma0_and_the_length_of_the_step() -> None:
    history = Iterations(cost=[400.0, 100.0], decrement=[30.0, np.nan], damping=[0.0, 0.0])
    picture = iterations_chart(made_solution(made_block(), history=history, redundancy=100))
    assert picture is not None
    curve, _, steps, _ = picture.marks
    np.testing.assert_allclose(curve.xy, [[1.0, 2.0], [2.0, 1.0]])
    np.testing.assert_allclose(steps.xy, [[1.0, 30.0]])
    assert iterations_chart(made_solution(made_block(), history=history.take([0]))) is None


def test_the_histogram_has_the_area_of_the_normal_curve_and_its_shape() -> None:
    picture = residual_histogram(np.append(np.random.default_rng(3).standard_normal(200_000), [5.1, -6.0]))
    assert picture is not None
    columns, curve = picture.marks
    heights = columns.xy[:, 2, 1]
    assert np.sum(heights * np.ptp(columns.xy[..., 0], axis=1)) == pytest.approx(1.0, abs=1e-4)
    middle = columns.xy[..., 0].mean(axis=1)
    np.testing.assert_allclose(heights, np.exp(-0.5 * middle**2) / np.sqrt(2 * np.pi), atol=0.01)
    assert curve.xy[:, 1].max() == pytest.approx(1 / np.sqrt(2 * np.pi))
    assert "(200,002)" in picture.caption
    assert "2 beyond 5." in picture.caption
    assert residual_histogram(np.zeros(3)) is None
