"""Control that no strip holds, and strips that fit nothing, do not end the absolute orientation."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from aatri.errors import ConvergenceError, GeometryError
from aatri.stages.absolute_orientation.similarity import SimilarityOptions, similarity
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.made_strips import ORIGIN_M, MadeBlock
from tests.stages.bundle_adjustment.test_given_in_part import exterior
from tests.stages.chain import simulated
from tests.stages.film_blocks import Told
from tests.stages.hand_block import Hand, angles_deg, ground_rows, hand, read

IN_NO_STRIP = 14
"""A point that all six images see."""


def attitudes(of: Hand) -> list[dict[str, float]]:
    """Rows of the exterior of all images."""
    names = ("a1", "a2", "a3", "s1", "s2", "s3")
    return [dict(zip(names, [*row, 0.01, 0.01, 0.01])) for row in angles_deg(of, "omega-phi-kappa").tolist()]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("kept", "wrong"), [([0, 4], []), ([1, 3, 5], [5]), ([0, 1, 4], [1])])
def test_the_scale_hangs_on_a_control_point_that_strips_do_not_hold(
    kept: list[int], wrong: list[int], tmp_path: Path
) -> None:
    """Two points and attitudes; one point is seen once in each strip, or twice and wrong once."""
    of = hand()
    stays = (of.point != IN_NO_STRIP) | np.isin(of.image, kept)
    xy = of.xy_mm[stays].copy()
    image, point = of.image[stays], of.point[stays]
    off = (point == IN_NO_STRIP) & np.isin(image, wrong)
    xy[off] += [0.4, 0.9]
    some = replace(of, image=image, point=point, xy_mm=xy)
    rows = attitudes(of)
    block, points = read(tmp_path, some, ground=ground_rows(of, [0, IN_NO_STRIP]), exterior=exterior(rows), xy_mm=xy)
    solution = similarity(block, scale_transfer(block, dependent(block, points)), points)
    np.testing.assert_allclose(solution.images.position_m, of.position_m, atol=0.05)
    s = solution.suspects
    named = set(
        s.image[(s.kind == "image_point") & (s.point == f"p{IN_NO_STRIP}") & (s.verdict == "rejected")].tolist()
    )
    assert named == {f"i{k}" for k in wrong}


def test_two_rays_that_do_not_meet_are_no_control(tmp_path: Path) -> None:
    of = hand()
    stays = (of.point != IN_NO_STRIP) | np.isin(of.image, [0, 4])
    some = replace(of, image=of.image[stays], point=of.point[stays], xy_mm=of.xy_mm[stays].copy())
    some.xy_mm[(some.point == IN_NO_STRIP) & (some.image == 4)] += [0.9, 0.4]
    rows = attitudes(of)
    ground = ground_rows(of, [0, IN_NO_STRIP])
    block, points = read(tmp_path, some, ground=ground, exterior=exterior(rows), xy_mm=some.xy_mm)
    with pytest.raises(GeometryError, match="not determined: scale"):
        similarity(block, scale_transfer(block, dependent(block, points)), points)


def bent_block(bent: list[int]) -> tuple[Any, Any, Any]:
    """A block of four strips with positions; the middle of some strips sags by a tenth of the flying height."""
    block = simulated(
        5,
        flight={"strips": 4, "images_per_strip": 5, "side_overlap": 30.0},
        known={"full": 4},
        gnss={"observed": True},
        camera={"kind": "digital", "principal_distance_mm": 100.0, "format": (4000.0, 3000.0), "pixel_size_mm": 0.03},
    )
    points = calibrated(block)
    strips = scale_transfer(block, dependent(block, points))
    p, i = strips.strip_points, strips.strip_images
    xyz, centres = p.xyz.copy(), i.position.copy()
    for strip in bent:
        mine, theirs = p.strip == strip, i.strip == strip
        along = centres[theirs][:, 0]
        for x in (mine_x := xyz[mine], its_x := centres[theirs]):
            x[:, 2] += 0.4 * np.abs(xyz[mine][:, 2]).mean() * ((x[:, 0] - along.mean()) / np.ptp(along)) ** 2
        xyz[mine], centres[theirs] = mine_x, its_x
    return block, points, replace(strips, strip_points=replace(p, xyz=xyz), strip_images=replace(i, position=centres))


@pytest.mark.slow
def test_a_bent_strip_is_left_out_by_name() -> None:
    block, points, strips = bent_block([1])
    told = Told()
    solution = similarity(block, strips, points, context=told)
    oriented = solution.images.oriented
    np.testing.assert_array_equal(oriented, block.images.strip != 1)
    assert any("strip 2 is" in text and "left out here: its models are weak" in text for text in told.warnings)
    off = solution.images.position_m[oriented] - block.true_images.position_m[oriented]
    assert np.abs(off).max() < 2.0
    with pytest.raises(ConvergenceError, match="max_sigma0"):
        similarity(block, strips, points, options=SimilarityOptions(max_sigma0=20.0))


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_a_principal_distance_that_is_a_tenth_off_is_named_by_strips_and_by_the_bundle(factor: float) -> None:
    """Positions and control lie on two levels, which the models hold apart by the wrong share."""
    flight = {"strips": 2, "images_per_strip": 4, "cross_strips": 0}
    block = simulated(5, preset="rc30", flight=flight, ties={"new_points": 80}, known={"full": 6})
    c_mm = block.cameras.principal_distance_mm
    block = replace(block, cameras=replace(block.cameras, principal_distance_mm=c_mm * factor))
    points, told = affine(block), Told()
    strips = scale_transfer(block, dependent(block, points))
    with pytest.raises(ConvergenceError, match="max_sigma0 = 20"):
        similarity(block, strips, points, options=SimilarityOptions(max_sigma0=20.0))
    solution = similarity(block, strips, points, context=told)
    assert bundle(block, points, solution, context=told).contradictions
    named = [re.search(r"a principal distance of ([0-9.]+) .*mm instead of", text) for text in told.warnings]
    assert [abs(float(one[1]) / c_mm[0] - 1) < 0.002 for one in named if one] == [True, True]


@pytest.mark.slow
def test_of_tilted_images_too_the_bundle_names_the_principal_distance() -> None:
    """In images tilted to all sides it stretches no heights, which would tell it before."""
    flight = {"strips": 2, "images_per_strip": 4, "cross_strips": 0, "tilt_sigma_deg": 20.0, "tilt_max_deg": 29.0}
    block = simulated(5, preset="rc30", flight=flight, ties={"new_points": 80}, known={"full": 6})
    c_mm = block.cameras.principal_distance_mm
    block = replace(block, cameras=replace(block.cameras, principal_distance_mm=c_mm * 0.98))
    points, told = affine(block), Told()
    solution = similarity(block, scale_transfer(block, dependent(block, points)), points, context=told)
    assert any("the bundle can begin from there" in text for text in told.warnings)
    assert bundle(block, points, solution, context=told).contradictions
    named = [re.search(r"a principal distance of ([0-9.]+) .*mm instead of", text) for text in told.warnings]
    assert [abs(float(one[1]) / c_mm[0] - 1) < 0.002 for one in named if one] == [True]


@pytest.mark.slow
def test_where_many_strips_do_not_fit_it_is_another_cause() -> None:
    block, points, strips = bent_block([0, 1, 3])
    with pytest.raises(ConvergenceError, match=r"strips and control do not fit each other(?!.*principal distance)"):
        similarity(block, strips, points)


def apart(common: int, *, once: bool = False) -> tuple[Any, Any, Any]:
    """Two strips, each with positions of three images nearly on a line, that share `common` points and no control.

    `once`: the second strip sees these in one image only, so that they lie in no model of it.
    """
    block = simulated(3, flight={"strips": 2, "images_per_strip": 5}, known={"full": 0}, gnss={"observed": True})
    m, e, strip = block.image_points, block.exterior, block.images.strip
    first, second = (np.unique(m.point[strip[m.image] == k]) for k in (0, 1))
    shared = np.intersect1d(first, second)
    gone = np.isin(m.point, shared[common:]) & (strip[m.image] == 1)
    if once:
        again = np.flatnonzero(np.isin(m.point, shared[:common]) & (strip[m.image] == 1))
        gone[np.setdiff1d(again, again[np.unique(m.point[again], return_index=True)[1]])] = True
    some = np.concatenate([np.flatnonzero(strip[e.image] == k)[[0, 2, 4]] for k in (0, 1)])
    block = replace(block, image_points=replace(m, active=m.active & ~gone), exterior=e.take(some))
    points = affine(block)
    return block, points, scale_transfer(block, dependent(block, points))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("once", "level", "within"), [(False, 0, 0.001), (True, 2, 0.02)], ids=["by shared points", "by single rays, level"]
)
def test_strips_whose_positions_leave_a_turn_open_hold_each_other(once: bool, level: int, within: float) -> None:
    block, points, strips = apart(2, once=once)
    told = Told()
    initial = similarity(block, strips, points, context=told)
    assert initial.images.oriented.all()
    assert sum("begun level for the bundle" in text for text in told.warnings) == level
    off = initial.images.position_m - block.true_images.position_m
    assert np.abs(off).max() < within * np.ptp(block.true_images.position_m[:, 0])
    done = bundle(block, points, initial)
    off = np.linalg.norm(done.images.position_m - block.true_images.position_m, axis=1)
    sigma = np.sqrt(np.einsum("nii->n", done.images.covariance[:, :3, :3]))
    assert (off < 4 * sigma).all()


def test_strips_without_a_common_point_begin_by_what_hardly_determines_them() -> None:
    """Three positions some metres off a line: the bundle tells how well that turns a strip about it."""
    block, points, strips = apart(0)
    told = Told()
    initial = similarity(block, strips, points, context=told)
    named = [text for text in told.warnings if text.startswith("hardly determined, errors are magnified")]
    assert len(named) == 2
    assert all("rotation about the line" in text for text in named)
    done = bundle(block, points, initial, context=told)
    assert any(text.startswith("hardly determined: ") for text in told.warnings)
    off = done.points.xyz_m - block.true_points.xyz_m
    C = done.points.covariance_m2
    known = np.isfinite(off).all(axis=1) & np.isfinite(C).all(axis=(1, 2))
    assert np.sqrt(np.einsum("nii->n", C[known])).max() > 1.0
    square = np.einsum("ni,ni->n", off[known], np.linalg.solve(C[known], off[known][..., None])[..., 0])
    assert square.max() < chi2.isf(1e-4 / known.sum(), 3)


def test_a_single_position_places_no_strip() -> None:
    """Then more is open than any bundle could begin from."""
    block, _, strips = apart(0)
    lone = replace(block, exterior=block.exterior.take(np.array([0, 3])))
    with pytest.raises(GeometryError, match="not determined"):
        similarity(lone, strips, affine(lone))


@pytest.mark.slow
def test_a_ray_of_one_image_to_control_holds_a_strip_whose_control_is_on_a_line(tmp_path: Path) -> None:
    """Three points on a line, and a fourth that one image alone shows, which no strip can hold."""
    of = hand()
    on_line, single = [0, 4], IN_NO_STRIP
    stays = (of.point != single) | (of.image == 1)
    xy = of.xy_mm[stays].copy()
    some = replace(of, image=of.image[stays], point=of.point[stays], xy_mm=xy)
    for known, holds in (([*on_line, single], True), (on_line, False)):
        block, points = read(tmp_path / str(holds), some, ground=ground_rows(of, known), xy_mm=xy)
        strips = scale_transfer(block, dependent(block, points))
        if not holds:
            with pytest.raises(GeometryError, match="rotation about the line"):
                similarity(block, strips, points)
            continue
        initial = similarity(block, strips, points)
        done = bundle(block, points, initial)
        np.testing.assert_allclose(done.images.position_m, of.position_m, atol=0.5)


def test_a_strip_with_two_control_points_is_tied_by_points_nearly_on_a_line_which_leave_none_of_its_turn_open() -> None:
    """Nine common points within 3 m of a line 390 m from the far edges; by itself the strip turns about another."""
    made = MadeBlock(2, 5)
    row, k = np.arange(len(made.truth)) % 8, np.arange(9)  # of eight rows the third to fifth are common
    made.truth[row == 3, 1:] = ORIGIN_M[1:] + [205.0, 0.0] + 3.0 * np.column_stack([np.cos(2 * k), np.sin(2 * k)])
    made._measure()
    made._strips(np.random.default_rng(2), None, 0.0)
    made.strip_points = [(s, p, x) for s, p, x in made.strip_points if row[p] != (4, 2)[s]]
    made.control([p for p in range(len(row)) if row[p] in (0, 1, 7) and p // 8 in (0, 8)])
    told = Told()
    solution = similarity(made.block(), made.strips(), made.image_points(), context=told)
    assert not told.warnings
    np.testing.assert_allclose(solution.images.position_m, made.truth_X0, atol=1e-3)


def test_positions_of_the_images_before_do_not_keep_a_strip_from_its_control() -> None:
    """Five positions that are a base or two off beside six control points: no deformation explains all of them."""
    made, images, told = MadeBlock(1, 10, noise_m=0.02), np.array([2, 3, 4, 6, 8]), Told()
    made.control([*made.corners(), 30, 50], sigma_m=0.05)
    made.positions(images.tolist(), error_m=np.roll(made.truth_X0, 1, axis=0) - made.truth_X0)
    solution = similarity(made.block(), made.strips(), made.image_points(), context=told)
    np.testing.assert_allclose(solution.images.position_m, made.truth_X0, atol=0.1)  # 5 sigma of the strip's points
    (text,) = [text for text in told.warnings if "contradict all else" in text]
    assert "observed positions: 5 of 5" in text
