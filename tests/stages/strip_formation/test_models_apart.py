"""Strips in metres by their control, scale numbers of images, models kept apart in their strip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.stages.strip_formation._joined import SnoopingOptions
from aatri.stages.strip_formation.similarity import similarity
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told

BLOCK = {
    "preset": "rc30",
    "earth": "flat",
    "flight": {"strips": 2, "images_per_strip": 5, "cross_strips": 0},
    "known": {"full": 12},
    "ties": {"new_points": 100},
}


@pytest.fixture(scope="module")
def chain() -> Chain:
    return run_chain(simulated(4, **BLOCK))


def test_scales_are_those_of_the_truth_and_distances_in_metres_too(chain: Chain) -> None:
    told = Told()
    strips = similarity(chain.block, chain.models, options=SnoopingOptions(models_apart=True), context=told)
    assert strips.scales is not None
    assert strips.image_scales is not None
    assert strips.placed_points is not None
    truth, points = chain.block.true_images, chain.block.true_points
    assert truth is not None
    assert points is not None
    X0 = dict(zip(truth.image.tolist(), truth.position_m))
    first = [strips.strip_images.image[strips.strip_images.strip == s][:2].tolist() for s in range(2)]
    base = [np.linalg.norm(X0[b] - X0[a]) for a, b in first]
    np.testing.assert_allclose(strips.scales.metres, base, rtol=1e-3)
    assert any("scales of strips by control" in line for line in told.lines)
    p = strips.placed_points
    X = np.full((len(chain.block.points), 3), np.nan)
    X[points.point] = points.xyz_m
    a, b = np.flatnonzero(p.strip == 0)[[0, -1]]
    there = np.linalg.norm(X[p.point[b]] - X[p.point[a]])
    assert np.linalg.norm(p.xyz_m[b] - p.xyz_m[a]) == pytest.approx(there, rel=2e-3)


def test_the_scale_number_of_an_image_is_the_median_of_its_points_each_once(chain: Chain) -> None:
    strips = similarity(chain.block, chain.models, options=SnoopingOptions(models_apart=True))
    s, p, o = strips.image_scales, strips.placed_points, chain.models.orientations
    truth, points = chain.block.true_images, chain.block.true_points
    assert s is not None
    assert p is not None
    assert truth is not None
    assert points is not None
    ends = dict(zip(o.id.tolist(), zip(o.left.tolist(), o.right.tolist())))
    X = dict(zip(points.point.tolist(), points.xyz_m))
    of_image = dict(zip(truth.image.tolist(), zip(truth.position_m, truth.ground_from_image)))
    c = chain.block.cameras.principal_distance_mm[0]
    expected = []
    for image in s.image.tolist():
        of_models = {q for q, model in zip(p.point.tolist(), p.model.tolist()) if image in ends[model]}
        X0, R = of_image[image]
        expected.append(np.median([(X0 - X[q]) @ R[:, 2] for q in of_models]) / (1e-3 * c))
    np.testing.assert_allclose(s.scale_number, expected, rtol=1e-3)


def test_points_of_several_models_are_kept_apart_and_their_mean_is_the_strip_point(chain: Chain) -> None:
    strips = similarity(chain.block, chain.models, options=SnoopingOptions(models_apart=True))
    p, s = strips.placed_points, strips.strip_points
    assert p is not None
    several = np.flatnonzero((s.models > 1) & (s.strip == 0))
    assert len(several)
    for k in several[:5].tolist():
        rows = np.flatnonzero((p.strip == 0) & (p.point == s.point[k]))
        assert len(set(p.model[rows].tolist())) == len(rows) > 1
        spread = np.ptp(p.xyz[rows], axis=0)
        assert 0 < np.linalg.norm(p.xyz[rows].mean(axis=0) - s.xyz[k]) <= np.linalg.norm(spread)


def test_a_strip_without_control_has_no_scale_and_is_named(chain: Chain) -> None:
    told, ground = Told(), chain.block.ground_points
    block = replace(chain.block, ground_points=ground.take(np.zeros(0, dtype=int)))
    strips = similarity(block, chain.models, options=SnoopingOptions(models_apart=True), context=told)
    assert strips.scales is not None
    assert np.isnan(strips.scales.metres).all()
    assert [text for text in told.warnings if "have no scale" in text]
    assert similarity(chain.block, chain.models).scales is None
