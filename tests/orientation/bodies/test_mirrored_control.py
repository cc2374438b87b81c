"""Control in a plane fits mirrored as well, by chance better: it is not called mirrored."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.geometry.similarity import Similarity
from aatri.orientation.bodies.datum_analysis import GivenPlaces
from aatri.orientation.bodies.mirrored_control import refuse_mirrored


def places(n: int, relief_m: float, mirrored: bool, seed: int) -> GivenPlaces:
    """Control points of 2 cm on a field of 600 m, and the same points of a body."""
    rng = np.random.default_rng(seed)
    X = rng.uniform([0, 0, -relief_m], [600, 400, relief_m], (n, 3))
    x = X * [1.0, 1.0, -1.0] if mirrored else X
    given = np.ones((n, 3), dtype=bool)
    x = x + rng.normal(0, 0.02, x.shape)
    kind, name = np.full(n, "control"), np.array([f"point {k}" for k in range(n)])
    return GivenPlaces(kind, name, x, X + rng.normal(0, 0.02, X.shape), given, np.arange(n))


def judged(n: int, relief_m: float, mirrored: bool, seed: int) -> None:
    to = Similarity(np.zeros(3), 1.0, np.eye(3))
    refuse_mirrored(places(n, relief_m, mirrored, seed), np.ones(n, dtype=bool), to, np.array([0.0, 0.0, 1.0]), "body")


def test_control_in_a_plane_is_never_mirrored() -> None:
    for seed in range(460):
        judged(5, 0.0, False, seed)


def test_mirrored_control_with_relief_is_refused() -> None:
    for seed in range(5):
        judged(12, 20.0, False, seed)
        with pytest.raises(GeometryError, match="mirrored only"):
            judged(12, 20.0, True, seed)
