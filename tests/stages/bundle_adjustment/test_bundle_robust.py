"""Bundle with Huber's loss of the image points: gross errors in a simulated block."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told

SMALL = {
    "preset": "rc30",
    "flight": {"strips": 2, "images_per_strip": 5},
    "ties": {"new_points": 120},
    "known": {"full": 10},
}


@pytest.fixture(scope="module")
def chain() -> Chain:
    return run_chain(simulated(**SMALL))


@pytest.fixture(scope="module")
def disturbed(chain: Chain) -> ImagePoints:
    """One image point in fifty is wrong by some 100 micrometres."""
    measured, rng = chain.refined.measurements, np.random.default_rng(3)
    xy = measured.xy_mm.copy()
    wrong = rng.random(len(xy)) < 0.02
    xy[wrong] += 0.1 * rng.choice([-1.0, 1.0], size=(int(wrong.sum()), 2))
    return replace(chain.refined, measurements=replace(measured, xy_mm=xy))


def _error(chain: Chain, solution: Solution) -> float:
    """Root mean square difference of the projection centres to the undisturbed adjustment, m."""
    return float(np.sqrt(((solution.images.position_m - chain.bundle.images.position_m) ** 2).mean()))


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("weights", ["huber", "danish", "igg3", "li_posterior", "cauchy"])
def test_gross_errors_do_little_harm(chain: Chain, disturbed: ImagePoints, weights: str) -> None:
    told = Told()
    options = BundleOptions(blunders={"method": "robust", "weights": weights}, max_iterations=60)
    robust = bundle(chain.block, disturbed, chain.strip_block, options=options, context=told)
    squares = bundle(chain.block, disturbed, chain.strip_block, options=BundleOptions(blunders="none"))
    assert _error(chain, robust) < 0.25 * _error(chain, squares)
    assert any("weighted down" in text for text in told.lines)
    assert any("not a least-squares solution" in text for text in told.warnings)
    assert np.isnan(robust.sigma0)
    assert np.isnan(robust.sigma0_um)
    assert robust.metrics()["sigma0"] is None
    assert np.isnan(robust.images.covariance).all()
    assert np.isnan(robust.points.covariance_m2).all()


def test_weights_select_and_least_squares_gives_the_statistics(chain: Chain, disturbed: ImagePoints) -> None:
    options = BundleOptions(blunders={"method": "robust", "bound": 1.5, "limit": 5.0}, max_iterations=60)
    robust = bundle(chain.block, disturbed, chain.strip_block, options=options)
    rejected = robust.suspects.row[(robust.suspects.stage == "bundle_adjustment") & (robust.suspects.row >= 0)]
    wrong = np.flatnonzero((disturbed.measurements.xy_mm != chain.refined.measurements.xy_mm).any(axis=1))
    assert len(np.intersect1d(rejected, wrong)) >= 0.9 * len(wrong)
    assert len(np.setdiff1d(rejected, wrong)) <= 0.1 * len(wrong)
    put_in = disturbed.measurements.xy_mm[wrong] - chain.refined.measurements.xy_mm[wrong]
    of_wrong = robust.suspects.take(np.isin(robust.suspects.row, wrong) & (robust.suspects.kind == "image_point"))
    estimated = of_wrong.error[np.argsort(of_wrong.row), :2]
    assert np.median(np.abs(estimated - put_in[np.isin(wrong, of_wrong.row)])) < 0.02  # of 0.1 mm
    final = bundle(chain.block, disturbed, robust, options=BundleOptions(blunders={"limit": 5.0}))
    assert final.sigma0 == pytest.approx(chain.bundle.sigma0, rel=0.1)
    assert np.isfinite(final.images.covariance).all()
    sigma = np.sqrt(np.einsum("nii->ni", chain.bundle.images.covariance)[:, :3])
    assert (np.abs(final.images.position_m - chain.bundle.images.position_m) < 2 * sigma).all()


def test_a_bound_beyond_all_residuals_leaves_the_least_squares_solution(chain: Chain) -> None:
    told = Told()
    squares = bundle(chain.block, chain.refined, chain.strip_block, options=BundleOptions(blunders="none"))
    wide_open = BundleOptions(blunders={"method": "robust", "bound": 1e6})
    wide = bundle(chain.block, chain.refined, chain.strip_block, options=wide_open, context=told)
    np.testing.assert_allclose(wide.images.position_m, squares.images.position_m, rtol=1e-12)
    assert np.isfinite(wide.points.covariance_m2).any()
    covariance = squares.points.covariance_m2
    np.testing.assert_allclose(wide.points.covariance_m2, covariance, rtol=1e-9, atol=1e-9 * np.nanmax(covariance))
    assert wide.sigma0 == pytest.approx(squares.sigma0, rel=1e-12)
    assert any(text.startswith("0 of ") for text in told.lines)


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_the_bound_is_positive(value: float) -> None:
    with pytest.raises(ValidationError, match="greater than 0"):
        BundleOptions(blunders={"method": "robust", "bound": value})


@pytest.mark.parametrize(("gone", "instead"), [("huber", "bound: K"), ("huber_rejects", "limit: L")])
def test_options_there_were_say_what_to_write_instead(gone: str, instead: str) -> None:
    with pytest.raises(ValidationError, match=instead):
        BundleOptions.model_validate({gone: 5.0})


@pytest.mark.parametrize("given", [{"weights": "danish"}, {"bound": 2.0}, {"limit": 5.0}, {"tau": True}])
def test_what_has_no_effect_is_refused(given: dict[str, object]) -> None:
    with pytest.raises(ValidationError, match="method none"):
        BundleOptions(blunders={"method": "none", **given})


def test_what_needs_statistics_is_refused() -> None:
    with pytest.raises(ValidationError, match="reliability needs least squares"):
        BundleOptions(blunders="robust", reliability=True)
    with pytest.raises(ValidationError, match="variance_components needs least squares"):
        BundleOptions.model_validate({"blunders": "robust", "variance_components": {"groups": ["kind"]}})
    with pytest.raises(ValidationError, match="remove needs least squares"):
        BundleOptions.model_validate({"blunders": "robust", "self_calibration": {"set": "ebner12", "remove": True}})
