"""An image whose points err by more than others' is told from gross errors, from small images and from chance.

One of which a search has rejected most image points may be wrong as a whole.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.adjustment.statistics.class_scales import ClassScales
from aatri.adjustment.statistics.long_tails import Tail
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.fitted_sigmas import FittedSigmas
from aatri.orientation.bundle.blunders.noisy_images import noisiest_images
from aatri.orientation.bundle.blunders.robust import AdjustOptions
from aatri.orientation.bundle.blunders.scaling import Classes, Scaling
from aatri.orientation.bundle.blunders.search import search
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.groups.failed_search import mostly_rejected_images
from aatri.orientation.bundle.groups.limits import MOST_RAYS_TRIED
from aatri.orientation.bundle.result import BundleResult
from tests.orientation.bundle.made_bundle import made_bundle
from tests.orientation.bundle.parts import Parts, settings

IMAGE = 1


def _least_squares(block: BundleInput, _: AdjustOptions) -> BundleResult:
    return adjust_bundle(block, settings(datum="free"))


def _with_noise(size: float, seed: int, points: int = 100) -> Parts:
    """So many points of one image err by more, by the square of sizes that add; others of it are left out."""
    parts = made_bundle()
    rays, rng = parts.rays, np.random.default_rng(seed)
    of_image = np.flatnonzero(rays.image == IMAGE)
    xy_mm, active = rays.xy_mm.copy(), rays.active.copy()
    xy_mm[of_image] += np.sqrt(size**2 - 1.0) * rays.sigma_mm[of_image] * rng.normal(size=(len(of_image), 2))
    active[of_image[points:]] = False
    return replace(parts, rays=replace(rays, xy_mm=xy_mm, active=active))


def _factors(parts: Parts) -> dict[str, float]:
    done = search(parts.together(), _least_squares, SearchOptions(), 1e-3)
    texts = [note.text for note in done.notes if ": its errors are " in note.text]
    return {text.split(": its")[0]: float(text.split("errors are ")[1].split()[0]) for text in texts}


@pytest.mark.slow
def test_a_noisy_image_is_told_with_the_size_of_its_errors() -> None:
    factors = [_factors(_with_noise(6.0, seed)) for seed in range(8)]
    assert all(len(one) == 1 and next(iter(one)).endswith(f"of image i{IMAGE}") for one in factors)
    # each is known to some 1 / sqrt(2 * 40), eight to a third of it
    assert np.mean([next(iter(one.values())) for one in factors]) == pytest.approx(6.0, rel=0.15)


def test_an_image_within_the_usual_qualities_and_one_of_few_points_are_weighted_like_others() -> None:
    assert _factors(_with_noise(1.6, 1)) == {}
    assert _factors(_with_noise(6.0, 1, points=7)) == {}


def test_clean_images_and_wrong_numbers_are_no_noise() -> None:
    parts = made_bundle()
    result = _least_squares(parts.together(), AdjustOptions())
    number = Scaling.of(parts.together()).classes.number
    assert not len(noisiest_images(result, None, number, ()))
    assert _factors(_with_noise(1.0, 0)) == {}


def test_an_image_apart_is_no_part_of_a_noisy_strip() -> None:
    """Five of six images of a strip err, one of them in a class of its own: the strip's class is the others'."""
    parts, noisy = made_bundle(), np.arange(1, 6)
    rays, rng, n = parts.rays, np.random.default_rng(3), len(parts.image_ids)
    size = np.where(np.isin(rays.image, noisy), 6.0, 0.0)[:, None] * rays.sigma_mm
    block = replace(parts, rays=replace(rays, xy_mm=rays.xy_mm + size * rng.normal(size=size.shape))).together()
    strip = np.where(np.arange(n) < 6, "s", [f"other {k}" for k in range(n)])
    classes = Scaling.of(block).classes
    number = classes.with_images(block.observed, np.array([1]), "image 1").number
    result = _least_squares(block, AdjustOptions())
    assert 1 not in noisiest_images(result, None, number, ((1,),), strip)


def test_classes_of_an_image_are_parts_of_the_class_of_their_points() -> None:
    block = made_bundle().together()
    scaling = Scaling.of(block)
    apart, factor = scaling.with_images(block.observed, np.array([IMAGE]), "image a of image b")
    assert apart.classes.names == (*scaling.classes.names, f"{scaling.classes.names[0]} of image a of image b")
    assert apart.classes.base.tolist() == [*range(len(scaling.factor)), 0]
    assert factor.tolist() == [1.0] * len(scaling.factor) + [10.0]


@pytest.mark.parametrize("method", ["data_snooping", "robust_snooping"])
def test_some_wrong_points_of_an_image_are_no_noise(method: str) -> None:
    """Three of its 23 points by 40 standard deviations: they go, the image keeps its standard deviations."""
    parts = made_bundle()
    rows = np.flatnonzero(parts.rays.image == IMAGE)[:3]
    xy_mm = parts.rays.xy_mm.copy()
    xy_mm[rows] += 40.0 * parts.rays.sigma_mm[rows] * np.random.default_rng(3).choice([-1.0, 1.0], (3, 2))
    block = replace(parts, rays=replace(parts.rays, xy_mm=xy_mm)).together()
    done = search(block, _least_squares, SearchOptions(method=method), 1e-3)
    assert not [note.text for note in done.notes if ": its errors are " in note.text]
    (rays,) = [o for o in done.result.observations if o.observed.kind == "image_point"]
    assert set(rows.tolist()) <= set(np.flatnonzero(~rays.used).tolist())


LONG = Tail(freedom=4.0, limit=20.0)


def test_a_residual_that_is_none_leaves_its_class_the_tail(monkeypatch: pytest.MonkeyPatch) -> None:
    block = made_bundle().together()
    search, result = FittedSigmas(block, _least_squares, SearchOptions(), 1e-3), _least_squares(block, AdjustOptions())
    v, r, group = search.scaling.classes.residuals(result, None)
    with_nan = np.where(np.arange(len(v)) == np.flatnonzero(group == 0)[0], np.nan, 3.0 * v)
    monkeypatch.setattr(Classes, "residuals", lambda *_: (with_nan, r, group))
    n = len(search.scaling.factor)
    search.scaling, search.tails = replace(search.scaling, factor=np.full(n, 2.0)), (LONG,) * n
    assert search._factors_of_tails(result)[0] == pytest.approx(3.0 * result.adjusted.sigma0, rel=0.05)


def test_tails_of_other_classes_than_there_are_count_for_nothing() -> None:
    """They are told after the last class of an image is made; one that came later would have had another's."""
    block = _with_noise(6.0, 1).together()
    search, result = FittedSigmas(block, _least_squares, SearchOptions(), 1e-3), _least_squares(block, AdjustOptions())
    search.tails = (LONG,) * len(search.scaling.factor)
    assert search._takes_image_apart(result, None)
    np.testing.assert_array_equal(search._factors_of_tails(result), np.ones(len(search.scaling.factor)))
    search._tails(result, anew=False)
    assert len(search.tails) == len(search.scaling.factor)


@pytest.mark.parametrize(("of_most", "of_others"), [(1.9, 3.0), (2.1, 1.0), (0.53, 3.0), (0.48, 1.0)])
def test_standard_deviations_of_most_that_are_twice_or_half_of_what_fits_are_set_right_first(
    of_most: float, of_others: float
) -> None:
    """Residuals of positions beside them have the errors of image points: what they ask for waits."""
    classes = Classes(("image_point", "position"), np.arange(2), ())
    scales = ClassScales(np.array([of_most, 3.0]), np.array([900.0, 90.0]), np.array([True, True]))
    search: Any = SimpleNamespace(scaling=Scaling(classes, np.ones(2)))
    assert FittedSigmas._scaling_after(search, scales, None)[1].tolist() == [of_most, of_others]


# Images of which a search has rejected most image points: one may be wrong as a whole, and bends the rest.


@pytest.mark.parametrize(("sigma0", "redundancy", "images"), [(1.0, 500, []), (1.3, 4, []), (1.5, 500, [2])])
def test_they_are_named_where_the_rest_does_not_fit(sigma0: float, redundancy: int, images: list[int]) -> None:
    """Four images of ten points: of the third seven are rejected, of the fourth five, and one was never in use."""
    image = np.repeat(np.arange(4), 10)
    active = np.ones(40, dtype=bool)
    active[0] = False
    used = active.copy()
    used[20:27] = used[30:35] = False
    rays: Any = SimpleNamespace(image=image, active=active)
    adjusted = SimpleNamespace(sigma0=sigma0, redundancy=redundancy)
    result: Any = SimpleNamespace(adjusted=adjusted, ray_used=used, image_adjusted=np.ones(4, dtype=bool))
    assert mostly_rejected_images(rays, result) == images


def test_images_without_a_start_and_those_of_large_blocks_are_not_asked_and_the_worst_comes_first() -> None:
    image = np.repeat(np.arange(4), 10)
    used = np.ones(40, dtype=bool)
    used[:10] = used[10:16] = used[20:28] = False  # none, four, two of ten, all
    adjusted = SimpleNamespace(sigma0=1.5, redundancy=500)
    oriented = np.array([False, True, True, True])
    result: Any = SimpleNamespace(adjusted=adjusted, ray_used=used, image_adjusted=oriented)
    rays: Any = SimpleNamespace(image=image, active=np.ones(40, dtype=bool))
    assert mostly_rejected_images(rays, result) == [2, 1]
    many = np.tile(image, MOST_RAYS_TRIED // 40 + 1)
    large: Any = SimpleNamespace(image=many, active=np.ones(len(many), dtype=bool))
    assert mostly_rejected_images(large, result) == []
