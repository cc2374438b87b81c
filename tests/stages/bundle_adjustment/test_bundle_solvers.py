"""Solvers, and convergence from afar."""

from __future__ import annotations

import weakref
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.adapters.bundle import bundle_tables
from aatri.adjustment.elimination.panels import PanelsInFile
from aatri.adjustment.parts import adjust
from aatri.adjustment.stepping import adjusted
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.errors import ResourceError
from aatri.orientation.bundle.result import BundleResult
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.campaigns.convergence_basin import disturbed, outcome, well_posed, with_start_c
from tests.orientation.bundle.parts import Parts, adjust_bundle
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told


@pytest.mark.slow
def test_a_block_without_errors_is_adjusted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    block = simulated(2, preset="uav", flight={"strips": 3, "images_per_strip": 5})
    clean, once, adjusted = run_chain(block), adjust.adjust_large, list[int]()
    monkeypatch.setattr(adjust, "adjust_large", lambda *a, **k: adjusted.append(1) or once(*a, **k))
    result = bundle(block, clean.refined, clean.strip_block)
    assert len(adjusted) == 1
    assert result.history.decrement[-1] <= 1e-3


# The same block with the factor in memory, in a file, and by conjugate gradients.

SIZES = {"small": (2, 5), "medium": (3, 10)}


@pytest.fixture(scope="module", params=SIZES)
def chain(request: pytest.FixtureRequest) -> Chain:
    strips, images = SIZES[request.param]
    return run_chain(
        simulated(
            preset="rc30",
            flight={"strips": strips, "images_per_strip": images, "cross_strips": 1},
            ties={"per_position": 2},
            known={"full": 12},
        ),
    )


def _adjusted(chain: Chain, told: Told | None = None, **options: object) -> Solution:
    """With film corrections of every image, and a set of parameters in the border."""
    chosen = BundleOptions(interior_unknowns=True, self_calibration="ebner12", blunders="none", **options)  # type: ignore[arg-type]
    # none rejected: which of them fit the block again depends on standard deviations
    initial = replace(chain.strip_block, suspects=Suspects.empty())
    return bundle(chain.block, chain.refined, initial, options=chosen, context=told or Told())


@pytest.fixture(scope="module")
def reference(chain: Chain) -> Solution:
    """With the factor in memory."""
    return _adjusted(chain)


@pytest.mark.slow
def test_conjugate_gradients_give_the_direct_solution(chain: Chain, reference: Solution) -> None:
    told = Told()
    found = _adjusted(chain, told, solver="conjugate_gradients", memory_gb=1e-3)
    sigma = np.sqrt(np.einsum("nii->ni", reference.points.covariance_m2))
    assert np.nanmax(np.abs(found.points.xyz_m - reference.points.xyz_m) / sigma) < 1e-6
    sigma = np.sqrt(np.einsum("nii->ni", reference.images.covariance))[:, :3]
    off = np.abs(found.images.position_m - reference.images.position_m)
    assert np.nanmax(off / sigma) < 1e-6
    off = np.abs(found.parameters.value - reference.parameters.value) / reference.parameters.sigma
    assert np.nanmax(off) < 1e-6
    # Without a factor the redundancy of the parameters' weights is not known: they are counted, and it is said.
    assert _adjusted(chain, standard_deviations=False).sigma0 == pytest.approx(reference.sigma0, rel=1e-9)
    assert found.sigma0 == pytest.approx(reference.sigma0, rel=2e-3)
    assert any("which conjugate gradients do not have" in line for line in (*told.lines, *told.warnings))
    assert np.isnan(found.points.covariance_m2).all()
    assert np.isnan(found.images.covariance).all()
    assert any("no standard deviations: exact covariances need the factor" in warning for warning in told.warnings)


@pytest.mark.slow
def test_covariances_of_more_points_than_memory_is_meant_for_are_refused(
    chain: Chain, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bundle_tables, "MOST_CHOSEN", 3)
    with pytest.raises(ResourceError, match="more than 3"):
        _adjusted(chain, point_covariances=["*"])


@pytest.mark.slow
def test_a_factor_in_a_file_changes_nothing(chain: Chain, reference: Solution) -> None:
    told = Told()
    found = _adjusted(chain, told, solver="direct", memory_gb=1e-3)
    assert any("above the limit of 0.001 GB: the factor goes to" in line for line in told.lines)
    sigma = np.sqrt(np.einsum("nii->ni", reference.points.covariance_m2))
    assert np.nanmax(np.abs(found.points.xyz_m - reference.points.xyz_m) / np.where(sigma > 0, sigma, np.nan)) < 1e-9
    for one, other in (
        (found.points.covariance_m2, reference.points.covariance_m2),
        (found.images.covariance, reference.images.covariance),
    ):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.nanmax(np.abs(other)))


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [0, 4], ids=["clean", "gross errors"])
def test_a_search_with_the_factor_in_a_file_gives_the_same_and_closes_one_before_the_next(
    wrong: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    gross_errors = {"image_points": wrong}
    block = simulated(5, preset="uav", flight={"strips": 4, "images_per_strip": 6}, gross_errors=gross_errors)
    made, whole, again = run_chain(block), adjusted.factorise_constrained, list[bool]()
    files, made_files = weakref.WeakSet[PanelsInFile](), list[object]()
    monkeypatch.setattr(adjusted, "factorise_constrained", lambda *a: again.append(True) or whole(*a))
    in_memory = bundle(made.block, made.refined, made.strip_block)
    assert wrong or len(again) == 1  # for covariances, score tests and the tests of the result together
    again.clear()

    def opened(self: PanelsInFile, shapes: object, once: Any = PanelsInFile.__init__) -> None:
        once(self, shapes)
        assert sum(not file.closed for file in files) <= 1  # with a damped step there are two for a moment
        files.add(self)
        made_files.append(shapes)

    monkeypatch.setattr(PanelsInFile, "__init__", opened)
    options = BundleOptions(solver="direct", memory_gb=1e-3)
    in_file = bundle(made.block, made.refined, made.strip_block, options=options)
    assert made_files
    assert wrong or len(again) == 1
    assert not [file for file in files if not file.closed]  # the result itself has none
    assert np.array_equal(in_file.residuals.active, in_memory.residuals.active)
    assert (~in_file.residuals.active).any() == bool(wrong)
    np.testing.assert_allclose(in_file.points.xyz_m, in_memory.points.xyz_m, atol=1e-9)
    np.testing.assert_allclose(in_file.points.covariance_m2, in_memory.points.covariance_m2, rtol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("chain", ["small"], indirect=True)
def test_removing_parameters_needs_standard_deviations(chain: Chain) -> None:
    calibration = {"set": "ebner12", "remove": True}
    options = BundleOptions(self_calibration=calibration, solver="conjugate_gradients")
    with pytest.raises(ResourceError, match="conjugate gradients give none"):
        bundle(chain.block, chain.refined, chain.strip_block, options=options, context=Told())


# Starts far from the truth: a small part of the grid of tests/campaigns/convergence_basin.py.


@pytest.fixture(scope="module")
def block() -> tuple[Parts, BundleResult, float]:
    given, height_m = well_posed(1)
    return given, adjust_bundle(given, tolerance=1e-6), height_m


@pytest.fixture(scope="module")
def free_c() -> tuple[Parts, BundleResult]:
    given, _ = well_posed(1, free_c=True)
    return given, adjust_bundle(given, tolerance=1e-6)


@pytest.mark.parametrize(("angle_deg", "share"), [(10.0, 0.1), (30.0, 0.0), (30.0, 0.1), (0.0, 0.3)])
def test_angles_30_degrees_wrong_converge(
    block: tuple[Parts, BundleResult, float], angle_deg: float, share: float
) -> None:
    given, reference, height_m = block
    start = disturbed(given, np.random.default_rng(7), angle_deg, share * height_m)
    assert outcome(start, reference) == "right"


@pytest.mark.parametrize("factor", [0.5, 0.7, 2.0, 4.0])
def test_a_principal_distance_wrong_by_half_to_four_times_converges(
    free_c: tuple[Parts, BundleResult], factor: float
) -> None:
    given, reference = free_c
    assert outcome(with_start_c(given, factor), reference) == "right"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_hopeless_start_is_no_silent_success(block: tuple[Parts, BundleResult, float], seed: int) -> None:
    given, reference, height_m = block
    start = disturbed(given, np.random.default_rng(seed), 90.0, height_m)
    assert outcome(start, reference) != "false"
