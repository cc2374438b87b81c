"""Conventions: poses, names, the origin of pixels."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aatri.formats.conventions.names import OF_POINTS, matched, without_extension
from aatri.formats.conventions.pixel_origins import PIXEL_AXES, converted, named, principal_point_mm
from aatri.formats.conventions.poses import (
    CONVENTIONS,
    ground_from_image,
    is_rotation,
    matrix_of_quaternion,
    position_of,
    quaternion_of_matrix,
    stated_rotation,
    translation_of,
)

# A point is projected in the camera axes of each program, by its own formula, and by ours: the same place.

OMEGA, PHI, KAPPA = 0.2, -0.3, 1.1
CENTRE, POINT = np.array([100.0, 200.0, 50.0]), np.array([103.0, 196.0, 7.0])


def by_hand() -> list[list[float]]:
    """Rx(omega) Ry(phi) Rz(kappa), written out (Kraus, Photogrammetry, appendix)."""
    so, co, sp, cp, sk, ck = (f(a) for a in (OMEGA, PHI, KAPPA) for f in (math.sin, math.cos))
    return [
        [cp * ck, -cp * sk, sp],
        [co * sk + so * sp * ck, co * ck - so * sp * sk, -so * cp],
        [so * sk - co * sp * ck, so * ck + co * sp * sk, co * cp],
    ]


def image_of_point() -> tuple[float, float]:
    """x right, y up, c = 1: the collinearity equations."""
    r, d = by_hand(), (POINT - CENTRE).tolist()
    a = [sum(r[i][k] * d[i] for i in range(3)) for k in range(3)]
    return -a[0] / a[2], -a[1] / a[2]


@pytest.mark.parametrize("program", CONVENTIONS)
def test_a_point_is_projected_by_the_formula_of_each_program(program: str) -> None:
    ours = np.array([by_hand()])
    stated = stated_rotation(ours, program)
    axes, maps = CONVENTIONS[program]
    image_from_ground = stated[0].T if maps == "ground_from_image" else stated[0]
    a = image_from_ground @ (POINT - CENTRE)
    seen = (-a[0] / a[2], -a[1] / a[2]) if axes == "photogrammetric" else (a[0] / a[2], -a[1] / a[2])
    assert (a[2] < 0) == (axes == "photogrammetric")
    np.testing.assert_allclose(seen, image_of_point(), rtol=0, atol=1e-14)
    np.testing.assert_allclose(ground_from_image(stated, program), ours, rtol=0, atol=1e-15)
    t = translation_of(ours, CENTRE[None], program)
    np.testing.assert_allclose(image_from_ground @ POINT + t[0], a, rtol=0, atol=1e-12)
    np.testing.assert_allclose(position_of(ours, t, program), CENTRE[None], rtol=0, atol=1e-12)


def test_a_quaternion_is_w_first_and_turns_counterclockwise() -> None:
    half = math.radians(45)
    turned = matrix_of_quaternion(np.array([[math.cos(half), 0.0, 0.0, math.sin(half)]]))
    np.testing.assert_allclose(turned[0] @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(quaternion_of_matrix(turned), [[math.cos(half), 0, 0, math.sin(half)]], atol=1e-15)


def test_a_reflection_is_no_rotation() -> None:
    assert is_rotation(np.array(by_hand()).round(4))
    assert not is_rotation(np.diag([1.0, 1.0, -1.0]))
    assert not is_rotation(2 * np.eye(3))


# Names of images and points are matched step by step, and never where there is a choice.


def test_each_step_takes_what_the_steps_before_have_left() -> None:
    found = matched(
        ["a/IMG_1.JPG", "IMG_2.jpg", "img_3", "IMG_4.tif", "x"], ["IMG_1.JPG", "IMG_2.tif", "IMG_3.JPG", "IMG_4.tif"]
    )
    assert found.name == {
        "IMG_4.tif": "IMG_4.tif",
        "a/IMG_1.JPG": "IMG_1.JPG",
        "IMG_2.jpg": "IMG_2.tif",
        "img_3": "IMG_3.JPG",
    }
    assert list(found.by_step.values()) == [1, 1, 1, 1]
    assert found.unmatched == ("x",)


def test_two_images_of_one_name_in_two_folders_are_told_and_not_guessed() -> None:
    found = matched(["IMG_1.JPG"], ["flight1/IMG_1.JPG", "flight2/IMG_1.JPG"])
    assert not found.name
    assert found.unmatched == ("IMG_1.JPG",)
    assert found.conflicts[0][1] == ("IMG_1.JPG", "flight1/IMG_1.JPG", "flight2/IMG_1.JPG")
    assert matched(["flight2\\IMG_1.JPG", "flight2/IMG_2.JPG"], ["flight2/IMG_1.JPG", "IMG_2.JPG"]).unmatched == ()


def test_points_have_no_folders_and_no_extensions() -> None:
    assert matched(["a/1", "b.tif"], ["1", "b"], OF_POINTS).unmatched == ("a/1", "b.tif")
    assert matched(["p1"], ["P1"], OF_POINTS).name == {"p1": "P1"}


def test_only_endings_of_images_are_extensions() -> None:
    assert without_extension("strip.12") == "strip.12"
    assert without_extension("DSC_1.NEF") == "DSC_1"
    assert without_extension(".tif") == ".tif"


# One place in an image in the pixel systems of all programs; expected by hand: an image of 6 x 4 pixels.

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
def test_a_principal_point_is_in_millimetres_from_the_centre(program: str) -> None:
    axes, pixel_mm = PIXEL_AXES[program], np.array([0.004, 0.005])
    assert named(axes.name) == axes
    from_corner = np.asarray(FORMAT) / 2 + [2.5, 4.0]  # pixels right and down of the centre
    (centre,) = converted([from_corner], PIXEL_AXES["metashape"], axes, FORMAT, pixel_mm)
    np.testing.assert_allclose(principal_point_mm(centre, axes, FORMAT, pixel_mm), [0.01, -0.02], atol=1e-15)


def test_a_principal_point_right_of_and_below_the_centre_has_positive_x_and_negative_y() -> None:
    mm = principal_point_mm([3.5, 2.5], PIXEL_AXES["metashape"], FORMAT, np.array([0.01, 0.01]))
    np.testing.assert_allclose(mm, [0.005, -0.005], atol=1e-15)
