"""A seven-parameter similarity is a small problem, and runs few files."""

import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

import numpy as np

import aatri
from aatri.geometry.rotations import exp_rotation
from aatri.observations.control import Control, observed_control
from aatri.observations.poses import Poses
from aatri.orientation.bodies.absolute import OrientationSettings, OrientedBody, orient_body
from aatri.orientation.bodies.free_body import FreeBody, concerning
from aatri.stages.absolute_orientation.similarity import similarity
from tests.made_strips import MadeBlock

T = TypeVar("T")
SCALE, SHIFT_M = 1000.0, np.array([10.0, 20.0, 30.0])
R = exp_rotation(np.array([0.1, 0.2, 0.7]))


def oriented() -> OrientedBody:
    """A body of 30 points on eight control points of 1 cm."""
    rng = np.random.default_rng(3)
    X = rng.uniform(-500, 500, (30, 3)) * [1.0, 1.0, 0.1]
    x = (X - SHIFT_M) @ R / SCALE + rng.normal(0, 1e-5, X.shape)
    known, every = np.arange(8, dtype=np.int32), np.ones((8, 3), dtype=bool)
    covariance = np.broadcast_to(1e-4 * np.eye(3), (8, 3, 3)).copy()
    control = Control(known, known, X[:8] + rng.normal(0, 0.01, (8, 3)), covariance, every, ~every)
    ids = np.arange(30).astype(np.str_)
    of_points = np.broadcast_to(1e-10 * np.eye(3), (30, 3, 3)).copy()
    body = FreeBody(Poses(np.array([[0.0, 0.0, 5.0]]), np.eye(3)[None]), x, of_points, 1e-10 * np.eye(3)[None], 1.0)
    observed = concerning(observed_control(control, np.zeros(3), ids[known]), body)
    settings = OrientationSettings(5.0)
    return orient_body(lambda _: observed, body, settings, what="body", image_ids=np.array(["i"]), point_ids=ids)


def files_run(call: Callable[[], T]) -> tuple[int, T]:
    """How many files of the house a call enters, and what it gives."""
    house = tuple(f"{Path(aatri.__file__).parents[1] / top}/" for top in ("aatri", "stages"))
    files = set[str]()

    def note(frame: FrameType, event: str, _: Any) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(house):
            files.add(frame.f_code.co_filename)

    sys.setprofile(note)
    try:
        result = call()
    finally:
        sys.setprofile(None)
    return len(files), result


def test_a_similarity_runs_at_most_45_files() -> None:
    files, result = files_run(oriented)
    assert 10 < files <= 45
    np.testing.assert_allclose(result.ground_from_body.scale, SCALE, rtol=5e-5)
    np.testing.assert_allclose(result.ground_from_body.translation, SHIFT_M, atol=0.03)
    np.testing.assert_allclose(result.ground_from_body.rotation, R, atol=5e-5)


def test_the_stage_runs_at_most_57_files() -> None:
    """112 when strips were joined by way of the tree of fronts, and checks entered that had nothing to look at."""
    made = MadeBlock(2, 5, noise_m=0.02)
    made.control(made.corners(), sigma_m=0.05)
    block, strips, image_points = made.block(), made.strips(), made.image_points()
    files, solution = files_run(lambda: similarity(block, strips, image_points))
    assert solution.images.oriented.all()
    assert 45 < files <= 57
