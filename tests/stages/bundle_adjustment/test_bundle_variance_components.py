"""Variance components of a block: factors on standard deviations that are wrong are found, and nothing else is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source, variance_groups
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment._variance_components import VarianceComponentOptions
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.campaigns.variance_components import TRUE, disturbed, error_free
from tests.small_blocks import adjusted_by, flown
from tests.stages.hand_block import ground_rows, hand, read, start


@pytest.fixture(scope="module")
def blocks() -> tuple[Block, Block]:
    made = error_free()
    return made, disturbed(made, np.random.default_rng(5))


def _adjusted(block: Block, apply: bool, levels: tuple[str, ...] = ("camera",)) -> Solution:
    points = calibrated(block)
    options = BundleOptions(variance_components=VarianceComponentOptions(groups=levels, apply=apply))  # type: ignore[arg-type]
    return bundle(block, points, options=options)


@pytest.fixture(scope="module")
def applied(blocks: tuple[Block, Block]) -> Solution:
    return _adjusted(blocks[1], apply=True)


@pytest.mark.slow
def test_made_up_observations_without_residuals_keep_their_standard_deviations(blocks: tuple[Block, Block]) -> None:
    components = _adjusted(blocks[0], apply=True).variance_components
    assert components is not None
    assert (components.factor == 1.0).all()
    assert set(components.verdict.tolist()) == {"not estimable"}


def test_the_factors_put_in_are_found_within_their_limits(applied: Solution) -> None:
    c = applied.variance_components
    assert c is not None
    assert sorted(c.group.tolist()) == sorted(TRUE)
    assert (c.redundancy >= 30).all()
    for name, low, high in zip(c.group, c.low, c.high):
        # 99.9 % limits, about 1.7 times as wide as those of 95 %: one sample of six groups
        middle = np.sqrt(low * high)
        assert low * (low / middle) < TRUE[str(name)] < high * (high / middle), name


def test_with_them_every_group_fits_and_sigma0_is_one(applied: Solution) -> None:
    assert applied.sigma0 == pytest.approx(1.0, abs=0.01)
    r = applied.residuals
    sigma = r.sigma[(r.kind == "distance") & r.active][:, 0]
    c = applied.variance_components
    assert c is not None
    np.testing.assert_allclose(sigma, 0.01 * c.factor[c.group == "distance"].item(), rtol=1e-9)


def test_rays_of_a_flight_are_a_group_and_those_of_images_without_one_are_together(tmp_path: Path) -> None:
    of = hand()
    block, points = read(tmp_path, of, ground=ground_rows(of, (0, 5, 24, 29)))
    block = replace(block, images=replace(block.images, flight=np.array(["a", "a", "", "", "b", ""])))
    inputs = bundle_input(observation_source(block, points, start(of, block)), BundleOptions())
    groups = variance_groups(block, inputs, ("flight",))
    (k,) = (k for k, o in enumerate(inputs.observed) if o.kind == "image_point")
    names = np.array(groups.names)[groups.number[k]]
    wanted = np.array(["", " flight a", " flight b"])[np.array([1, 1, 0, 0, 2, 0])[of.image]]
    assert (names == np.char.add("image_point", wanted)[:, None]).all()
    assert [name for name in groups.names if "flight" in name] == ["image_point flight a", "image_point flight b"]


@pytest.mark.slow
def test_proposed_factors_leave_the_result_alone(blocks: tuple[Block, Block]) -> None:
    proposed = _adjusted(blocks[1], apply=False)
    options = BundleOptions(blunders={"sigmas": "tests"})  # type: ignore[arg-type]
    plain = bundle(blocks[1], calibrated(blocks[1]), options=options)
    np.testing.assert_array_equal(proposed.points.xyz_m, plain.points.xyz_m)
    assert plain.sigma_scale == 1.0  # the search tests by estimated standard deviations, and states those given
    c = proposed.variance_components
    assert c is not None
    assert set(c.verdict.tolist()) <= {"fits", "proposed"}
    assert (c.verdict == "proposed").any()


@pytest.mark.slow
def test_a_group_of_little_redundancy_keeps_its_standard_deviation(blocks: tuple[Block, Block]) -> None:
    """Two distances: whatever their residuals, they say nothing."""
    g = blocks[1].geodetic
    few = replace(g, active=np.arange(len(g)) < 2)
    c = _adjusted(replace(blocks[1], geodetic=few), apply=True).variance_components
    assert c is not None
    row = c.group.tolist().index("distance")
    assert (c.verdict[row], c.factor[row]) == ("not estimable", 1.0)
    assert np.isnan(c.low[row])


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_standard_deviations_of_five_control_points_that_are_five_times_too_large_are_estimated(
    seed: int, tmp_path: Path
) -> None:
    small = flown(2, 4, seed=seed)
    small.observed = {}
    seen = [p for p in small.xyz_m if p[0] == "p" and sum(q == p for _, q in small.rays) > 3]
    small.control = dict.fromkeys(["C1", "C2", "C3", "C4", seen[0]], "XYZ")
    right = adjusted_by("graph", small.write(tmp_path / "right"))
    assert not any("do not fit the residuals" in text for text in right.warnings)
    folder = small.write(tmp_path / "large")
    text = (folder / "block.yaml").read_text(encoding="utf-8")
    assert text.count("- 0.02\n") == 3
    (folder / "block.yaml").write_text(text.replace("- 0.02\n", "- 0.1\n"), encoding="utf-8")
    large = adjusted_by("graph", folder)
    assert any("do not fit the residuals" in text for text in large.warnings)
    sigma = [np.sqrt(np.einsum("nii->ni", d.bundle.points.covariance_m2)) for d in (right, large)]
    np.testing.assert_allclose(np.nanmedian(sigma[1] / sigma[0]), 1.0, atol=0.5)
    off = [np.nanmax(np.abs(d.bundle.points.xyz_m - right.bundle.points.xyz_m)) for d in (right, large)]
    assert off[1] < 0.5 * np.nanmedian(sigma[0])
