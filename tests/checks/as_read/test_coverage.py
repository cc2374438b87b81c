"""Units of image coordinates, from what the points cover of the format."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.checks.as_read.cameras import CameraFrames
from aatri.checks.as_read.coverage import coverage

FILM = CameraFrames(["wide"], np.array([153.0]), np.array([[115.0, 115.0]]), np.array([np.nan]))
BARE = CameraFrames(["wide"], np.array([153.0]), np.array([[np.nan, np.nan]]), np.array([np.nan]))
XY = 100.0 * np.random.default_rng(3).uniform(-1, 1, (40, 2))
OF = np.zeros(40, dtype=np.int64)


@pytest.mark.parametrize("cameras", [FILM, BARE])
def test_points_spread_over_the_image_are_no_error_and_no_warning(cameras: CameraFrames) -> None:
    assert not [finding for finding in coverage(cameras, OF, XY) if finding.level != "note"]


@pytest.mark.parametrize(
    ("factor", "what"),
    [
        (1e-3, "its 40 image points lie within"),  # metres
        (1 / 25.4, "its 40 image points lie within"),  # inches
        (1e3, "mm from the middle of the image"),  # micrometres
    ],
)
def test_another_unit_is_an_error_that_names_the_camera(factor: float, what: str) -> None:
    (error,) = coverage(FILM, OF, factor * XY)
    assert error.level == "error"
    assert what in error.sentence
    assert error.where == "camera wide"
    assert "unit of the image coordinates" in error.remedy


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_without_a_format_the_angle_that_points_span_is_a_warning(factor: float) -> None:
    reach = factor * np.linalg.norm(XY, axis=1).max()
    (finding,) = coverage(BARE, OF, factor * XY)
    assert finding.level == "warning"
    assert f"span {np.degrees(2 * np.arctan(reach / 153.0)):.3g} deg" in finding.sentence


def test_a_small_target_in_the_middle_is_a_warning_and_few_points_are_nothing() -> None:
    (finding,) = coverage(FILM, OF, 0.07 * XY)
    assert finding.level == "warning"
    assert coverage(FILM, OF[:19], 1e-3 * XY[:19]) == []
