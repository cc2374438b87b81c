"""The flight: stations off their plan, along and across their own direction."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.simulation.flight import FlightPlan, flown
from aatri.simulation.settings import CameraOptions, FlightOptions

HEADINGS_DEG = (0.0, 90.0, 180.0, -90.0, 37.0)


def _deviations(position_sigma_m: tuple[float, float, float]) -> np.ndarray:
    """Of the stations from their plan, in m."""
    n, heading = 200 * len(HEADINGS_DEG), np.deg2rad(np.repeat(HEADINGS_DEG, 200))
    ids = [str(k) for k in range(n)]
    plan = FlightPlan(ids, ids, np.arange(n), np.arange(n), heading, np.zeros((n, 3)), 100.0, 500.0)
    flight = FlightOptions(position_sigma_m=position_sigma_m)
    return flown(plan, flight, CameraOptions(), np.random.default_rng(1))[0].reshape(len(HEADINGS_DEG), 200, 3)


@pytest.mark.parametrize(("axis", "turned_deg"), [(0, 0.0), (1, 90.0)])
def test_stations_deviate_along_and_across_their_direction_of_flight(axis: int, turned_deg: float) -> None:
    sigma = [0.0, 0.0, 0.0]
    sigma[axis] = 4.0
    for heading, off in zip(HEADINGS_DEG, _deviations((sigma[0], sigma[1], sigma[2]))):
        angle = np.deg2rad(heading + turned_deg)
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        size = off @ direction
        np.testing.assert_allclose(off, size[:, None] * direction, atol=1e-12)
        assert 3.0 < size.std() < 5.0  # 4 m within five standard deviations of the estimate from 200


def test_stations_deviate_in_height() -> None:
    off = _deviations((0.0, 0.0, 4.0))
    np.testing.assert_array_equal(off[..., :2], 0.0)
    assert 3.5 < off[..., 2].std() < 4.5
