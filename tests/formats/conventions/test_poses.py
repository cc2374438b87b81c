"""A point is projected in the camera axes of each program, by its own formula, and by ours: the same place."""

import math

import numpy as np
import pytest

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
