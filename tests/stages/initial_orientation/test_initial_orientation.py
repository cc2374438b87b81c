"""Images of any arrangement, oriented without strips, order or start values."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.stages.accuracy.evaluation import evaluation
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.initial_orientation.graph import GraphOptions, graph
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.essential import essential
from tests.made_uav_3strips import block_folder
from tests.reading import read_block
from tests.stages.film_blocks import Told
from tests.stages.initial_orientation.unordered import (
    SMALL_UAV,
    far_off,
    initial_of,
    measured,
    simulated,
    without_strips,
)


@pytest.mark.slow
def test_three_oblique_strips_are_oriented_without_strips_order_or_start(shared_data: Path, tmp_path: Path) -> None:
    block = read_block(block_folder(shared_data / "uav_3strips", tmp_path / "block"))
    assert not len(block.strips)
    points = measured(block)
    initial = graph(block, points, rng=np.random.default_rng(1))
    assert initial.images.oriented.all()
    done = bundle(block, points, initial, options=BundleOptions(blunders={"method": "robust_snooping"}))
    found = evaluation(block, done).metrics()
    # Nothing is published of this block: the check points are known to 3 cm.
    assert found["check_points"] == 11
    assert max(found[f"check_rmse_{axis}_m"] or 1.0 for axis in "xyz") < 0.06


@pytest.mark.slow
def test_without_control_the_datum_is_free_and_the_first_base_is_one(shared_data: Path, tmp_path: Path) -> None:
    block = read_block(block_folder(shared_data / "uav_3strips", tmp_path / "block"))
    block = replace(block, ground_points=block.ground_points.take(np.zeros(0, dtype=np.intp)))
    initial = graph(block, measured(block), options=GraphOptions(pairs_per_image=6), rng=np.random.default_rng(1))
    assert initial.datum is not None
    centre = initial.images.position_m
    assert np.linalg.norm(centre[1] - centre[0]) == pytest.approx(1.0, rel=1e-12)
    assert initial.images.oriented.all()


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["orbit", "oblique", "hover"])
def test_orbits_oblique_heads_and_hovering_are_oriented_without_strips_or_start(preset: str) -> None:
    less = {"oblique": {"flight": {"strips": 2, "images_per_strip": 4}, "ties": {"new_points": 1200}}}
    block = without_strips(simulated(preset=preset, **less.get(preset, {"ties": {"new_points": 300}})))
    found = initial_of(block)
    assert found.images.oriented.all()
    metres, radians = far_off(block, found)
    assert metres < 0.3
    assert radians < 0.005


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("start", ["bases", "gnss", "random"])
def test_every_start_of_the_projection_centres_ends_at_the_same_block(start: str) -> None:
    block = without_strips(simulated(**SMALL_UAV))
    found = initial_of(block, positions=start, pairs_per_image=6)
    assert found.images.oriented.all()
    assert far_off(block, found)[0] < 0.2


def test_two_blocks_that_ten_points_join_become_one() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    m = block.image_points
    second = np.char.startswith(block.images.id, "03") | np.char.startswith(block.images.id, "04")
    of_second = second[m.image]
    in_first, in_second = (np.bincount(m.point[rows], minlength=len(block.points)) for rows in (~of_second, of_second))
    both = np.flatnonzero((in_first >= 3) & (in_second >= 3))
    joining = both[:: max(len(both) // 10, 1)][:10]
    control = block.ground_points.point
    kept = ~of_second | (in_first[m.point] == 0) | np.isin(m.point, joining)
    kept &= of_second | ~np.isin(m.point, np.setdiff1d(control, joining)) | (in_second[m.point] == 0)
    block = replace(block, image_points=m.take(np.flatnonzero(kept)))
    shared = np.intersect1d(
        *(np.unique(block.image_points.point[second[block.image_points.image] == k]) for k in (0, 1))
    )
    assert len(shared) <= 10
    found = initial_of(block)
    assert found.images.oriented.all()
    assert far_off(block, found)[0] < 0.5


@pytest.mark.slow
def test_three_percent_of_wrong_image_names_are_rejected_and_all_images_oriented() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    m, rng = block.image_points, np.random.default_rng(3)
    rows = rng.choice(len(m), round(0.03 * len(m)), replace=False)
    image = m.image.copy()
    image[rows] = rng.integers(0, len(block.images), len(rows))
    key = image.astype(np.int64) * len(block.points) + m.point
    once = np.isin(key, np.flatnonzero(np.bincount(key) == 1))
    image = np.where(once, image, m.image).astype(np.int32)
    wrong = image != m.image
    order = np.lexsort((m.point, image))
    block = replace(block, image_points=replace(m, image=image).take(order))
    found = initial_of(block)
    assert found.images.oriented.all()
    assert far_off(block, found)[0] < 0.2
    rejected = np.zeros(len(m), dtype=bool)
    rejected[found.suspects.row[found.suspects.kind == "image_point"]] = True
    assert (rejected & wrong[order]).sum() > 0.97 * wrong.sum()
    assert (rejected & ~wrong[order]).sum() < 0.005 * len(m)


def test_an_image_that_shares_no_points_is_named_and_the_rest_is_oriented() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    m = block.image_points
    alone = m.image == 7
    block = replace(block, image_points=m.take(np.flatnonzero(~alone | (np.cumsum(alone) <= 5))))
    told = Told()
    points = systematic(block, calibrated(block), options=SystematicOptions(refraction=False, earth_curvature=False))
    found = graph(block, points, options=GraphOptions(pairs_per_image=6), context=told, rng=np.random.default_rng(1))
    assert found.images.oriented.sum() == len(block.images) - 1
    assert any("not oriented" in text and str(block.images.id[7]) in text for text in told.warnings)


@pytest.mark.slow
def test_models_that_are_given_are_used_and_no_others() -> None:
    block = simulated(**SMALL_UAV)
    points = systematic(block, calibrated(block), options=SystematicOptions(refraction=False, earth_curvature=False))
    models = essential(block, points)
    assert len(models.orientations) == 20  # the neighbours in four strips of six
    found = graph(block, points, models, rng=np.random.default_rng(1))
    assert found.images.oriented.all()  # the strips are components, and their common points join them
    assert far_off(block, found)[0] < 0.3
