"""Slope distances: derivatives by complex step, heights of instrument and target, exact ones, kinds of ends."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.observations.geodetic.sights import Sights, observed_sights, slope
from aatri.observations.level import PLANE
from aatri.observations.poses import POINT, POSE, Poses
from tests.complex_step import complex_step


def _made(start_is_image: bool, end_is_image: bool, sigma: float = 0.01) -> Sights:
    one = np.zeros(1, dtype=np.int32)
    none = np.array([""])
    images = np.array([start_is_image]), np.array([end_is_image])
    numbers = (np.array([x]) for x in (1.5, 0.3, 100.0, sigma))
    return Sights(one, one, one + 1, *images, *numbers, np.array(["A-B"]), none, none, none)


@pytest.mark.parametrize(("start", "end"), [(False, False), (False, True), (True, False), (True, True)])
def test_derivatives_are_those_of_the_complex_step(start: bool, end: bool) -> None:
    rng = np.random.default_rng(4)
    points, centres = rng.normal(0, 80, (2, 3)), rng.normal(0, 80, (2, 3))
    a = centres[0] if start else points[0]
    b = centres[1] if end else points[1]

    def f(z: np.ndarray) -> np.ndarray:
        line = z[3:] - z[:3] + np.array([0.0, 0.0, 0.3 - 1.5])
        return np.sqrt((line**2).sum())[None] - 100.0

    (o,) = observed_sights("distance", _made(start, end), PLANE, slope, "m")
    state = {POINT: points, POSE: Poses(centres, np.tile(np.eye(3), (2, 1, 1)))}
    v, J = o.records.evaluate(state, np.arange(1))
    z = np.concatenate([a, b])
    np.testing.assert_allclose(v[0], f(z), rtol=0, atol=1e-11)
    expected = complex_step(f, z)
    np.testing.assert_allclose(np.hstack([J[0][0][:, :3], J[1][0][:, :3]]), expected, atol=1e-12)
    for j, image in zip(J, (start, end)):
        assert j.shape[2] == (6 if image else 3)
        assert (j[:, :, 3:] == 0).all()
    assert [group for group, _ in o.records.touches] == [POSE if start else POINT, POSE if end else POINT]


def test_a_distance_of_sigma_zero_is_demanded_and_named_by_its_ends() -> None:
    (exact,) = observed_sights("distance", _made(False, False, sigma=0.0), PLANE, slope, "m")
    (observed,) = observed_sights("distance", _made(False, False, sigma=0.02), PLANE, slope, "m")
    assert exact.exact
    assert not observed.exact
    assert observed.sigmas().tolist() == [[0.02]]
    assert exact.sigmas().tolist() == [[0.0]]
    assert observed.names(np.arange(1))[1].tolist() == ["A-B"]
