"""A search that fails is made again without points whose rays are those of two."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.adjustment.openness.open_directions import OpenCombination, OpenError
from aatri.errors import ConvergenceError
from aatri.observations.control import Control
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import FILM, POSE
from aatri.orientation.bundle import complete_start
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders import points
from aatri.orientation.bundle.blunders.robust import AdjustOptions
from aatri.orientation.bundle.groups.failed_search import (
    searched_again,
    without_far_points,
    without_scattered_points,
    without_wrong_image,
)
from aatri.orientation.bundle.result import BundleResult, distance_tests
from aatri.orientation.bundle.rounds import AdjustedBlock
from aatri.stages.bundle_adjustment.bundle import bundle
from tests.orientation.bundle.made_bundle import made_bundle
from tests.orientation.bundle.parts import settings
from tests.stages.chain import run_chain, simulated


def _least_squares(block: BundleInput, _: AdjustOptions) -> BundleResult:
    return adjust_bundle(block, settings(datum="free"))


def test_rays_of_two_points_with_one_number_begin_as_rejected() -> None:
    parts, failure, out = made_bundle(), ConvergenceError("no convergence"), list[int]()
    rays = parts.rays
    of_point = np.flatnonzero(rays.point == 5)
    xy_mm = rays.xy_mm.copy()
    xy_mm[of_point[:2]] += 40.0
    block = replace(parts, rays=replace(rays, xy_mm=xy_mm)).together()

    def searching(inputs: BundleInput) -> Any:
        (of_rays,) = [o for o in inputs.observed if o.kind == "image_point"]
        out.extend(np.flatnonzero(~of_rays.records.active).tolist())
        return _least_squares(inputs, AdjustOptions()), ()

    result, _ = searched_again(block, searching, _least_squares, failure)
    assert out == of_point.tolist()
    assert result.adjusted.sigma0 < 1.3
    clean = parts.together()
    assert without_scattered_points(clean) is clean


@pytest.mark.slow
def test_an_image_whose_points_have_others_numbers_is_the_one_without_which_a_small_block_fits() -> None:
    """One of five images of a real block: sigma0 was 1,740, and the run ended without a word of it."""
    parts, out = made_bundle(), list[int]()
    rays = parts.rays
    of_image = np.flatnonzero(rays.image == 2)
    xy_mm = rays.xy_mm.copy()
    xy_mm[of_image] = np.roll(xy_mm[of_image], 1, axis=0)
    block = replace(parts, rays=replace(rays, xy_mm=xy_mm)).together()

    def searching(inputs: BundleInput) -> Any:
        (of_rays,) = [o for o in inputs.observed if o.kind == "image_point"]
        out.extend(np.flatnonzero(~of_rays.records.active).tolist())
        return AdjustedBlock(inputs, _least_squares(inputs, AdjustOptions())), ()

    done = without_wrong_image(block, searching, _least_squares)
    assert done is not None
    assert done[0].result.adjusted.sigma0 < 1.3
    assert out == of_image.tolist()
    assert without_wrong_image(parts.together(), searching, _least_squares) is None


def test_a_search_that_points_at_infinity_break_is_made_without_them_and_they_come_back() -> None:
    """49 real images with a horizon: a gross error was `no convergence`, smaller ones were not looked for."""
    parts, failure = made_bundle(start_error=0.0), ConvergenceError("no convergence")
    rays, xy_mm = parts.rays, parts.rays.xy_mm.copy()
    far = rays.point == 5
    u = np.einsum("nji,j->ni", parts.poses.ground_from_image[rays.image[far]], [0.1, -0.2, -1.0])
    xy_mm[far] = -rays.c_mm[far, None] * u[:, :2] / u[:, 2:]
    xy_mm[far] += np.random.default_rng(3).normal(scale=0.01, size=(int(far.sum()), 2))

    def least_squares(inputs: BundleInput, _: AdjustOptions) -> BundleResult:
        return adjust_bundle(inputs, settings(datum="minimal"))

    def searching(inputs: BundleInput) -> Any:
        (of_rays,) = [o for o in inputs.observed if o.kind == "image_point"]
        if of_rays.records.active[far].any():
            raise failure
        return AdjustedBlock(inputs, least_squares(inputs, AdjustOptions())), ()

    block = replace(parts, rays=replace(rays, xy_mm=xy_mm)).together()
    done, _ = searched_again(block, searching, least_squares, failure)
    assert done.result.ray_used.all()
    (note,) = done.notes
    assert note.ids == (str(block.point_ids[5]),)


def test_exact_control_is_not_at_infinity_where_a_search_fails() -> None:
    """It has no standard deviation in any direction, and so no test of its distance."""
    parts = made_bundle(start_error=0.0)
    rows, C = np.arange(4, dtype=np.int32), np.zeros((4, 3, 3))
    control = Control(rows, rows, parts.xyz_m[:4], C, np.zeros((4, 3), dtype=bool), np.ones((4, 3), dtype=bool))
    block = replace(parts, control=control).together()
    result = adjust_bundle(block, settings())
    assert np.isnan(distance_tests(result, block.rays)[1][:4]).all()  # type: ignore[arg-type]
    assert without_far_points(block, result, lambda _: pytest.fail("searched"), _least_squares) is None


@pytest.mark.parametrize("is_held", [False, True])
def test_an_image_that_is_left_out_whatever_is_left_out_on_trial_is_the_one(is_held: bool) -> None:
    """With three points on the danger cylinder it was open on the way, and the block of five images lost.

    A position and an attitude adjust an image that has no rays in use, and nothing else tells of it.
    """
    block, images_in_use = made_bundle().together(), list[Any]()

    def adjusting(inputs: BundleInput, _: AdjustOptions) -> Any:
        (of_rays,) = [o for o in inputs.observed if o.kind == "image_point"]
        used = of_rays.records.active & (dict(of_rays.records.touches)[POSE] != 2)
        return SimpleNamespace(adjusted=SimpleNamespace(redundancy=9, sigma0=1.0), ray_used=used)

    def searching(inputs: BundleInput) -> Any:
        used = adjusting(inputs, AdjustOptions()).ray_used
        images_in_use.append(np.unique(dict(inputs.observed[0].records.touches)[POSE][used]).tolist())
        image_adjusted = np.isin(np.arange(6), images_in_use[0]) | is_held
        return AdjustedBlock(inputs, SimpleNamespace(image_adjusted=image_adjusted)), ()  # type: ignore[arg-type]

    done = without_wrong_image(block, searching, adjusting)
    assert images_in_use == [[0, 1, 3, 4, 5]]
    assert done is not None
    assert [note.ids for note in done[0].notes] == [("i2",)] * is_held


COMBINATIONS = {
    "whole": OpenCombination("scale", of_whole=True),
    "most images": OpenCombination(
        "Z0 of image i1 and 4 more", unknowns=(("Z0", POSE), ("c", "camera")), counts=(5, 1)
    ),
    "an image": OpenCombination("Z0 of image i1", unknowns=(("Z0", POSE), ("c", "camera")), counts=(1, 1)),
    "what images share": OpenCombination("c with k1", unknowns=(("c", "camera"), ("k1", "camera")), counts=(1, 1)),
    "film of an image": OpenCombination("film of image i1", unknowns=(("a1", FILM),), counts=(1,)),
    "film and camera": OpenCombination("a1 with c", unknowns=(("a1", FILM), ("c", "camera")), counts=(1, 1)),
}
OF_AN_IMAGE = ("an image", "film of an image", "film and camera")


@pytest.mark.parametrize(("what", "exact"), [("whole", False), *((what, True) for what in COMBINATIONS)])
def test_no_image_is_left_out_on_trial_where_all_of_them_are_open(what: str, exact: bool) -> None:
    failure, adjusted = OpenError("open", combinations=[COMBINATIONS[what]], exact=exact), list[BundleInput]()

    def failing(block: BundleInput, *_: Any) -> Any:
        adjusted.append(block)
        raise failure

    parts, free, zero = made_bundle(), np.ones((6, 1), dtype=bool), np.zeros((6, 1))
    shape, rays = (np.zeros((6, 1, 1)), ~free), np.zeros((len(parts.rays.image), 2, 1))
    film = ParameterRows(
        FILM, parts.image_ids, ("a1",), zero, free, zero, *shape, parts.rays.image, rays, per_image=True
    )
    with pytest.raises(OpenError):
        searched_again(replace(parts, parameters=(film,)).together(), failing, failing, failure)
    assert len(adjusted) == (1 if exact and what not in OF_AN_IMAGE else 1 + 6)


# What is wrong at points does not depend on how many of them are looked at together.


@pytest.mark.slow
def test_few_points_at_a_time_give_the_same_rejections(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {"image_points": 0.03, "size_sigmas": [10, 200]}
    flight, ties = {"strips": 2, "images_per_strip": 5}, {"new_points": 150}
    chain = run_chain(simulated(3, preset="rc30", flight=flight, ties=ties, gross_errors=errors))
    together = bundle(chain.block, chain.refined, chain.strip_block)
    monkeypatch.setattr(points, "AT_ONCE", 30)
    monkeypatch.setattr(complete_start, "AT_ONCE", 50)
    in_pieces = bundle(chain.block, chain.refined, chain.strip_block)
    assert together.suspects.staying_out.sum() > 5
    assert in_pieces.suspects.verdict.tolist() == together.suspects.verdict.tolist()
    np.testing.assert_allclose(in_pieces.points.xyz_m, together.points.xyz_m, atol=1e-8)
