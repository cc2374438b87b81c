"""Weights of additional parameters are no measurements: sigma0 is that of the observations."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from aatri.checks.after.sigma0 import sigma0
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.campaigns.calibration_blocks import PLANNED, Type
from tests.stages.film_blocks import Told

FOUR = Type(
    {"flight": {"strips": 2, "images_per_strip": 2}, "gnss": PLANNED, "known": {"full": 8}, "ties": {"new_points": 30}},
    {},
)
BLOCKS = 20


def adjusted(seed: int, **options: object) -> Solution:
    block, points = FOUR.made(seed)
    given = {"blunders": "none", "self_calibration": "ebner12", **options}
    return bundle(block, points, options=BundleOptions(**given))  # type: ignore[arg-type]


@pytest.mark.slow
def test_sigma0_of_four_images_with_default_weights_is_one() -> None:
    found = [adjusted(seed) for seed in range(1, BLOCKS + 1)]
    squares = np.array([s.sigma0**2 for s in found])
    counted = np.mean([s.redundancy for s in found]) - 12  # all twelve are determined by the image points
    assert squares.mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / (counted * BLOCKS)))
    of_all = np.array([s.sigma0**2 * counted / s.redundancy for s in found])
    assert of_all.mean() < 0.85  # what it would be with the weights counted


def test_loose_weights_give_the_sigma0_of_free_parameters() -> None:
    weighted = adjusted(1, self_calibration={"set": "bauer3", "sigma_um": 1e5})
    free = adjusted(1, self_calibration={"set": "bauer3", "sigma_um": None})
    assert weighted.sigma0 == pytest.approx(free.sigma0, rel=1e-4)
    assert weighted.redundancy == free.redundancy + 3


@pytest.mark.parametrize(
    "of", [{}, pytest.param({"self_calibration": {"set": "bauer3", "per": "image"}}, marks=pytest.mark.slow)]
)
def test_sigma0_is_the_same_without_standard_deviations(of: dict[str, object]) -> None:
    """By a solve for the parameters of one camera; with as many units as images (here 4) too."""
    plain, full = adjusted(1, standard_deviations=False, **of), adjusted(1, **of)
    assert np.isnan(plain.images.covariance).all()
    assert np.isfinite(full.images.covariance).all()
    assert plain.sigma0 == pytest.approx(full.sigma0, rel=1e-9)


@pytest.mark.parametrize(
    ("scale", "sigma_rad", "level"), [(24.0, 4e-5, "note"), (26.0, 4e-5, "error"), (24.0, 0.0, "error")]
)
def test_standard_deviations_that_fit_may_be_as_coarse_as_anybody_measures(
    scale: float, sigma_rad: float, level: str
) -> None:
    adjusted = SimpleNamespace(sigma0=1.0, redundancy=300, down_weighted=False)
    result: Any = SimpleNamespace(adjusted=adjusted, counted=None)
    (finding,) = sigma0(result, None, scale, sigma_rad=sigma_rad)
    assert finding.level == level


def test_with_many_units_it_is_the_same_too(monkeypatch: pytest.MonkeyPatch) -> None:
    one = adjusted(1, standard_deviations=False)
    monkeypatch.setattr("aatri.orientation.bundle.observed_sigma0.MOST_SOLVES", 0)
    assert adjusted(1, standard_deviations=False).sigma0 == pytest.approx(one.sigma0, rel=1e-9)


def test_without_a_factor_all_is_counted_and_told() -> None:
    context = Told()
    block, points = FOUR.made(1)
    options = BundleOptions.model_validate(
        {
            "blunders": "none",
            "self_calibration": "ebner12",
            "solver": "conjugate_gradients",
            "standard_deviations": False,
        }
    )
    one = bundle(block, points, options=options, context=context)
    r = one.residuals
    size = r.residual / np.where(r.sigma > 0, r.sigma, np.nan)
    assert one.sigma0**2 * one.redundancy == pytest.approx(np.nansum(size[r.active] ** 2), rel=1e-6)
    assert any("counts the weights of additional parameters" in w for w in context.warnings)
