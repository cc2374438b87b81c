"""Pairs of images: which are oriented, and the covariance of film, with what fiducial marks leave open of both."""

from __future__ import annotations

import numpy as np
import pytest

import aatri.adapters.pairs.models as of_pairs
from aatri.adapters.pairs.image_pairs import joining_pairs, strongest_pairs
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.geometry.rotations import log_rotation
from aatri.geometry.vectors import tangents
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.relative_orientation.dependent import dependent
from tests.stages.chain import simulated

BLOCKS = 12
FILM = {
    "flight": {"strips": 2, "images_per_strip": 6, "cross_strips": 0},
    "known": {"full": 8},
    "earth": "flat",
    "camera": {"distortion": "none"},
    "refraction": "none",
    "ties": {"new_points": 150},
}


def nees(block: Block, models: Models) -> float:
    """Mean of d'C^-1 d / 5 over the orientations, d against the truth."""
    truth, o = block.true_images, models.orientations
    assert truth is not None
    order = np.argsort(truth.image)
    R, X0 = truth.ground_from_image[order], truth.position_m[order]
    sizes = []
    for left, right, turned, base, C in zip(o.left, o.right, o.left_from_right, o.base, o.covariance):
        b = R[left].T @ (X0[right] - X0[left])
        turn = log_rotation(turned @ (R[left].T @ R[right]).T)
        d = np.concatenate([turn, tangents(base).T @ (base - b / np.linalg.norm(b))])
        sizes.append(float(d @ np.linalg.solve(C, d)) / 5)
    return float(np.mean(sizes))


def test_covariances_of_orientations_hold_for_film_with_marks_as_uncertain_as_its_points(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    blocks = [simulated(seed, preset="rc30", noise={"fiducial_um": 5.0}, **FILM) for seed in range(1, BLOCKS + 1)]
    counted = [nees(block, dependent(block, affine(block))) for block in blocks]
    monkeypatch.setattr(of_pairs, "film_in_orientations", lambda *given: 0.0)
    ignored = [nees(block, dependent(block, affine(block))) for block in blocks]
    scatter = np.std(counted, ddof=1) / np.sqrt(BLOCKS)
    assert abs(np.mean(counted) - 1) < 4 * scatter < 0.5
    assert np.mean(ignored) > 2.5  # what the points alone would have one believe


# Which pairs of images are oriented, where not all are.


def test_the_pair_of_few_points_that_joins_two_parts_is_among_the_strongest_of_each_image() -> None:
    """Two parts of five images, each paired with each; 7 points in common join them, and 6 elsewhere."""
    left, right = np.triu_indices(10, k=1)
    within = (left < 5) == (right < 5)
    common = np.where(within, 20 + left + right, np.where((left == 0) & (right == 9), 7, 5))
    common[(left == 0) & (right == 1)] = 6
    images = np.column_stack([left, right])
    joining = joining_pairs(images, common, 10, 8, 6)
    images, common = images[joining], common[joining]
    assert joining.sum() == 2 * 10 - 1 + 1  # without the pair of 6 points, whose images others join
    kept = strongest_pairs(images, common, 10, 3, 8)
    assert images[kept & (common < 8)].tolist() == [[0, 9]]
    assert np.bincount(images[kept & (common >= 8)].ravel(), minlength=10).min() >= 3
    assert (kept & (common >= 8)).sum() < 2 * 10 - 1
