"""A search for gross errors that fails: a block that fits as a whole is not lost, another is refused."""

from __future__ import annotations

import tracemalloc
import weakref
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.openness.open_directions import OpenCombination, OpenError
from aatri.adjustment.records import whitened_residuals
from aatri.adjustment.statistics.class_scales import ClassScales
from aatri.arrays import Float
from aatri.errors import ConvergenceError, GeometryError
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import POINT, POSE, Poses
from aatri.orientation.bundle import adjust, from_afar
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders import exact_coordinates, robust_start, tested_block
from aatri.orientation.bundle.blunders.earlier_rejections import failing_once
from aatri.orientation.bundle.blunders.robust import AdjustOptions, robust_from_start
from aatri.orientation.bundle.blunders.robust_start import RobustStart
from aatri.orientation.bundle.blunders.scaling import Classes, Scaling
from aatri.orientation.bundle.blunders.search import search
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.groups.failed_search import searched_again
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import AdjustedBlock
from aatri.orientation.bundle.settings import BundleSettings
from aatri.orientation.bundle.space_start import images_turned_over
from tests.orientation.bodies.made_body import CORNERS, HEIGHT, MadeBody
from tests.orientation.bundle.made_bundle import made_bundle
from tests.orientation.bundle.parts import Parts, settings


@dataclass(frozen=True)
class Observing:
    """A block of which only the observations matter."""

    observed: tuple[bool, ...]


FAILURE = ConvergenceError("no convergence in 60 iterations")


def least_squares(block: BundleInput, _: AdjustOptions) -> BundleResult:
    return adjust.adjust_bundle(block, settings(datum="free"))


def without_search(block: BundleInput, adjusted: Any) -> AdjustedBlock:
    """What is left where the search fails whatever is left out."""

    def failing(_: BundleInput) -> Any:
        raise FAILURE

    return searched_again(block, failing, adjusted, FAILURE)[0]


def test_all_observations_are_used_where_they_fit_and_the_failure_is_a_warning() -> None:
    parts = made_bundle()
    done = without_search(parts.together(), least_squares)
    assert done.result.adjusted.redundancy == 2 * len(parts.rays.image) - 6 * 6 - 3 * 30 + 7
    assert [(note.level, FAILURE.what in note.text) for note in done.notes] == [("warning", True)]


def test_an_adjustment_that_has_failed_is_not_made_again() -> None:
    """To its end a coarse one fails too; another block or other weights may not."""
    calls: list[AdjustOptions] = []

    def adjusted(block: BundleInput, adjusting: AdjustOptions) -> BundleResult:
        calls.append(adjusting)
        raise FAILURE

    block, other = made_bundle().together(), made_bundle().together()
    adjust_once, coarse = failing_once(adjusted), AdjustOptions(coarse=True)
    ends = [
        (block, coarse),
        (block, coarse),
        (block, AdjustOptions()),
        (block, AdjustOptions(huber=2.0)),
        (other, coarse),
    ]
    for inputs, adjusting in ends:
        with pytest.raises(ConvergenceError, match="60 iterations"):
            adjust_once(inputs, adjusting)
    assert calls == [coarse, AdjustOptions(huber=2.0), coarse]


def test_least_squares_that_are_open_at_a_rough_state_are_tried_to_their_end() -> None:
    """What is open there may be determined at the end: the result of a failed search is not given up for it."""
    parts = made_bundle()

    def adjusted(block: BundleInput, adjusting: AdjustOptions) -> BundleResult:
        if adjusting.coarse:
            raise GeometryError("the observations leave 1 unknown open")
        return least_squares(block, adjusting)

    adjust_once, block = failing_once(adjusted), parts.together()
    with pytest.raises(GeometryError):
        adjust_once(block, AdjustOptions(coarse=True))
    assert without_search(block, adjust_once).result.adjusted.sigma0 < 1.2


def test_what_a_second_start_leaves_open_of_most_images_too_is_tried_no_further(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two control points and rough positions of a telephone: each adjustment after the second said the same."""
    tilt = OpenCombination("rotation about X of the whole block", frozenset({"tilt"}), True)
    weak_image = OpenCombination("X0 of image 1", unknowns=(("X0", POSE),), counts=(1,))
    heights = OpenCombination("Z0 of 3 with c", unknowns=(("Z0", POSE), ("c", "camera")), counts=(3, 1))
    starts = []

    def adjustments(*combinations: OpenCombination) -> int:
        def adjusted(*_: Any, **__: Any) -> Any:
            starts.append(1)
            raise OpenError("no convergence", remedy="", combinations=combinations)

        starts.clear()
        monkeypatch.setattr(from_afar, "adjust_bundle", adjusted)
        monkeypatch.setattr(from_afar, "start_in_space", lambda inputs, *_: inputs)
        monkeypatch.setattr(from_afar, "_are_alike", lambda *_: False)
        monkeypatch.setattr(from_afar, "has_shapes", lambda _: False)
        inputs: Any = SimpleNamespace(rays=(), observed=(), image_ids=["1", "2", "3", "4"])
        with pytest.raises(GeometryError, match="no convergence"):
            from_afar.adjust_bundle_from_afar(inputs, BundleSettings())
        return len(starts)

    assert adjustments(tilt) == adjustments(heights) == 2
    assert adjustments(tilt, weak_image) == adjustments(weak_image) == 5


def test_the_failure_stands_where_the_observations_do_not_fit() -> None:
    parts = made_bundle()
    with pytest.raises(ConvergenceError, match="60 iterations"):
        without_search(_wrong(parts).together(), least_squares)


def test_what_an_adjustment_loses_with_its_point_keeps_its_weight() -> None:
    """A point far off its rays has hardly a weight, and may not be solved: with full weights it would come back."""
    parts = made_bundle()
    rows = parts.rays.point == 3
    weights = list[Float]()

    def losing(block: BundleInput, options: AdjustOptions) -> BundleResult:
        result = least_squares(block, options)
        place = [o.observed.kind for o in result.observations].index("image_point")
        weights.append(options.weights[place])
        lost = (replace(o, used=o.used & ~rows) if k == place else o for k, o in enumerate(result.observations))
        return replace(result, observations=tuple(lost))

    xyz_m = parts.xyz_m + np.where(np.arange(len(parts.xyz_m)) == 3, 500.0, 0.0)[:, None]
    robust_from_start(replace(parts, xyz_m=xyz_m).together(), losing)
    assert len(weights) > 2
    assert 0 < weights[0][rows].max() < 1e-3
    for again in weights[1:]:
        np.testing.assert_array_equal(again[rows], weights[0][rows])


@pytest.mark.parametrize("share", [1.0, 0.2, 0.05])
def test_a_robust_start_comes_to_what_agrees_where_standard_deviations_are_small(share: float) -> None:
    """A start off by hundreds of them, and one ray of a point that stands near the horizon of its image."""
    parts = made_bundle(start_error=20.0)
    last = len(parts.rays.image) - 1
    seen = np.flatnonzero(parts.rays.point == parts.rays.point[last])
    assert len(seen) > 2
    xy_mm = parts.rays.xy_mm.copy()
    xy_mm[last] += [1500.0, 300.0]
    rays = replace(parts.rays, xy_mm=xy_mm, sigma_mm=share * parts.rays.sigma_mm)

    def weighted(block: BundleInput, options: AdjustOptions) -> BundleResult:
        return adjust.adjust_bundle(block, settings(datum="free", weights=options.weights))

    result = robust_from_start(replace(parts, rays=rays).together(), weighted)
    (observed,) = (o.observed for o in result.observations if o.observed.kind == "image_point")
    v = np.abs(whitened_residuals(observed.records, result.adjusted.state, np.arange(last)))
    # two-sided, the largest of so many normal errors is beyond it in one of 1,000 blocks
    assert v.max() < stats.norm.isf(1e-3 / (2 * v.size)) / share


def _wrong(parts: Parts) -> Parts:
    """One image point off by 100 standard deviations."""
    xy_mm = parts.rays.xy_mm.copy()
    xy_mm[0, 0] += 100 * parts.rays.sigma_mm[0, 0]
    return replace(parts, rays=replace(parts.rays, xy_mm=xy_mm))


def test_a_block_without_exact_coordinates_is_not_prepared_for_their_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exact_coordinates, "from_result", None)  # nothing calls it
    parts = _wrong(made_bundle())
    done = search(parts.together(), least_squares, SearchOptions(limit=5.0), 1e-3)
    (rays,) = (o for o in done.result.observations if o.observed.kind == "image_point")
    assert np.flatnonzero(~rays.used).tolist() == [0]


def test_the_least_squares_that_a_search_begins_with_is_not_in_memory_beside_the_next() -> None:
    block = made_bundle().together()
    begin = [least_squares(block, AdjustOptions())]
    first, in_memory = weakref.ref(begin[0]), []

    def adjusted(values: BundleInput, options: AdjustOptions) -> BundleResult:
        in_memory.append(first() is not None)
        return least_squares(values, options)

    search(block, adjusted, SearchOptions(limit=5.0), 0.0, begin)  # adjusted again, as no decrement is zero
    assert in_memory == [False]


def test_of_three_adjustments_of_a_search_the_last_alone_is_in_memory_beside_the_next() -> None:
    """Three wrong image points of one image, which go one after the other; before, a trial of its noise."""
    parts = made_bundle()
    xy_mm, made, in_memory = parts.rays.xy_mm.copy(), list[weakref.ref[BundleResult]](), list[list[int]]()
    rows = np.flatnonzero(parts.rays.image == 0)[:3]
    xy_mm[rows, 0] += np.array([100.0, 60.0, 30.0]) * parts.rays.sigma_mm[rows, 0]
    block = replace(parts, rays=replace(parts.rays, xy_mm=xy_mm)).together()

    def adjusted(values: BundleInput, options: AdjustOptions) -> BundleResult:
        in_memory.append([k for k, result in enumerate(made) if result() is not None])
        result = least_squares(values, options)
        made.append(weakref.ref(result))
        return result

    search(block, adjusted, SearchOptions(method="data_snooping", limit=5.0), 1e-3)
    assert in_memory == [[], [0], [0], [2]]


def test_a_ray_that_is_out_and_fits_wherever_it_is_has_no_test_control_has_one() -> None:
    """Predicted to 2, and to 100 times the standard deviation of the observation."""
    used, inflated = np.array([True, True, False, False]), np.array([0.1, 0.1, 4.0, 1e4])
    (control,) = MadeBody(CORNERS).control(range(4), [HEIGHT] * 4, 0.1).observed
    covariance = inflated[:, None, None] * np.eye(3)
    observations = AdjustedObservations(control.without(~used), np.arange(4), used, covariance)
    tests = tested_block.tests_of(observations, {POINT: CORNERS + np.array([0.0, 0.0, 1.0])})
    np.testing.assert_allclose(tests, [10 / 0.9**0.5, 10 / 0.9**0.5, 10 / 5**0.5, 10 / 10001**0.5])
    result = least_squares(made_bundle().together(), AdjustOptions())
    (rays,) = (o for o in result.observations if o.observed.kind == "image_point")
    observed = rays.observed.without(np.arange(len(rays.observed)) < 2)
    covariance = np.where(np.arange(len(observed)) == 0, 4.0, 1e4)[:, None, None] * np.eye(2)
    out = AdjustedObservations(observed, np.arange(2), np.zeros(len(observed), dtype=bool), covariance)
    assert np.isfinite(tested_block.tests_of(out, result.adjusted.state)[:2]).tolist() == [True, False]


@pytest.mark.parametrize(("off", "begins_anew"), [(3.0, False), (200.0, True)])
def test_covariances_beside_a_robust_adjustment_are_without_what_is_very_far_off(
    off: float, begins_anew: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two control points with each other's coordinates had led least squares astray, and right positions went."""
    test = np.array([off, 1.0, 0.5])
    monkeypatch.setattr(robust_start, "from_result", lambda block, _: block)
    search = SimpleNamespace(
        options=SearchOptions(limit=4.0),
        block=Observing(()),
        all=SimpleNamespace(without=lambda _, used: tuple(used.tolist())),
        adjust=lambda block, _: block.observed,
        _robust_tests=lambda *_: test,
    )
    tested = SimpleNamespace(result="with everything")
    beside = RobustStart._least_squares_beside(search, None, tested, np.ones(3, dtype=bool))  # type: ignore[arg-type]
    assert beside == ((False, True, True) if begins_anew else "with everything")


def test_plan_and_height_of_few_control_points_tell_their_scale_together() -> None:
    """Plan with a redundancy of 3.5 has a scale of its own that nobody would believe; that of both is asked for."""
    classes = Classes(("image_point", "control plan", "control height", "position"), np.array([0, 1, 1, 2]), ())
    scales = ClassScales(
        np.array([1.0, 2.6, 1.0, 1.0]), np.array([190.0, 3.5, 1.3, 14.0]), np.array([True, True, False, True])
    )
    assert classes.in_small_kinds(scales).tolist() == [False, True, True, False]


def test_a_class_that_goes_back_to_its_standard_deviations_has_those_given() -> None:
    """Not a factor of 1 - 1e-16, which would be told as a change."""
    names = ("image_point", "position")
    larger = Scaling(Classes(names, np.arange(2), ()), np.array([1.0, 49.0]))
    back = ClassScales(np.array([1.0, 1.0 / 49.2]), np.array([900.0, 90.0]), np.array([True, True]))
    after, factor = larger.after(back)
    assert 49.0 * (1.0 / 49.0) != 1.0
    assert not after.changed.any()
    assert after.notes(of_result=True) == []
    np.testing.assert_allclose(factor, [1.0, 1.0 / 49.0], rtol=1e-15)


def test_images_turned_over_are_told_of_very_many_rays_in_little_memory() -> None:
    """Image 1 has 60 % of its 100,000 points behind it, but half of these are not in use: 43 %."""
    row, none, xyz = np.arange(200_000, dtype=np.int32), np.zeros((200_000, 2)), np.array([[0, 0, -1.0], [0, 0, 1]])
    behind, used = (row % 2 == 1) & (row // 2 % 10 < 6), (row % 2 == 0) | (row // 2 % 10 > 2)
    rays = ImagePointRows(row % 2, behind.astype(np.int32), none, none, none[:, 0], none, behind)
    poses = Poses(np.zeros((2, 3)), np.stack([np.eye(3)] * 2))
    tracemalloc.start()
    assert images_turned_over(rays, poses, xyz).tolist() == [False, True]
    assert not images_turned_over(rays, poses, xyz, used).any()
    assert tracemalloc.get_traced_memory()[1] < 10 * len(row)  # an axis and two positions of each are 72 bytes
