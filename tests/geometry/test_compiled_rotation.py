"""The compiled exponential map against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.geometry.kernels.rotations import turn


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-5, 0.3, 2.0, np.pi, 7.0])
def test_turning_a_matrix_is_multiplication_by_the_exponential(angle: float) -> None:
    rng = np.random.default_rng(3)
    axis = rng.normal(size=3)
    d = angle * axis / np.linalg.norm(axis)
    R = Rotation.from_rotvec(rng.normal(size=3)).as_matrix()
    turned = R.copy()
    turn(*d, turned)
    np.testing.assert_allclose(turned, Rotation.from_rotvec(d).as_matrix() @ R, atol=2e-15)
