"""Small simulated film blocks for the tests of interior orientation and image refinement."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.progress import Silent
from aatri.stages.block.simulate import SimulateOptions, simulate


def flown(**options: Any) -> Block:
    """Two strips of five film images with four marks, error-free unless `noise` is given."""
    given = {
        "noise": False,
        "flight": {"strips": 2, "images_per_strip": 5},
        "known": {"full": 8},
        "camera": {
            "distortion": "brown",
            "principal_point_mm": (0.011, 0.002),
            "brown": {"k1": 5.0e-9, "k2": -2.2e-13, "p1": 5.0e-8, "p2": -3.0e-8},
        },
    }
    return simulate(options=SimulateOptions(**{**given, **options}), rng=np.random.default_rng(7))


def true_photo_mm(block: Block) -> Any:
    """Central projection of the true points, from the principal point, row by row as the image points."""
    assert block.true_images is not None
    assert block.true_points is not None
    X0, R = np.zeros((len(block.images), 3)), np.zeros((len(block.images), 3, 3))
    X0[block.true_images.image] = block.true_images.position_m
    R[block.true_images.image] = block.true_images.ground_from_image
    X = np.zeros((len(block.points), 3))
    X[block.true_points.point] = block.true_points.xyz_m
    image, point = block.image_points.image, block.image_points.point
    u = np.einsum("nji,nj->ni", R[image], X[point] - X0[image])
    return -block.cameras.principal_distance_mm[0] * u[:, :2] / u[:, 2:]


def with_marks(block: Block, image: int, xy: Any) -> Block:
    """The block with the measured marks of one image changed by a function of their coordinates."""
    marks = block.fiducial_points
    changed = marks.xy.copy()
    rows = marks.image == image
    changed[rows] = xy(changed[rows])
    return replace(block, fiducial_points=replace(marks, xy=changed))


def without_marks(block: Block, rows: Any) -> Block:
    """The block without these rows of measured marks."""
    return replace(block, fiducial_points=block.fiducial_points.take(~rows))


class Told(Silent):
    """A reporter that keeps what it is told."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.warnings: list[str] = []

    def log(self, message: str) -> None:
        self.lines.append(message)

    def warn(self, message: str) -> None:
        self.warnings.append(message)
