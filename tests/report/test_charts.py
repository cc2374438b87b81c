"""Charts: what a ruler laid on the picture would read."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.report.drawing.charts import convergence_chart, residual_histogram, sigma0_chart
from tests.report.marks import paths, size, texts


def test_sigma0_stands_on_a_logarithmic_axis_each_stage_in_a_row_of_its_own() -> None:
    sigma0 = {"models": 1.0, "absolute": 10.0, "strip_block": 0.1, "bundle": 1.2}
    picture = str(sigma0_chart(sigma0)[0])
    width, height = size(picture)
    x, y = np.concatenate(paths(picture, "dots mark")).T
    unit = paths(picture, "axis strong-line")[0][0, 0]
    np.testing.assert_allclose(x[0], unit, atol=0.1)
    np.testing.assert_allclose(x[1] - unit, unit - x[2], atol=0.21)  # a decade on each side
    np.testing.assert_allclose((x[3] - unit) / (x[1] - unit), np.log10(1.2), atol=0.002)
    assert (np.diff(y) == 22.0).all()
    assert y[0] > 0
    assert y[-1] < paths(picture, "axis")[0][0, 1] < height
    bars = np.array(paths(picture, "bar"))
    np.testing.assert_array_equal(bars[:, 0, 0], unit)
    np.testing.assert_array_equal(bars[:, 1], np.column_stack([x, y]))
    written = texts(picture)
    for k, (name, value) in enumerate(sigma0.items()):
        label = next(t for t in written if t.text == name)
        figure = next(t for t in written if t.text == f"{value:.3g}" and abs(t.y - y[k]) < 8 and t.anchor == "start")
        assert label.anchor == "end"
        assert label.x < 135.0
        assert abs(label.y - y[k]) < 8
        assert max(x[k], unit) < figure.x < width
    ticks = {t.text: t.x for t in written if t.anchor == "middle"}
    assert ticks["1"] == pytest.approx(unit, abs=0.1)
    assert ticks["10"] == pytest.approx(x[1], abs=0.1)
    assert all(t.y > y[-1] and t.y < height for t in written if t.anchor == "middle")


def test_a_sigma0_of_zero_is_drawn_at_the_edge() -> None:
    picture = str(sigma0_chart({"a": 0.0, "b": 1.0})[0])
    x = np.concatenate(paths(picture, "dots mark"))[:, 0]
    assert x[0] == pytest.approx(135.0)
    assert x[0] < x[1]


def test_convergence_goes_down_from_left_to_right_the_decrement_below_the_cost() -> None:
    cost, decrement = np.array([1e6, 1e4, 1e4, 1e4]), np.array([1e3, 1.0, 1e-3, np.nan])
    picture = str(convergence_chart(cost, decrement)[0])
    _, height = size(picture)
    upper, lower = paths(picture, "curve cost")[0], paths(picture, "curve decrement")[0]
    assert len(upper) == 4
    assert len(lower) == 3
    np.testing.assert_allclose(np.diff(upper[:, 0]), upper[1, 0] - upper[0, 0], atol=0.11)
    np.testing.assert_array_equal(upper[:3, 0], lower[:, 0])
    assert upper[0, 1] < upper[1, 1] == upper[2, 1] < lower[0, 1] < lower[1, 1] < lower[2, 1] < height - 12
    np.testing.assert_allclose(lower[2, 1] - lower[1, 1], lower[1, 1] - lower[0, 1], atol=0.21)  # three decades each
    below = [t for t in texts(picture) if t.anchor == "middle" and t.y > lower[2, 1]]
    assert [t.text for t in below] == ["1", "2", "3", "4"]
    np.testing.assert_allclose([t.x for t in below], upper[:, 0], atol=0.11)
    assert {t.text for t in texts(picture)} > {"cost", "Newton decrement", "iteration"}
    np.testing.assert_array_equal(np.concatenate(paths(picture, "dots cost")), upper)


def test_one_iteration_is_no_chart_and_a_hundred_have_few_figures() -> None:
    assert convergence_chart(np.ones(1), np.ones(1)) is None
    assert convergence_chart(np.ones(2), np.ones(2)) is not None
    many = str(convergence_chart(np.full(100, 5.0), np.full(100, np.nan))[0])
    assert not paths(many, "curve decrement")
    assert [t.text for t in texts(many) if t.anchor == "middle"][:3] == ["1", "11", "21"]


def test_the_histogram_has_the_area_of_the_normal_curve_and_its_shape():
    z = np.random.default_rng(3).standard_normal(200_000)
    picture, caption = residual_histogram(z)
    outline, curve = paths(str(picture), "histogram")[0], paths(str(picture), "curve normal")[0]
    base = outline[0, 1]

    def area(xy: np.ndarray) -> float:
        return float(np.sum(np.diff(xy[:, 0]) * (base - 0.5 * (xy[1:, 1] + xy[:-1, 1]))))

    assert area(outline) == pytest.approx(area(curve), rel=0.003)
    top = curve[np.argmin(curve[:, 1])]
    assert top[0] == pytest.approx(180.0, abs=0.1)  # the middle of 360 px
    one_sigma = np.interp(180.0 + 32.0, curve[:, 0], base - curve[:, 1])  # ten sigmas are 320 px
    assert one_sigma / (base - top[1]) == pytest.approx(np.exp(-0.5), abs=0.005)
    steps = np.interp(180.0 + 36.0, outline[:, 0], base - outline[:, 1])
    assert steps / (base - top[1]) == pytest.approx(np.exp(-0.5 * 1.125**2), abs=0.02)  # the cell from 1 to 1.25
    assert "(200,000)" in caption
    assert "None beyond 5." in caption
    ticks = {t.text: t.x for t in texts(str(picture))}
    assert ticks["0"] == 180.0
    assert ticks["1"] == 212.0
    assert ticks["-5"] == 20.0


def test_residuals_beyond_the_picture_are_counted() -> None:
    caption = residual_histogram(np.array([*np.zeros(20), 5.1, -6.0, 5.0]))[1]
    assert "2 beyond 5." in caption
