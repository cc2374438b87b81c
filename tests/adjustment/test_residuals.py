"""Residuals by the compiled lane are those of the NumPy form."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment import residuals as module
from aatri.geometry.rotations import exp_rotation
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.image_points import film_correction, image_point_records
from aatri.observations.poses import FILM, POINT, POSE, Poses


def test_residuals_of_film_with_open_corrections_are_the_same_by_either_way(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    n = 500
    rays = ImagePointRows(
        rng.integers(0, 4, n).astype(np.int32),
        rng.integers(0, 60, n).astype(np.int32),
        rng.normal(0, 50.0, (n, 2)),
        np.full((n, 2), 0.005),
        np.full(n, 150.0),
        np.zeros((n, 2)),
        rng.random(n) < 0.9,
    )
    records = image_point_records(rays, [film_correction(rays, FILM)])
    state = {
        POSE: Poses(rng.normal((0.0, 0.0, 1500.0), 100.0, (4, 3)), exp_rotation(rng.normal(0, 0.1, (4, 3)))),
        POINT: rng.normal(0, 300.0, (60, 3)) * [1, 1, 0.1],
        FILM: rng.normal(0, 1e-3, (4, 6)),
    }
    rows = rng.permutation(n)[:300]
    wanted = records.evaluate(state, rows)[0]
    monkeypatch.setattr(module, "CHUNK", 64)
    np.testing.assert_allclose(module.residuals(records, state, rows), wanted, rtol=1e-11, atol=1e-11)
