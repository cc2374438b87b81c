"""The bundle's own search for gross errors: in image points, control and positions together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told
from tests.stages.initial_orientation import unordered
from tests.stages.initial_orientation.unordered import SMALL_UAV

SIGMA_MM = 0.005


@pytest.fixture(scope="module")
def chain() -> Chain:
    return run_chain(
        simulated(
            2,
            preset="rc30",
            flight={"strips": 3, "images_per_strip": 5, "cross_strips": 0},
            known={"full": 10},
            ties={"new_points": 500},
        )
    )


def _spoilt(chain: Chain) -> tuple[Block, ImagePoints, np.ndarray, int]:
    """One image point in a hundred wrong by 10 to 1000 sigma, one control point by a metre, one position by two."""
    m, rng = chain.refined.measurements, np.random.default_rng(1)
    bad = rng.permutation(np.flatnonzero(m.active))[: len(m) // 100]
    angle, size = rng.uniform(0, 2 * np.pi, len(bad)), SIGMA_MM * 10 ** rng.uniform(1, 3, len(bad))
    xy = m.xy_mm.copy()
    xy[bad] += size[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    g, e = chain.block.ground_points, chain.block.exterior
    xyz, position = g.xyz_m.copy(), e.position_m.copy()
    control = int(np.flatnonzero((g.role == 1).any(axis=1))[3])
    xyz[control, 1] += 1.0
    position[7, 2] += 2.0
    block = replace(chain.block, ground_points=replace(g, xyz_m=xyz), exterior=replace(e, position_m=position))
    return block, replace(chain.refined, measurements=replace(m, xy_mm=xy)), bad, control


def _unsuspecting(initial: Solution) -> Solution:
    return replace(initial, suspects=Suspects.empty())


@pytest.mark.slow
@pytest.mark.parametrize("method", ["robust_snooping", pytest.param("data_snooping", marks=pytest.mark.slow)])
def test_gross_errors_of_all_kinds_are_found_and_the_block_is_as_good_as_without_them(
    chain: Chain, method: str
) -> None:
    block, points, bad, control = _spoilt(chain)
    options = BundleOptions(interior_unknowns=True, blunders=method)
    solution = bundle(block, points, _unsuspecting(chain.strip_block), options=options)
    s = solution.suspects
    assert set(s.verdict.tolist()) <= {"rejected", "undecidable"}
    assert s.row[s.kind == "control"].tolist() == [control]
    assert s.size[s.kind == "control"][0] == pytest.approx(1.0, abs=0.15)
    assert s.row[s.kind == "position"].tolist() == [7]
    m = points.measurements
    rays = np.bincount(m.point[m.active], minlength=len(block.points))[m.point[bad]]
    found = np.isin(bad, s.row[s.kind == "image_point"])
    assert found[rays > 2].mean() > 0.95  # in points of two rays an error along the base shows in nothing
    assert 0.97 < solution.sigma0 < 1.03
    truth = chain.block.true_points
    assert truth is not None
    several = np.bincount(m.point[m.active], minlength=len(block.points))[truth.point] > 2

    def rmse(found: Solution) -> np.ndarray:
        return np.sqrt(np.nanmean((found.points.xyz_m[truth.point] - truth.xyz_m)[several] ** 2, axis=0))

    g = chain.block.ground_points
    role = g.role.copy()
    role[control] = 0
    clean = bundle(
        replace(chain.block, ground_points=replace(g, role=role)),
        chain.refined,
        chain.strip_block,
        options=BundleOptions(interior_unknowns=True),
    )
    assert (rmse(solution) < 1.1 * rmse(clean) + 1e-3).all()


def test_a_clean_block_loses_next_to_nothing(chain: Chain) -> None:
    options = BundleOptions(interior_unknowns=True, blunders="robust_snooping")
    solution = bundle(chain.block, chain.refined, _unsuspecting(chain.strip_block), options=options)
    assert len(solution.suspects) == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_told_of_few_control_points_is_the_same_whatever_is_guessed_of_image_points(seed: int) -> None:
    """Control of 4 mm, given as 2 mm, beside image points of half their standard deviation, and of the right one."""
    flight, no_positions = {"strips": 3, "images_per_strip": 6}, np.zeros(0, dtype=np.intp)
    block = unordered.simulated(seed, **{**SMALL_UAV, "flight": flight, "ties": {"random_per_image": 25.0}})
    g, truth, rng = block.ground_points, block.true_points, np.random.default_rng(seed)
    assert truth is not None
    true_m = truth.xyz_m[np.searchsorted(truth.point, g.point)] + rng.normal(0, 0.004, (len(g), 3))
    given = replace(g, xyz_m=true_m, covariance_m2=np.tile(0.002**2 * np.eye(3), (len(g), 1, 1)))
    block = replace(block, ground_points=given, exterior=block.exterior.take(no_positions))
    points, initial, of_control = unordered.measured(block), unordered.initial_of(block), []
    for times in (1.0, 0.5):
        told, m = Told(), points.measurements
        guessed = replace(points, measurements=replace(m, sigma_mm=m.sigma_mm * times))
        bundle(block, guessed, _unsuspecting(initial), context=told)
        of_control.append(["control" in text.split(": ")[-1] for text in told.warnings if "do not fit" in text])
    assert any(of_control[0]) == any(of_control[1])


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("kind", ["image_point", "control", "position"])
@pytest.mark.parametrize("times", [0.2, *(pytest.param(x, marks=pytest.mark.slow) for x in (0.5, 2.0)), 5.0])
def test_standard_deviations_that_are_guessed_wrong_cost_no_good_point(chain: Chain, kind: str, times: float) -> None:
    """At most 0.3 % lost; where their class can tell, coordinates as with the right ones to 5 %."""
    g, e, m = chain.block.ground_points, chain.block.exterior, chain.refined.measurements
    block, points, told = chain.block, chain.refined, Told()
    if kind == "control":
        block = replace(block, ground_points=replace(g, covariance_m2=g.covariance_m2 * times**2))
    elif kind == "position":
        block = replace(block, exterior=replace(e, position_covariance_m2=e.position_covariance_m2 * times**2))
    else:
        points = replace(points, measurements=replace(m, sigma_mm=m.sigma_mm * times))
    options = BundleOptions(interior_unknowns=True)
    solution = bundle(block, points, _unsuspecting(chain.strip_block), options=options, context=told)
    assert len(solution.suspects) <= 0.003 * len(m)
    assert (solution.suspects.kind == "image_point").all()
    if kind == "image_point":
        right = bundle(chain.block, chain.refined, _unsuspecting(chain.strip_block), options=options)
        truth = chain.block.true_points
        assert truth is not None
        rmse = [
            np.sqrt(np.nanmean((s.points.xyz_m[truth.point] - truth.xyz_m) ** 2, axis=0)) for s in (solution, right)
        ]
        assert (rmse[0] < 1.05 * rmse[1]).all()
        assert solution.sigma0 == pytest.approx(1 / times, rel=0.1)  # the ratio to standard deviations as given
        assert solution.remaining_sigma0 == pytest.approx(1.0, abs=0.1)  # the covariances follow
        assert solution.sigma0_um == pytest.approx(right.sigma0_um, rel=0.02)
        sigma, of_right = (np.sqrt(np.einsum("nii->ni", s.points.covariance_m2)) for s in (solution, right))
        assert np.nanmedian(sigma / of_right) == pytest.approx(1.0, abs=0.05)
        (line,) = [text for text in told.warnings if "standard deviations do not fit the residuals" in text]
        assert float(line.split("): image_point ")[1].split(",")[0]) == pytest.approx(1 / times, rel=0.1)


@pytest.mark.slow
def test_of_a_kind_with_more_wrong_than_the_share_allows_all_stay_and_are_told(chain: Chain) -> None:
    told = Told()
    g = chain.block.ground_points
    xyz = g.xyz_m.copy()
    rows = np.flatnonzero((g.role == 1).any(axis=1))
    xyz[rows[2:5], 2] += [1.0, -1.5, 2.0]
    block = replace(chain.block, ground_points=replace(g, xyz_m=xyz))
    options = BundleOptions(interior_unknowns=True, blunders={"method": "data_snooping", "max_share": 0.05})
    solution = bundle(block, chain.refined, _unsuspecting(chain.strip_block), options=options, context=told)
    out = (solution.suspects.kind == "control") & solution.suspects.staying_out
    assert not out.any()  # never an arbitrary part
    (line,) = [line for line in told.warnings if line.startswith("control:") and "kept: more than 5%" in line]
    names = block.points.id[g.point[rows[2:5]]]
    assert all(name in line for name in names), told.warnings


@pytest.mark.slow
@pytest.mark.parametrize("count", [pytest.param(2, marks=pytest.mark.slow), 3])
def test_several_wrong_control_points_are_found_without_any_option(chain: Chain, count: int) -> None:
    """Of ten control points one is too many for "5 % of a kind"; their redundancy answers for more."""
    g = chain.block.ground_points
    xyz = g.xyz_m.copy()
    rows = np.flatnonzero((g.role == 1).all(axis=1))[[1, 4, 8][:count]]
    xyz[rows, 2] += [1.0, -1.5, 0.8][:count]
    block = replace(chain.block, ground_points=replace(g, xyz_m=xyz))
    solution = bundle(block, chain.refined, _unsuspecting(chain.strip_block), options=BundleOptions())
    s = solution.suspects
    assert s.row[(s.kind == "control") & s.staying_out].tolist() == rows.tolist()
    assert 0.97 < solution.sigma0 < 1.03


@pytest.mark.slow
def test_exchanged_numbers_and_coordinates_are_recognised(chain: Chain) -> None:
    """Image points with each other's number in six images; two control points with each other's coordinates."""
    m, g, rng = chain.refined.measurements, chain.block.ground_points, np.random.default_rng(4)
    rays = np.bincount(m.point[m.active], minlength=len(chain.block.points))
    xy, pairs = m.xy_mm.copy(), []
    for image in range(2, 14, 2):
        pair = rng.choice(np.flatnonzero((m.image == image) & m.active & (rays[m.point] > 2)), 2, replace=False)
        xy[pair] = xy[pair[::-1]]
        pairs.append(pair)
    control = np.flatnonzero((g.role == 1).all(axis=1))[[2, 6]]
    xyz = g.xyz_m.copy()
    xyz[control] = xyz[control[::-1]]
    block = replace(chain.block, ground_points=replace(g, xyz_m=xyz))
    points = replace(chain.refined, measurements=replace(m, xy_mm=xy))
    options = BundleOptions(interior_unknowns=True, blunders={"max_share": 0.2})
    solution = bundle(block, points, _unsuspecting(chain.strip_block), options=options)
    s = solution.suspects
    swapped = s.verdict == "swapped"
    assert set(s.row[swapped & (s.kind == "image_point")].tolist()) == set(np.concatenate(pairs).tolist())
    assert sorted(s.row[swapped & (s.kind == "control")].tolist()) == sorted(control.tolist())
    numbers = solution.proposed_numbers
    assert numbers is not None
    assert numbers.exchanged.all()
    named = dict(zip(zip(numbers.image.tolist(), numbers.point.tolist()), numbers.proposed.tolist()))
    for image, a, b in ((m.image[p[0]], *m.point[p]) for p in pairs):
        of, ids = str(block.images.id[image]), block.points.id
        assert named[of, str(ids[a])] == str(ids[b])
        assert named[of, str(ids[b])] == str(ids[a])


def test_with_tau_the_sigma_of_the_measurements_need_not_be_known(chain: Chain) -> None:
    """Standard deviations stated a third of what they are: a priori a quarter of the block would be above the limit."""
    m = chain.refined.measurements
    points = replace(chain.refined, measurements=replace(m, sigma_mm=m.sigma_mm / 3))
    options = BundleOptions(blunders={"tau": True}, positions={"use": False})
    found = bundle(chain.block, points, _unsuspecting(chain.strip_block), options=options)
    assert (found.suspects.kind == "image_point").sum() <= 0.002 * len(m)


@pytest.mark.slow
def test_an_image_point_with_the_number_of_a_point_elsewhere_is_named_with_its_own(chain: Chain) -> None:
    """In six images the place of b was measured under the number of a; nobody measured a there, nor b."""
    m, rng = chain.refined.measurements, np.random.default_rng(7)
    rays = np.bincount(m.point[m.active], minlength=len(chain.block.points))
    xy, active, truth = m.xy_mm.copy(), m.active.copy(), {}
    for image in range(2, 14, 2):
        a, b = rng.choice(np.flatnonzero((m.image == image) & m.active & (rays[m.point] > 3)), 2, replace=False)
        xy[a], active[b] = xy[b], False
        ids = chain.block.points.id
        truth[str(chain.block.images.id[image]), str(ids[m.point[a]])] = str(ids[m.point[b]])
    points = replace(chain.refined, measurements=replace(m, xy_mm=xy, active=active))
    options, told = BundleOptions(interior_unknowns=True), Told()
    solution = bundle(chain.block, points, _unsuspecting(chain.strip_block), options=options, context=told)
    numbers = solution.proposed_numbers
    assert numbers is not None
    assert not numbers.exchanged.any()
    found = dict(zip(zip(numbers.image.tolist(), numbers.point.tolist()), numbers.proposed.tolist()))
    assert found == truth
    (line,) = [text for text in told.warnings if "fit under another number" in text]
    assert all(f"{image}/{a} (fits {b})" in line for (image, a), b in truth.items())


@pytest.mark.slow
def test_what_is_merely_wrong_is_given_no_other_number(chain: Chain) -> None:
    block, points, _, _ = _spoilt(chain)
    solution = bundle(block, points, _unsuspecting(chain.strip_block), options=BundleOptions(interior_unknowns=True))
    assert solution.proposed_numbers is not None
    assert len(solution.proposed_numbers) == 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 5, 8])
def test_a_ray_with_the_number_of_a_point_far_off_takes_no_right_ones_with_it(seed: int) -> None:
    block = _wide_angle(seed)
    m, rng = block.image_points, np.random.default_rng(seed)
    rays = np.bincount(m.point)
    row = rng.permutation(np.flatnonzero(rays[m.point] >= 3))[0]
    elsewhere = np.setdiff1d(np.flatnonzero(rays >= 5), m.point[m.image == m.image[row]])
    point = m.point.copy()
    point[row] = elsewhere[rng.integers(len(elsewhere))]
    assert _left_out(replace(block, image_points=replace(m, point=point))) == {
        (str(block.images.id[m.image[row]]), str(block.points.id[point[row]]))
    }


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 9])
def test_two_points_of_one_number_take_no_others_with_them_where_sigmas_are_a_fifth(seed: int) -> None:
    """Least squares with everything fail, so that without a robust adjustment nobody knows which sigmas fit."""
    block = _wide_angle(seed)
    m, rng = block.image_points, np.random.default_rng(seed)
    rays = np.bincount(m.point)
    first = m.point[rng.permutation(np.flatnonzero(rays[m.point] >= 3))[0]]
    shared = np.isin(m.image, m.image[m.point == first])
    elsewhere = np.setdiff1d(np.flatnonzero(rays >= 3), m.point[shared])
    second = elsewhere[rng.integers(len(elsewhere))]
    point = np.where(m.point == first, second, m.point)
    left_out = _left_out(replace(block, image_points=replace(m, point=point, sigma_mm=0.2 * m.sigma_mm)))
    assert {name for _, name in left_out} == {str(block.points.id[second])}


def _wide_angle(seed: int) -> Block:
    """Little overlap: least squares end in no fit, and Huber's loss turns the image with a ray of a wrong number."""
    flight = {"strips": 2, "images_per_strip": 7, "forward_overlap": 65.0, "side_overlap": 35.0}
    camera, ties = {"principal_distance_mm": 6.5}, {"random_per_image": 25.0}
    return simulated(seed, preset="uav", camera=camera, flight=flight, ties=ties)


def _left_out(block: Block) -> set[tuple[str, str]]:
    """Images and points of what the bundle of the whole chain leaves out."""
    suspects = run_chain(block).bundle.suspects
    out = suspects.staying_out
    return set(zip(suspects.image[out].tolist(), suspects.point[out].tolist()))
