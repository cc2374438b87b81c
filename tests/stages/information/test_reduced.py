"""Blocks adjusted by themselves and combined by their reduced normal equations are the joint adjustment."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from aatri.adapters.bundle.information_observed import SharedBlock, _difference
from aatri.artifacts.block import Block
from aatri.artifacts.information import Information
from aatri.artifacts.solution import Solution
from aatri.checks.as_read.screening import screened
from aatri.errors import AatriError
from aatri.formats.merging.part import part_of
from aatri.geometry.rotations import exp_rotation
from aatri.observations.poses import Poses
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.information.reduced import ReducedOptions, reduced
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.film_blocks import Told

OF_SIGMA = 1e-8
"""By so much of its standard deviation a result may differ from that of the joint adjustment."""

PLAIN = {"tolerance": 1e-6, "blunders": {"method": "none"}}
DIGITAL = {"camera": {"kind": "digital", "format": (20000, 20000)}}


@cache
def block_of_strips(film: bool, strips: int = 4, curved: bool = False, cross: int = 0) -> Block:
    flight = {"strips": strips, "images_per_strip": 4, "cross_strips": cross}
    spec: dict[str, Any] = {"flight": flight, "imu": {"observed": True}}
    spec |= {} if film else DIGITAL
    spec |= {"earth": "tangent", "false_origin_m": (500000.0, 3000000.0)} if curved else {}
    block = simulate(options=SimulateOptions.model_validate(spec), rng=np.random.default_rng(5))
    assert isinstance(block, Block)
    return block


def cut(block: Block, first: int, last: int) -> Block:
    """Some strips."""
    return part_of(block, np.isin(block.images.strip, range(first, last)))


def adjusted(block: Block, information: Information | None = None, initial: Solution | None = None, **more: Any) -> Any:
    return bundle(block, _points(block), initial, information=information, options=BundleOptions(**(PLAIN | more)))


def said(
    block: Block, other: Block, information: Information | None = None, initial: Solution | None = None, **more: Any
) -> Any:
    options = ReducedOptions(**(PLAIN | more))
    return reduced(block, _points(block), initial, information=information, other=other, options=options)


def _points(block: Block) -> Any:
    return (affine if (block.cameras.kind == "film").all() else calibrated)(block)


def apart(part: Solution, joint: Solution) -> float:
    """Largest difference of positions and points in standard deviations of the joint adjustment."""
    image = np.searchsorted(joint.images.id, part.images.id)
    point = np.searchsorted(joint.points.id, part.points.id)
    dx = part.images.position_m - joint.images.position_m[image]
    sigma = np.sqrt(np.einsum("nii->ni", joint.images.covariance[image])[:, :3])
    dp = part.points.xyz_m - joint.points.xyz_m[point]
    sigma_p = np.sqrt(np.einsum("nii->ni", joint.points.covariance_m2[point]))
    known = (sigma_p > 0).all(axis=1)
    assert (np.isfinite(part.points.xyz_m) == np.isfinite(joint.points.xyz_m[point])).all()
    return float(max(np.abs(dx / sigma).max(), np.abs(dp[known] / sigma_p[known]).max()))


def by_turns(parts: list[Block], joint: Solution, rounds: int = 2, **options: Any) -> list[Solution]:
    """Two parts adjusted by turns, each with what the other says."""
    a, b = parts
    of_b = first = second = None
    for _ in range(rounds):
        of_a = said(a, b, of_b, first, **options)
        second = adjusted(b, of_a, second, **options)
        assert apart(second, joint) < 0.05  # at first linearised at its own adjustment: of second order
        of_b = said(b, a, of_a, second, **options)
        first = adjusted(a, of_b, first, **options)
    assert first is not None
    assert second is not None
    return [first, second]


@pytest.mark.slow
@pytest.mark.parametrize("film", [True, False], ids=["film", "digital"])
def test_shared_points_of_one_ray_in_a_part_count_as_in_the_joint_adjustment(film: bool) -> None:
    block = block_of_strips(film, 3, cross=2)
    west = np.isin(block.images.strip, (0, 3, 4))  # a strip and both cross strips
    a, b = part_of(block, west), part_of(block, ~west)
    rays = np.bincount(a.image_points.point, minlength=len(a.points))
    assert (np.isin(a.points.id, b.points.id) & (rays == 1)).any()
    joint = adjusted(block)
    for part in by_turns([a, b], joint, 3):
        assert apart(part, joint) < OF_SIGMA
        assert (part.redundancy, part.observations) == (joint.redundancy, joint.observations)
        assert part.sigma0 == pytest.approx(joint.sigma0, rel=1e-9)


@pytest.mark.slow
def test_a_point_of_one_ray_that_both_leave_open_counts_in_neither() -> None:
    block = block_of_strips(False, 3, cross=2)
    west = np.isin(block.images.strip, (0, 3, 4))
    m = block.image_points
    count = np.bincount(m.point[west[m.image]], minlength=len(block.points))
    point = np.flatnonzero((count == 1) & (np.bincount(m.point, minlength=len(count)) > 2))[0]
    active = m.active & ((m.point != point) | west[m.image])
    block = replace(block, image_points=replace(m, active=active))
    joint = adjusted(block)
    assert not np.isfinite(joint.points.xyz_m[point]).any()
    for part in by_turns([part_of(block, west), part_of(block, ~west)], joint):
        assert apart(part, joint) < OF_SIGMA
        assert part.redundancy == joint.redundancy
        assert not np.isfinite(part.points.xyz_m[part.points.id == block.points.id[point]]).any()


def test_image_points_of_images_without_orientation_are_lost_and_named() -> None:
    block = block_of_strips(False, 3)
    a, b = cut(block, 0, 1), cut(block, 1, 3)
    m, last = a.image_points, len(a.images) - 1
    row = np.flatnonzero((m.image == last) & np.isin(a.points.id[m.point], b.points.id))[0]
    active = np.where(m.image == last, np.arange(len(m)) == row, m.point != m.point[row])  # it has but one image point,
    known = a.exterior.take(np.flatnonzero(a.exterior.image != last))
    a = replace(a, image_points=replace(m, active=active), exterior=known)
    ear = Told()
    reduced(a, _points(a), other=b, options=ReducedOptions(**PLAIN), context=ear)
    (told,) = [text for text in ear.warnings if text.startswith("lost: ")]
    assert told.startswith("lost: 1 image point of 1 shared point, no image")
    assert str(a.points.id[m.point[row]]) in told


def test_image_points_set_aside_as_the_block_was_read_are_named() -> None:
    block = block_of_strips(False, 3, cross=2)
    west = np.isin(block.images.strip, (0, 3, 4))
    ear = Told()
    read = screened(part_of(block, west), ear)
    once = [name for name in read.rejects.id.tolist() if name.partition("/")[2] in set(block.points.id.tolist())]
    ear.warnings.clear()
    reduced(read, _points(read), other=part_of(block, ~west), options=ReducedOptions(**PLAIN), context=ear)
    (told,) = [text for text in ear.warnings if "set aside as the block was read" in text]
    assert told.startswith(f"of shared points {len(once)} image points were set aside")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("film", "curved", "options"),
    [(True, False, {}), (False, False, {"self_calibration": "brown_conrady"}), (False, True, {})],
    ids=["film", "self-calibration", "tangent-frame"],
)
def test_two_blocks_that_share_a_strip_are_the_joint_adjustment(film: bool, curved: bool, options: Any) -> None:
    block = block_of_strips(film, 3, curved)
    a, b = cut(block, 0, 2), cut(block, 1, 3)
    joint = adjusted(block, **options)
    of_b = first = second = None
    for _ in range(2):
        of_a = said(a, b, of_b, first, **options)
        second = adjusted(b, of_a, second, **options)
        assert apart(second, joint) < 0.01  # at first linearised at its own adjustment: of second order
        of_b = said(b, a, of_a, second, **options)
        first = adjusted(a, of_b, first, **options)
    for part in (first, second):
        assert apart(part, joint) < (OF_SIGMA if not curved else 1e-6)  # coordinates of a map have nine digits less
        assert (part.redundancy, part.observations) == (joint.redundancy, joint.observations)
        assert part.sigma0 == pytest.approx(joint.sigma0, rel=1e-9)
        rows = np.searchsorted(joint.images.id, part.images.id)
        np.testing.assert_allclose(part.images.covariance, joint.images.covariance[rows], rtol=1e-4, atol=1e-12)


def test_new_images_are_added_to_a_finished_block() -> None:
    block = block_of_strips(False, 3)
    old, new = cut(block, 0, 2), cut(block, 1, 3)
    new = part_of(new, new.images.strip == 1)  # the last strip alone: what it shares with the old are points
    old_points = np.isin(block.points.id, new.points.id) & np.isin(block.points.id, old.points.id)
    assert not np.isin(new.images.id, old.images.id).any()
    finished = said(old, new)
    assert finished.metrics()["images"] == 0
    assert finished.metrics()["points"] == old_points.sum()
    joint = adjusted(part_of(block, np.ones(len(block.images), dtype=bool)))
    assert apart(adjusted(new, finished), joint) < 0.01


def test_the_reduced_normal_matrix_is_the_inverse_of_the_covariance() -> None:
    block = block_of_strips(False, 3)
    points = [str(block.points.id[k]) for k in (3, 11)]
    images = [str(name) for name in block.images.id[[0, 5]]]
    made = said(block, cut(block, 1, 2), keep={"images": images, "points": points})
    Q = np.linalg.inv(made.matrix)
    joint = adjusted(block, point_covariances=points)
    order = [f"{g} {o}" for g, o in zip(made.unknowns.group, made.unknowns.object)]
    for name in images:
        own = np.flatnonzero(np.array(order) == f"image {name}")
        row = int(np.flatnonzero(joint.images.id == name)[0])
        np.testing.assert_allclose(Q[np.ix_(own, own)], joint.images.covariance[row], rtol=1e-6, atol=1e-16)
    own = [np.flatnonzero(np.array(order) == f"point {name}") for name in points]
    pairs = joint.point_covariances
    rows = [int(np.flatnonzero(joint.points.id == name)[0]) for name in points]
    between = next(k for k in range(len(pairs)) if [pairs.first[k], pairs.second[k]] == sorted(rows))
    np.testing.assert_allclose(Q[np.ix_(own[0], own[1])], pairs.covariance_m2[between], rtol=1e-5, atol=1e-14)
    np.testing.assert_allclose(made.unknowns.right / np.sqrt(np.diagonal(made.matrix)), 0, atol=1e-3)
    assert made.cost == pytest.approx(joint.sigma0**2 * joint.redundancy, rel=1e-6)


def test_blocks_without_a_common_unknown_are_refused() -> None:
    block = block_of_strips(False)
    a, b = cut(block, 0, 1), cut(block, 3, 4)
    with pytest.raises(AatriError, match="nothing stays: no adjusted image or point is one of another block"):
        said(a, b)
    with pytest.raises(AatriError, match="shares no unknown with this block"):
        adjusted(b, said(a, cut(block, 1, 2)))


def test_what_both_have_and_one_has_eliminated_is_refused_by_name() -> None:
    block = block_of_strips(False, 3)
    a, b = cut(block, 0, 2), cut(block, 1, 3)
    made = said(a, cut(block, 2, 3))  # the images of the common strip are eliminated
    with pytest.raises(AatriError, match=r"images .* of this block were eliminated in the Information of block"):
        adjusted(b, made)
    with pytest.raises(AatriError, match="were eliminated"):  # the same block twice
        adjusted(a, made)


def test_contradictions_are_refused_by_name() -> None:
    block = block_of_strips(False, 3)
    a, b = cut(block, 0, 2), cut(block, 1, 3)
    made = said(a, b)
    cameras = replace(b.cameras, principal_distance_mm=b.cameras.principal_distance_mm + 0.1)
    with pytest.raises(AatriError, match="camera camera is another in block"):
        adjusted(replace(b, cameras=cameras), made)
    frames = replace(b.frames, crs=np.array(["EPSG:32650"]))
    with pytest.raises(AatriError, match="is in the frame"):
        adjusted(replace(b, frames=frames), made)
    with pytest.raises(AatriError, match="adjust both with the same set"):
        adjusted(b, made, self_calibration="brown_conrady")
    calibrated_a = said(a, b, self_calibration="brown_conrady")
    with pytest.raises(AatriError, match="adjust both with the same set"):
        adjusted(b, calibrated_a)
    with pytest.raises(AatriError, match="adjust both with the same set"):
        adjusted(b, calibrated_a, self_calibration="ebner12")
    ground = b.ground_points
    name = next(k for k in range(len(ground)) if str(b.points.id[ground.point[k]]) in set(a.points.id))
    xyz = ground.xyz_m.copy()
    xyz[name, 0] += 0.1
    with pytest.raises(AatriError, match=f"control {b.points.id[ground.point[name]]} has another value"):
        adjusted(replace(b, ground_points=replace(ground, xyz_m=xyz)), made)


def test_patterns_of_what_stays_have_to_match() -> None:
    block = block_of_strips(False, 3)
    with pytest.raises(AatriError, match="no image has an id like X"):
        said(block, cut(block, 0, 1), keep={"images": ["X"]})


def test_the_difference_of_a_pose_is_that_of_position_and_rotation_with_its_derivatives() -> None:
    """A turn by exp(w) of the linearisation differs from it by w; a step s before it by that of exp(s) exp(w)."""
    rng = np.random.default_rng(1)
    base, w = exp_rotation(rng.normal(0, 1.0, (1, 3)))[0], np.array([0.3, -0.2, 0.4])
    b = SharedBlock("pose", 0, np.arange(6), np.arange(6), (np.array([10.0, 20.0, 30.0]), base))

    def at(step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rotation = exp_rotation(step[None, 3:]) @ exp_rotation(w[None]) @ base
        return _difference(Poses(np.array([[11.0, 18.0, 33.0]]) + step[:3], rotation), b)

    value, derivatives = at(np.zeros(6))
    np.testing.assert_allclose(value, [1.0, -2.0, 3.0, *w], atol=1e-12)
    for k, e in enumerate(1e-6 * np.eye(6)):
        np.testing.assert_allclose((at(e)[0] - at(-e)[0]) / 2e-6, derivatives[:, k], atol=1e-8)


def test_new_images_without_a_start_are_resected_on_the_points_of_the_finished_block() -> None:
    spec = DIGITAL | {"flight": {"strips": 3, "images_per_strip": 4}, "ties": {"new_points": 400}}
    options = SimulateOptions.model_validate(spec | {"imu": {"observed": True}})
    block = simulate(options=options, rng=np.random.default_rng(5))
    assert isinstance(block, Block)
    start, e = adjusted(block), block.exterior
    block = replace(block, exterior=e.take(np.flatnonzero(block.images.strip[e.image] < 2)))
    finished, new = cut(block, 0, 2), cut(block, 2, 3)
    with pytest.raises(AatriError, match="no image has a starting orientation"):
        adjusted(new)
    assert apart(adjusted(new, said(finished, new)), adjusted(block, None, start)) < 0.01
