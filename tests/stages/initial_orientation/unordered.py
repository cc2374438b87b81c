"""Simulated blocks as unordered images, and their initial orientation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.plugin import SILENT, Context
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.initial_orientation.graph import GraphOptions, graph
from aatri.stages.interior_orientation.calibrated import calibrated

SMALL_UAV = {
    "preset": "uav",
    "earth": "flat",
    "refraction": "none",
    "flight": {"strips": 4, "images_per_strip": 6},
    "ties": {"random_per_image": 70.0},
}


def measured(block: Block) -> ImagePoints:
    return systematic(block, calibrated(block), options=SystematicOptions(refraction=False))


def simulated(seed: int = 1, **given: object) -> Block:
    return simulate(options=SimulateOptions.model_validate(given), rng=np.random.default_rng(seed))


def without_strips(block: Block) -> Block:
    """The same block as unordered images."""
    n = len(block.images)
    images = replace(block.images, strip=np.full(n, -1, dtype=np.int32), sequence=np.full(n, np.nan))
    return replace(block, images=images, strips=block.strips.take(np.zeros(0, dtype=np.intp)))


def initial_of(block: Block, context: Context = SILENT, **options: object) -> Solution:
    points = systematic(block, calibrated(block), options=SystematicOptions(refraction=False, earth_curvature=False))
    return graph(
        block, points, options=GraphOptions.model_validate(options), context=context, rng=np.random.default_rng(1)
    )


def far_off(block: Block, solution: Solution) -> tuple[float, float]:
    """Largest error of the projection centres in m and of the rotations in rad."""
    true, oriented = block.true_images, solution.images.oriented
    assert true is not None
    centre = np.linalg.norm(solution.images.position_m - true.position_m, axis=1)[oriented]
    turned = solution.images.ground_from_image[oriented] @ true.ground_from_image[oriented].swapaxes(1, 2)
    return float(centre.max()), float(Rotation.from_matrix(turned).magnitude().max())
