"""Blocks with one thing wrong: all images are oriented or named, and the bundle that follows converges."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.artifacts.block import Block
from aatri.errors import GeometryError
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.initial_orientation.graph import GraphOptions, graph
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.small_blocks import adjusted_by, flown, off_m
from tests.stages.film_blocks import Told
from tests.stages.initial_orientation.test_datum import rejected_of, some_ends, with_distances
from tests.stages.initial_orientation.unordered import (
    SMALL_UAV,
    far_off,
    initial_of,
    measured,
    simulated,
    without_strips,
)


def wrong_numbers(block: Block, share: float) -> Block:
    """Some image points with the number of any other point; those that come out twice in an image are left away."""
    m, rng = block.image_points, np.random.default_rng(5)
    rows = rng.choice(len(m), round(share * len(m)), replace=False)
    point = m.point.copy()
    point[rows] = rng.integers(0, len(block.points), len(rows))
    _, first = np.unique(m.image.astype(np.int64) * len(block.points) + point, return_index=True)
    return replace(block, image_points=replace(m, point=point).take(first))


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.05, 0.2])
def test_the_bundle_converges_after_wrong_point_numbers(share: float) -> None:
    block = wrong_numbers(without_strips(simulated(**SMALL_UAV)), share)
    found = initial_of(block, pairs_per_image=8)
    assert found.images.oriented.all()
    assert far_off(block, found)[0] < 0.2
    done = bundle(block, measured(block), found)
    assert done.sigma0 < 1.1
    assert far_off(block, done)[0] < 0.1


@pytest.mark.slow
def test_positions_that_are_all_shifted_are_left_out_with_their_shift() -> None:
    block = without_strips(simulated(**{**SMALL_UAV, "ties": {"random_per_image": 120.0}}))
    e, told = block.exterior, Told()
    shifted = replace(block, exterior=replace(e, position_m=e.position_m + np.array([0.0, 0.0, 20.0])))
    found = initial_of(shifted, told, pairs_per_image=8)
    assert far_off(block, found)[0] < 0.2
    text = next(text for text in told.warnings if "observed positions (24) contradict all else" in text)
    x, y, z = (float(v) for v in text.partition("shifted by ")[2].partition(" m")[0].split(", "))
    assert max(abs(x), abs(y), abs(z - 20.0)) < 0.1
    assert (found.suspects.kind[found.suspects.verdict == "rejected"] == "position").sum() == 24
    done = bundle(shifted, measured(shifted), found)  # begins without them
    assert done.sigma0 < 1.1
    assert far_off(block, done)[0] < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 3, 10])
def test_positions_and_control_of_sigmas_a_fifth_contradict_nothing(seed: int) -> None:
    small = {**SMALL_UAV, "flight": {"strips": 2, "images_per_strip": 7}, "known": {"full": 5}}
    block, rng, told = simulated(seed, **small), np.random.default_rng(seed), Told()
    e, g, unit = block.exterior, block.ground_points, np.eye(3)
    e = replace(
        e,
        position_m=e.position_m + rng.normal(0.0, 0.25, e.position_m.shape),
        position_covariance_m2=np.tile(0.05**2 * unit, (len(e), 1, 1)),
    )
    g = replace(
        g,
        xyz_m=g.xyz_m + rng.normal(0.0, 0.15, g.xyz_m.shape),
        covariance_m2=np.tile(0.03**2 * unit, (len(g), 1, 1)),
    )
    found = initial_of(without_strips(replace(block, exterior=e, ground_points=g)), told)
    assert not (found.suspects.kind == "position").any()
    assert not [text for text in told.warnings if "contradict" in text]


@pytest.mark.slow
def test_distances_of_another_scale_are_left_out_with_their_scale() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    block, told = with_distances(block, some_ends(block, 6)), Told()
    g = block.geodetic
    found = initial_of(replace(block, geodetic=replace(g, value=1.02 * g.value)), told, pairs_per_image=8)
    assert far_off(block, found)[0] < 0.2
    text = next(text for text in told.warnings if "distances (6) contradict all else" in text)
    assert float(text.partition("by ")[2].partition(" ppm")[0]) == pytest.approx(20_000, abs=1_000)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("wrong", [0, 1])
def test_of_two_distances_that_alone_tell_the_scale_none_is_rejected_where_they_differ(wrong: int) -> None:
    block = without_strips(simulated(**SMALL_UAV))
    ends, told = some_ends(block, 2), Told()
    block = with_distances(block, ends)
    g, nothing = block.geodetic, np.zeros(0, dtype=np.intp)
    block = replace(
        block,
        geodetic=replace(g, value=g.value * np.where(np.arange(2) == wrong, 1.02, 1.0)),
        ground_points=block.ground_points.take(nothing),
        exterior=block.exterior.take(nothing),
    )
    found = initial_of(block, told, pairs_per_image=8)
    assert rejected_of(found, "distance") == []
    (text,) = (text for text in told.warnings if "nothing tells which" in text)
    assert all(str(block.points.id[p]) in text for p in ends.ravel())
    # the scale is between those of both: 1 to 1.02 times the true one
    true = block.true_points
    assert true is not None
    solved = np.isfinite(found.points.xyz_m).all(axis=1)
    spread = [np.sqrt(np.var(xyz[solved], axis=0).sum()) for xyz in (found.points.xyz_m, true.xyz_m)]
    assert 1.005 < spread[0] / spread[1] < 1.015


@pytest.mark.parametrize("elevation_deg", [0.0, 15.0])
def test_a_facade_seen_from_below_is_not_taken_for_mirrored_control(elevation_deg: float) -> None:
    block = without_strips(simulated(**SMALL_UAV))
    R = Rotation.from_euler("x", 90.0 + elevation_deg, degrees=True).as_matrix()
    ground, images, points = block.ground_points, block.true_images, block.true_points
    assert images is not None
    assert points is not None
    upright = replace(
        block,
        ground_points=replace(ground, xyz_m=ground.xyz_m @ R.T, covariance_m2=R @ ground.covariance_m2 @ R.T),
        exterior=block.exterior.take(np.zeros(0, dtype=np.intp)),
        true_images=replace(images, position_m=images.position_m @ R.T, ground_from_image=R @ images.ground_from_image),
        true_points=replace(points, xyz_m=points.xyz_m @ R.T),
    )
    found = initial_of(upright, pairs_per_image=8)
    assert found.images.oriented.all()
    assert far_off(upright, found)[0] < 0.2


@pytest.mark.slow
def test_mirrored_control_is_refused() -> None:
    block = without_strips(simulated(**SMALL_UAV, gnss={"observed": False, "approximate_positions": False}))
    ground = block.ground_points
    exchanged = replace(block, ground_points=replace(ground, xyz_m=ground.xyz_m[:, [1, 0, 2]]))
    with pytest.raises(GeometryError, match="the control is mirrored"):
        initial_of(exchanged, pairs_per_image=8)


def test_images_all_taken_at_one_place_are_refused_with_the_reason() -> None:
    only = {"flight": {"strips": 1, "images_per_strip": 8}, "ties": {"new_points": 300}}
    block = without_strips(simulated(seed=3, preset="hover", **only))
    with pytest.raises(GeometryError) as refused:
        initial_of(block)
    assert "taken at one place" in str(refused.value)


def test_of_one_image_it_is_said_what_orients_it() -> None:
    both = without_strips(simulated(**{**SMALL_UAV, "flight": {"strips": 1, "images_per_strip": 2}}))
    block = replace(both, image_points=both.image_points.take(np.flatnonzero(both.image_points.image == 1)))
    with pytest.raises(GeometryError, match=f"image {both.images.id[1]}: one image makes no pair") as refused:
        initial_of(block)
    assert "bundle_adjustment/bundle" in refused.value.remedy


@pytest.mark.slow
def test_image_points_with_their_distortion_are_oriented_as_without_it() -> None:
    lens = {"distortion": "brown", "brown": {"k1": 3e-4, "p1": 2e-5}}
    block = without_strips(simulated(**{**SMALL_UAV, "camera": lens}))
    distorted, told = calibrated(block), Told()
    found = graph(block, distorted, options=GraphOptions(pairs_per_image=8), context=told, rng=np.random.default_rng(1))
    corrected = initial_of(block, pairs_per_image=8)
    shift = np.abs(measured(block).measurements.xy_mm - distorted.measurements.xy_mm).max()
    assert shift > 0.02  # mm, of image points of 1 um
    assert far_off(block, found)[0] < 0.2
    np.testing.assert_array_equal(found.images.position_m, corrected.images.position_m)
    assert (found.suspects.kind != "image_point").all()


@pytest.mark.slow
def test_a_mirrored_image_is_named_and_not_oriented() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    m, wide = block.image_points, block.cameras.format[0, 0]
    xy = m.xy.copy()
    xy[m.image == 7, 0] = wide - xy[m.image == 7, 0]
    told = Told()
    found = initial_of(replace(block, image_points=replace(m, xy=xy)), told, pairs_per_image=8)
    assert np.flatnonzero(~found.images.oriented).tolist() == [7]
    assert any("not oriented" in text and str(block.images.id[7]) in text for text in told.warnings)
    assert far_off(block, found)[0] < 0.2


@pytest.mark.slow
def test_cameras_of_which_one_has_a_wrong_principal_distance_are_told_apart() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    two = block.cameras.take(np.array([0, 0]))
    c_mm = two.principal_distance_mm * [1.0, 1.1]
    camera = (np.arange(len(block.images)) >= 12).astype(np.int32)
    wrong = replace(
        block,
        cameras=replace(two, id=np.array(["first", "second"]), principal_distance_mm=c_mm),
        images=replace(block.images, camera=camera),
    )
    told = Told()
    found = initial_of(wrong, told, pairs_per_image=8)
    assert found.images.oriented.all()
    assert any("contradict all else" in text and "by camera: first" in text for text in told.warnings)


def test_a_wrong_position_among_five_is_named() -> None:
    block = without_strips(simulated(**SMALL_UAV))
    e = block.exterior.take(np.array([0, 5, 13, 20, 22]))
    wrong = e.position_m.copy()
    wrong[1, 0] += 30.0
    bare = replace(
        block, ground_points=block.ground_points.take(np.zeros(0, dtype=np.intp)), exterior=replace(e, position_m=wrong)
    )
    found = initial_of(bare, pairs_per_image=8)
    s = found.suspects
    assert s.image[(s.kind == "position") & (s.verdict == "rejected")].tolist() == [str(block.images.id[5])]
    assert far_off(block, found)[0] < 0.2


@pytest.mark.slow
def test_images_with_their_y_axis_the_wrong_way_round_are_refused() -> None:
    few = {"flight": {"strips": 2, "images_per_strip": 5}, "known": {"full": 5}}  # each two control points are tried
    block = without_strips(simulated(**{**SMALL_UAV, **few}))
    m = block.image_points
    xy = np.column_stack([m.xy[:, 0], block.cameras.format[0, 1] - m.xy[:, 1]])
    with pytest.raises(GeometryError, match="fit it mirrored only") as refused:
        initial_of(replace(block, image_points=replace(m, xy=xy)), pairs_per_image=8)
    assert "y axis of the image coordinates" in str(refused.value)


def test_pairs_of_six_points_at_the_standard_positions_are_oriented() -> None:
    block = without_strips(simulated(preset="sample"))  # three strips of five images, 35 points
    points = systematic(block, affine(block), options=SystematicOptions(refraction=False, earth_curvature=False))
    found = graph(block, points, rng=np.random.default_rng(1))
    assert found.images.oriented.all()
    done = bundle(block, points, found)
    assert done.sigma0 < 1.5
    assert not (done.suspects.verdict == "rejected").any()  # nothing is wrong


def bending(seed: int) -> Block:
    """Three long strips, held by four exact control points, with positions."""
    flight, known = {"strips": 3, "images_per_strip": 8}, {"layout": [], "full": 4}
    more = {"ties": {"per_position": 4}, "gnss": {"observed": True}}
    return without_strips(simulated(seed, preset="sample", flight=flight, known=known, **more))


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("seed", [37, 39])
def test_positions_that_fit_a_bent_block_are_not_left_out(seed: int) -> None:
    told = Told()
    found = initial_of(bending(seed), told)
    assert not told.warnings
    assert not (found.suspects.kind == "position").any()


@pytest.mark.slow
def test_positions_shifted_by_more_than_a_block_bends_are_left_out() -> None:
    block, told = bending(37), Told()
    e = block.exterior
    initial_of(replace(block, exterior=replace(e, position_m=e.position_m + np.array([0.0, 0.0, 8.0]))), told)
    assert any("observed positions (24) contradict all else" in text for text in told.warnings)


@pytest.mark.slow
def test_a_number_given_to_two_places_costs_no_strip_that_hangs_on_four_others(tmp_path: Path) -> None:
    small = flown(2, 5, points=40, apart_m=450.0)
    strip = {point: {small.strip[i][0] for i, p in small.rays if p == point} for point in small.xyz_m}
    often = Counter((small.strip[i][0], p) for i, p in small.rays)
    both = [p for p in small.xyz_m if min(often["S1", p], often["S2", p]) > 1]
    corners = [min(both, key=lambda p: a * small.xyz_m[p][0] + b * small.xyz_m[p][1]) for a in (1, -1) for b in (3, -3)]
    small.rays = {
        (i, p): xy
        for (i, p), xy in small.rays.items()
        if small.strip[i][0] == "S1" or strip[p] == {"S2"} or p in corners
    }
    small.control, small.observed = dict.fromkeys(small.seen_by("102")[:6], "XYZ"), {}
    first, second = (
        next(p for p in strip if strip[p] == {of} and often[of, p] > 1 and p not in small.control)
        for of in ("S1", "S2")
    )
    small.rays = {(i, first if p == second else p): xy for (i, p), xy in small.rays.items()}
    done = adjusted_by("graph", small.write(tmp_path / "b"))
    assert any(f"without {first}: two objects may carry the number" in text for text in done.warnings)
    assert done.bundle.images.oriented.all()
    assert off_m(small, done.bundle) < 1.0
