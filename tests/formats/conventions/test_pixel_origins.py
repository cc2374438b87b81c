"""One place in an image in the pixel systems of all programs; expected by hand: an image of 6 x 4 pixels."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.formats.conventions.pixel_origins import PIXEL_AXES, centre_px, converted, named, principal_point_mm

FORMAT = (6.0, 4.0)
CORNER = {
    "aatri": (0.0, 0.0),
    "bal": (-3.0, 2.0),
    "colmap": (0.0, 0.0),
    "nvm": (-3.0, -2.0),
    "odm_gcp": (-0.5, -0.5),
    "opencv": (-0.5, -0.5),
    "opensfm": (-0.5, -2 / 6),
    "opf": (0.0, 0.0),
    "photomod": (0.0, 4.0),
    "pix4d": (0.0, 0.0),
}
"""The outer corner of the first pixel, upper left, as each program counts it."""


@pytest.mark.parametrize("program", CORNER)
def test_the_corner_of_an_image_is_where_the_program_has_it(program: str) -> None:
    axes = PIXEL_AXES[program]
    there = converted([[0.0, 0.0]], PIXEL_AXES["metashape"], axes, FORMAT)[0]
    np.testing.assert_allclose(there, CORNER[program], atol=1e-15)
    np.testing.assert_allclose(converted([there], axes, PIXEL_AXES["metashape"], FORMAT)[0], 0.0, atol=1e-15)


@pytest.mark.parametrize("program", PIXEL_AXES)
def test_a_principal_point_goes_to_millimetres_and_back(program: str) -> None:
    axes, pixel_mm = PIXEL_AXES[program], np.array([0.004, 0.005])
    assert named(axes.name) == axes
    back = centre_px([0.01, -0.02], axes, FORMAT, pixel_mm)
    np.testing.assert_allclose(principal_point_mm(back, axes, FORMAT, pixel_mm), [0.01, -0.02], atol=1e-15)


def test_a_principal_point_right_of_and_below_the_centre_has_positive_x_and_negative_y() -> None:
    mm = principal_point_mm([3.5, 2.5], PIXEL_AXES["metashape"], FORMAT, np.array([0.01, 0.01]))
    np.testing.assert_allclose(mm, [0.005, -0.005], atol=1e-15)
