"""Film images with each other's image points, beside marks of their own; what only looks like them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.checks.after.exchanged_marks import exchanged_marks
from aatri.observations.poses import Poses
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.affine import affine
from tests.stages.chain import simulated
from tests.stages.hand_block import Heard

FLIGHT = {"strips": 2, "images_per_strip": 4, "cross_strips": 0}
FILMS: dict[str, Any] = {"preset": "rc30", "flight": FLIGHT, "ties": {"new_points": 120}}


def test_film_images_with_each_others_image_points_are_named() -> None:
    """The orientations are the truth of the photographs, whatever name their image points carry."""
    block = simulated(1, **FILMS)
    assert _of_marks(block, [0, 1, 2, 3, 4, 5, 6, 7]) == []
    for pair in ([1, 2], [2, 6]):
        photograph = np.arange(len(block.images))
        photograph[pair] = pair[::-1]
        names = tuple(block.images.id[pair])
        m = block.image_points
        exchanged = replace(block, image_points=replace(m, image=photograph[m.image].astype(m.image.dtype)))
        (finding,) = _of_marks(exchanged, photograph)
        assert finding.level == "warning"
        assert set(finding.sentence.split()[1:4:2]) == set(names)


def test_a_film_image_with_a_mark_off_is_not_exchanged_with_another() -> None:
    block = simulated(1, **FILMS)
    marks = block.fiducial_points
    xy = marks.xy.copy()
    xy[np.isin(marks.image, [2, 5])] += np.random.default_rng(1).normal(0.0, 0.02, (8, 2))
    assert _of_marks(replace(block, fiducial_points=replace(marks, xy=xy)), np.arange(len(block.images))) == []


@pytest.mark.slow
def test_film_images_that_see_no_solved_point_take_no_part() -> None:
    """Two images are oriented; the first of the others sees none of their points."""
    assert _of_marks(simulated(1, **FILMS), np.arange(8), not_oriented=[0, 1, 2, 3, 4, 5]) == []


def _of_marks(block: Any, photograph: Any, not_oriented: Any = ()) -> Any:
    assert block.true_images is not None
    assert block.true_points is not None
    points = systematic(block=block, image_points=affine(block=block))
    truth = block.true_images
    poses = Poses(truth.position_m[photograph], truth.ground_from_image[photograph])
    xyz_m, m = block.true_points.xyz_m.copy(), block.image_points
    poses.position_m[[*not_oriented]], poses.ground_from_image[[*not_oriented]] = np.nan, np.nan
    xyz_m[np.isin(block.true_points.point, m.point[np.isin(m.image, not_oriented)])] = np.nan
    return exchanged_marks(block, points, poses, xyz_m)


@pytest.mark.slow
def test_a_bundle_names_the_two_images() -> None:
    block = simulated(1, **FILMS)
    m, photograph = block.image_points, np.array([0, 2, 1, 3, 4, 5, 6, 7])
    exchanged = replace(block, image_points=replace(m, image=photograph[m.image].astype(m.image.dtype)))
    points, heard = systematic(block=exchanged, image_points=affine(block=exchanged)), Heard()
    bundle(exchanged, points, graph(exchanged, points, rng=np.random.default_rng(1)), context=heard)
    (text,) = [text for text in heard.warned if "each other's fiducial marks" in text]
    assert all(name in text for name in block.images.id[[1, 2]])
