"""Vectors and bars of differences: direction, common scale and key."""

from __future__ import annotations

import re

import numpy as np
import pytest

from aatri.report.drawing.residual_plots import height_bars, image_vectors, plan_vectors, tie_pictures
from tests.report.marks import paths, size, texts

XYZ_M = np.array([[0.0, 0.0, 5.0], [1000.0, 0.0, 5.0], [1000.0, 600.0, 5.0], [0.0, 600.0, 5.0]])


def _vectors(picture: str, class_: str) -> tuple[np.ndarray, np.ndarray]:
    """Start and vector, both (n, 2), y up."""
    ends = paths(picture, f"vector {class_}")[0].reshape(-1, 2, 2)
    return ends[:, 0], (ends[:, 1] - ends[:, 0]) * [1.0, -1.0]


def _of_key(picture: str) -> tuple[float, float]:
    """Pixels and metres of the vector of round length."""
    start, vector = _vectors(picture, "ink")
    label = next(
        t for t in texts(picture) if t.anchor == "middle" and t.y > start[0, 1] and re.match(r"\d+ mm", t.text)
    )
    assert start[0, 0] < label.x < start[0, 0] + vector[0, 0]
    return float(vector[0, 0]), float(label.text.split()[0]) * 1e-3


def test_plan_vectors_point_where_the_differences_do_in_the_scale_of_the_key() -> None:
    d = np.array([[0.03, 0.0, 9.0], [0.0, 0.04, 9.0], [-0.05, 0.0, 9.0], [0.0, -0.02, np.nan]])
    picture, caption = plan_vectors({"control": (XYZ_M, d)})
    picture = str(picture)
    start, vector = _vectors(picture, "control")
    px, metres = _of_key(picture)
    np.testing.assert_allclose(vector * metres / px, d[:, :2], atol=0.15 * metres / px)
    dots = paths(picture, "dots control")[0]
    np.testing.assert_array_equal(dots, start)
    px_per_m = (start[1, 0] - start[0, 0]) / 1000.0
    np.testing.assert_allclose(start[0, 1] - start[3, 1], 600.0 * px_per_m, atol=0.11)  # north is up
    times = float(re.search(r"Exaggerated ([\d,]+) times", caption)[1].replace(",", ""))
    assert times == pytest.approx(px / metres / px_per_m, rel=0.01)
    assert "at 4 control points (red); the largest is 50 mm" in caption
    width, height = size(picture)
    assert (start + vector * [1.0, -1.0] < [width, height]).all()
    assert (start + vector * [1.0, -1.0] > 0).all()


def test_many_vectors_are_drawn_half_as_long() -> None:
    rng = np.random.default_rng(2)
    times = []
    for n in (290, 310):
        xyz = np.column_stack([rng.permutation(n) * 10.0, rng.permutation(n) * 10.0, np.zeros(n)])
        d = np.tile([0.03, 0.04, 0.0], (n, 1))
        drawn = plan_vectors({"new": (xyz, d)})
        assert drawn is not None
        times.append(float(re.search(r"Exaggerated ([\d,]+) times", drawn[1])[1].replace(",", "")))
    assert times[1] < times[0]


def test_bars_go_up_where_the_height_is_too_large() -> None:
    d = np.array([[9.0, 9.0, 0.03], [np.nan, 9.0, -0.05], [9.0, 9.0, np.nan], [9.0, 9.0, 0.0]])
    picture, caption = height_bars({"check": (XYZ_M, d)})
    _start, vector = _vectors(str(picture), "check")
    px, metres = _of_key(str(picture))
    np.testing.assert_allclose(vector * metres / px, [[0, 0.03], [0, -0.05], [0, 0]], atol=0.15 * metres / px)
    assert "at 3 check points (green); the largest is 50 mm" in caption


def test_points_far_off_are_left_out_and_counted() -> None:
    rng = np.random.default_rng(1)
    xyz, d = np.column_stack([rng.uniform(0, 1000, (40, 2)), np.zeros(40)]), np.full((40, 3), 0.01)
    xyz[5, 0], d[5] = 90_000.0, 0.7
    picture, caption = plan_vectors({"new": (xyz, d)})
    assert len(paths(str(picture), "dots new")[0]) == 39
    assert "Not drawn: 1 points that lie far off." in caption
    assert "the largest is 990 mm" in caption  # said, though it is not drawn


def test_cells_of_the_format_show_their_own_mean() -> None:
    rng = np.random.default_rng(2)
    xy = rng.uniform(-100.0, 100.0, (20_000, 2))
    residual = np.where(xy[:, :1] > 0, [[0.004, 0.0]], [[0.0, 0.002]]) + 0.0005 * rng.standard_normal((20_000, 2))
    picture, caption = image_vectors(xy, residual)
    start, vector = _vectors(str(picture), "image")
    px, metres = _of_key_um(str(picture))
    assert len(start) == 144
    right = start[:, 0] > 180.0
    np.testing.assert_allclose(vector[right] * metres / px, np.tile([4e-6, 0.0], (72, 1)), atol=3e-7)
    np.testing.assert_allclose(vector[~right] * metres / px, np.tile([0.0, 2e-6], (72, 1)), atol=3e-7)
    assert "12 x 12 cells" in caption
    assert "13" in re.search(r", (\d+) points a cell", caption)[1]


def _of_key_um(picture: str) -> tuple[float, float]:
    start, vector = _vectors(picture, "ink")
    label = next(t for t in texts(picture) if t.text.endswith(" um") and t.y > start[0, 1])
    return float(vector[0, 0]), float(label.text.split()[0]) * 1e-6


def test_each_strip_has_its_tie_residuals_in_plan_and_height() -> None:
    d = np.array([[0.03, 0.0, 0.1], [0.0, 0.04, 0.1], [-0.05, 0.0, -0.1], [0.0, -0.02, -0.1]])
    pictures = tie_pictures({"1": (XYZ_M, d), "2": (XYZ_M, 2 * d)})
    assert len(pictures) == 4
    assert [re.search(r"strip \d in \w+", caption)[0] for _, caption in pictures] == [
        "strip 1 in plan",
        "strip 1 in height",
        "strip 2 in plan",
        "strip 2 in height",
    ]
    assert all("mean of the strips minus this one" in caption for _, caption in pictures)
    assert "RMS X 29.2 mm, Y 22.4 mm, Z 100 mm" in pictures[0][1]  # roots of 0.0034/4, 0.002/4, 0.01
    _, vector = _vectors(str(pictures[1][0]), "tie")
    assert (vector[:, 0] == 0).all()
    assert (np.sign(vector[:, 1]) == np.sign(d[:, 2])).all()
