"""Figures of cameras as they are given: a line each, and what no camera and no flight has."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.checks.as_read.cameras import CameraFrames, camera_figures


def _camera(c_mm: float = 150.0, pixel_mm: float = 0.02) -> CameraFrames:
    return CameraFrames(["c"], np.array([c_mm]), np.array([[115.0, 115.0]]), np.array([pixel_mm]))


ZERO = np.zeros(3, dtype=np.int64)


def test_a_line_per_camera_tells_what_is_given_and_nothing_of_a_camera_of_which_nothing_is() -> None:
    bare = CameraFrames(
        ["c", "bare"], np.array([150.0, np.nan]), np.array([[115.0, 115.0], [np.nan, np.nan]]), np.array([0.02, np.nan])
    )
    (finding,) = camera_figures(bare, ZERO, np.array([740.0, 750.0, 760.0]))
    # 2 atan(115 sqrt(2) / 150) = 94.6 deg; 750 m away at c = 150 mm: 1 : 5,000, 0.02 mm are 0.1 m
    assert str(finding) == (
        "camera c: 750 m from the control it shows, field of view 94.6 deg, scale 1 : 5,000, "
        "ground sampling distance 0.1 m"
    )


@pytest.mark.parametrize(
    ("camera", "distance_m", "what"),
    [
        (_camera(c_mm=0.15), 750.0, "field of view of 180"),
        (_camera(c_mm=150000.0), 750.0, "field of view of 0.12"),
        (_camera(pixel_mm=21.0), 750.0, "ground sampling distance of 105 m"),
        (_camera(pixel_mm=np.nan), 450e3, "scale of 1 : 3,000,000"),
    ],
)
def test_figures_that_no_camera_has_are_warnings(camera: CameraFrames, distance_m: float, what: str) -> None:
    warned = [str(f) for f in camera_figures(camera, ZERO, np.full(3, distance_m)) if f.level == "warning"]
    assert [text for text in warned if what in text]
    good = camera_figures(_camera(pixel_mm=np.nan), ZERO, np.full(3, 250e3))
    assert not [f for f in good if f.level == "warning"]
