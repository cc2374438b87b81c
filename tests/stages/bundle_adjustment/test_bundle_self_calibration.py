"""Self-calibration: what a lens left uncorrected costs, and what the sets of parameters bring back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.camera.parameters.catalogue import parameter_set
from aatri.camera.parameters.parameter_set import scale_of_format
from aatri.errors import GeometryError, SpecError
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.image_refinement.collocation import collocation
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from tests.camera.parameters.spans import outside_span
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told

SMALL = {
    "preset": "rc30",
    "flight": {"strips": 3, "images_per_strip": 6, "cross_strips": 1},
    "ties": {"new_points": 400},
    "known": {"full": 12, "check_full": 6},
}
UNCORRECTED = {"k1": 5e-9, "k2": -2.2e-13, "b1": 1e-4}
FILM = BundleOptions(interior_unknowns=True)


def _claimed_free_of_distortion(brown: dict[str, float]) -> Block:
    camera = {"distortion": "brown" if brown else "none", "brown": brown}
    block = simulated(**{**SMALL, "camera": camera})
    cameras = replace(block.cameras, distortion=np.full(len(block.cameras), "none"))
    nothing = np.zeros(0, dtype=np.int64)
    return replace(block, cameras=cameras, camera_parameters=block.camera_parameters.take(nothing))


@pytest.fixture(scope="module")
def error_free() -> Chain:
    return run_chain(_claimed_free_of_distortion({}), FILM)


@pytest.fixture(scope="module")
def distorted() -> Chain:
    return run_chain(_claimed_free_of_distortion(UNCORRECTED), FILM)


def _rmse_m(block: Block, solution: Solution) -> np.ndarray:
    assert block.true_points is not None
    return np.sqrt(np.nanmean((solution.points.xyz_m - block.true_points.xyz_m) ** 2, axis=0))


def _with(chain: Chain, context: Told | None = None, **self_calibration: object) -> Solution:
    options = BundleOptions(interior_unknowns=True, self_calibration=self_calibration)
    return bundle(chain.block, chain.refined, chain.strip_block, options=options, context=context or Told())


@pytest.mark.slow
def test_without_self_calibration_the_loss_shows(error_free: Chain, distorted: Chain) -> None:
    loss = _rmse_m(distorted.block, distorted.bundle) / _rmse_m(error_free.block, error_free.bundle)
    assert loss.max() > 1.3
    assert distorted.bundle.sigma0 > 1.05 > error_free.bundle.sigma0


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("name", ["brown_conrady", "ebner12", "brown21"])
def test_sets_bring_back_the_accuracy_of_the_error_free_camera(error_free: Chain, distorted: Chain, name: str) -> None:
    ratio = _rmse_m(distorted.block, _with(distorted, set=name)) / _rmse_m(error_free.block, error_free.bundle)
    assert ratio.max() < 1.10


def test_brown_conrady_finds_the_parameters_that_were_put_in(distorted: Chain) -> None:
    told = Told()
    p = _with(distorted, told, set="brown_conrady").parameters
    chosen = p.group == "additional"
    value, sigma = (dict(zip(p.name[chosen].tolist(), column[chosen])) for column in (p.value, p.sigma))
    assert abs(value["b1"] - UNCORRECTED["b1"]) < 4 * sigma["b1"]
    assert abs(value["b1"]) > 10 * sigma["b1"]
    assert abs(value["k1"] - UNCORRECTED["k1"]) < 4 * sigma["k1"]
    assert any("not significant at 5 %" in line and "b2" in line for line in told.lines)


@pytest.mark.slow
def test_an_effect_outside_a_set_shows_in_sigma0_and_in_the_residual_field() -> None:
    """bauer3 has no term of the fifth order: what k2 leaves over is in its residuals, where it must be."""
    strong = run_chain(_claimed_free_of_distortion({"k2": -2e-12}), FILM)
    inside, outside = _with(strong, set="brown_conrady"), _with(strong, set="bauer3")
    assert inside.sigma0 < 1.03
    assert outside.sigma0 > 1.10
    xy, residual = _mean_residuals(strong, outside)
    put_in = -2e-12 * (xy**2).sum(axis=1, keepdims=True) ** 2 * xy
    expected = outside_span(parameter_set("bauer3"), scale_of_format([115.0, 115.0], 153.84), xy, put_in)
    fit = float((residual * expected).sum() / (expected**2).sum())
    correlation = float(np.corrcoef(residual.ravel(), expected.ravel())[0, 1])
    # adjusted minus observed is the correction that is missing; points take up a part of it
    assert correlation > 0.7
    assert 0.4 < fit < 1.1


def _mean_residuals(chain: Chain, solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """Residuals laid over each other in cells of the plate: mean places and mean residuals, mm."""
    r = solution.residuals
    rows = r.row[r.kind == "image_point"]
    xy, v = chain.refined.measurements.xy_mm[rows], r.residual[r.kind == "image_point", :2]
    cell = np.round(xy / 20.0).astype(int) @ [100, 1]
    ids, which, count = np.unique(cell, return_inverse=True, return_counts=True)
    means = [np.stack([np.bincount(which, a[:, k]) / count for k in (0, 1)], axis=1) for a in (xy, v)]
    full = count >= 15
    assert len(ids) > 20
    return means[0][full], means[1][full]


@pytest.mark.slow
def test_removal_keeps_what_was_put_in_and_adjusts_again(error_free: Chain, distorted: Chain) -> None:
    told = Told()
    solution = _with(distorted, told, set="brown21", remove=True)
    removed = [line.split()[1] for line in told.lines if " left out, " in line]
    # affinity a1 and the radial a16 (k1) or its twin a17 must stay
    assert len(removed) >= 10
    assert "a1" not in removed
    assert not {"a16", "a17", "a18"} <= set(removed)
    kept = solution.parameters.group == "additional"
    zero = {str(n) for n, v in zip(solution.parameters.name[kept], solution.parameters.value[kept]) if v == 0}
    assert zero == set(removed)
    full = _with(distorted, set="brown21")
    assert full.unknowns - solution.unknowns == len(removed)
    ratio = _rmse_m(distorted.block, solution) / _rmse_m(error_free.block, error_free.bundle)
    assert ratio.max() < 1.10


@pytest.mark.slow
def test_what_is_left_out_by_a_test_counts_by_its_size_and_its_standard_deviation(
    error_free: Chain, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A share of what their covariance brings to points, and of the square of what their values do."""
    told = Told()
    found = _with(error_free, told, set="ebner12", remove=True).points
    reasons = [line for line in told.lines if " left out, " in line]
    assert reasons
    assert all("not significant" in line for line in reasons)
    monkeypatch.setattr("aatri.stages.bundle_adjustment._adjusting.with_considered", lambda done, *_: done)
    left, whole = _with(error_free, set="ebner12", remove=True).points, _with(error_free, set="ebner12").points
    moved = whole.xyz_m - left.xyz_m
    parts = [whole.covariance_m2 - left.covariance_m2, np.einsum("ni,nj->nij", moved, moved)]
    added, known = found.covariance_m2 - left.covariance_m2, np.isfinite(whole.covariance_m2).all(axis=(1, 2))
    (share, square), rest, *_ = np.linalg.lstsq(
        np.stack([part[known].ravel() for part in parts], axis=1), added[known].ravel(), rcond=None
    )
    assert rest < 1e-6 * (added[known] ** 2).sum()
    assert 0.05 < share < 0.6
    assert share**2 < square < share


@pytest.mark.slow
def test_adjustments_with_fewer_parameters_and_with_all_begin_where_the_search_has_ended(error_free: Chain) -> None:
    """From the start values of the strips, an affine film and all, a weak block might not come here again."""
    told = Told()
    _with(error_free, told, set="ebner12", remove=True)
    costs = [(line, float(line.split("cost ")[1])) for line in told.lines if line.startswith("iteration ")]
    begun = [cost for line, cost in costs if line.startswith("iteration 1:")]
    assert begun[0] > 1.3 * costs[-1][1]
    assert max(begun[-2:]) < 1.05 * costs[-1][1]


def test_c_and_z0_of_vertical_images_are_named_with_advice(error_free: Chain) -> None:
    """Without observed positions, over nearly flat ground: a21 and Z0 cannot be told apart."""
    told = Told()
    options = BundleOptions(interior_unknowns=True, positions={"use": False}, self_calibration={"set": "brown21"})
    bundle(error_free.block, error_free.refined, error_free.strip_block, options=options, context=told)
    text = next(t for t in told.warnings if "a21 and Z0 of image" in t)
    assert "vertical images of nearly flat terrain cannot tell them apart" in text
    assert "observed projection" in text


@pytest.mark.slow
def test_the_rank_loss_of_brown21_is_refused_with_advice() -> None:
    """Exactly flat ground, exactly vertical images, no positions, free parameters: a19 a20 a21 are not determined."""
    block = simulated(
        camera={"kind": "digital", "format": (6000.0, 6000.0), "pixel_size_mm": 0.01, "principal_distance_mm": 60.0},
        flight={
            "strips": 3,
            "images_per_strip": 5,
            "tilt_sigma_deg": 0.0,
            "kappa_sigma_deg": 0.0,
            "position_sigma_m": (0.0, 0.0, 0.0),
        },
        terrain={"relief_m": 0.0},
        ties={"per_position": 4},
        known={"full": 9},
        gnss={"observed": False},
        refraction="none",
        noise={"factor": 0.0, "control_m": (0.0, 0.0, 0.0)},
    )
    chain = run_chain(block)
    with pytest.raises(GeometryError) as caught:
        bundle(
            block,
            chain.refined,
            chain.strip_block,
            options=BundleOptions(self_calibration={"set": "brown21", "sigma_um": None}),
        )
    assert caught.value.exit_code == 4
    assert "a21 of additional" in caught.value.what
    assert "observed projection centres" in caught.value.remedy
    assert "sigma_um" in caught.value.remedy


@pytest.mark.slow
def test_the_camera_of_a_solution_has_the_principal_distance_that_a_set_gives_beside_a_known_lens() -> None:
    block = simulated(**SMALL, camera={"distortion": "brown", "brown": UNCORRECTED}, gnss={"observed": True})
    c = float(block.cameras.principal_distance_mm[0])
    wrong = replace(block, cameras=replace(block.cameras, principal_distance_mm=np.array([c + 0.2])))
    chain = run_chain(wrong, FILM)
    uncorrected = systematic(wrong, chain.interior, options=SystematicOptions(distortion=False))
    solution = _with(replace(chain, refined=uncorrected), set="brown_conrady")
    p = solution.parameters
    assert "camera" in p.group
    sigma = float(p.sigma[p.name == "c"][0])
    assert 0.0 < sigma < 0.05
    assert abs(float(solution.cameras.principal_distance_mm[0]) - c) < 4.0 * sigma


def test_interior_belongs_to_sets_without_it(distorted: Chain) -> None:
    names = _with(distorted, set="bauer3", interior=True).parameters.name.tolist()
    assert [n for n in ("c", "x0", "y0", "a1", "a2", "a3") if n not in names] == []
    with pytest.raises(SpecError, match="has the interior orientation already"):
        _with(distorted, set="brown21", interior=True)


@pytest.mark.slow
def test_c_joins_sets_that_lack_it_where_projection_centres_are_observed(distorted: Chain) -> None:
    """Such sets leave the scale of a radial distortion to Z0, which observed positions hold."""
    observed = _with(distorted, set="ebner12").parameters
    assert {"c", "x0", "y0", "b12"} <= set(observed.name.tolist())
    options = BundleOptions(interior_unknowns=True, positions={"use": False}, self_calibration="ebner12")
    without = bundle(distorted.block, distorted.refined, distorted.strip_block, options=options).parameters
    assert "c" not in without.name.tolist()
    assert _with(distorted, set="brown21").parameters.name.tolist().count("c") == 0


@pytest.mark.slow
def test_collocation_takes_off_what_a_set_leaves_over() -> None:
    strong = run_chain(_claimed_free_of_distortion({"k2": -2e-12}), FILM)
    first = _with(strong, set="bauer3", interior=True)
    compensated = collocation(strong.block, strong.refined, first)
    assert compensated.corrections.name.tolist()[-1] == "collocation"
    second = _with(replace(strong, refined=compensated), set="bauer3", interior=True)
    assert second.sigma0 < first.sigma0 - 0.5 * (first.sigma0 - 1)
    again = collocation(strong.block, compensated, second)
    assert again.corrections.name.tolist()[-1] == "collocation 2"


@pytest.mark.slow
@pytest.mark.parametrize("method", ["robust_snooping", "data_snooping"])
def test_verdicts_stay_with_their_observations_while_parameters_go(method: str) -> None:
    """With positions the idle parameters' weights leave the list of kinds; gross errors before and behind them stay."""
    chain = run_chain(simulated(**SMALL), FILM)
    m, e = chain.refined.measurements, chain.block.exterior
    xy, position = m.xy_mm.copy(), e.position_m.copy()
    rays = np.bincount(m.point[m.active], minlength=len(chain.block.points))[m.point]
    ray = int(np.flatnonzero(m.active & (rays > 4))[7])
    xy[ray] += [0.3, 0.2]
    position[5, 2] += 5.0
    block = replace(chain.block, exterior=replace(e, position_m=position))
    points = replace(chain.refined, measurements=replace(m, xy_mm=xy))
    wanted = {"set": "ebner12", "remove": True, "sigma_um": 5.0}
    options = BundleOptions(interior_unknowns=True, self_calibration=wanted, blunders=method)
    told = Told()
    s = bundle(
        block, points, replace(chain.strip_block, suspects=Suspects.empty()), options=options, context=told
    ).suspects
    assert any(" left out, " in line for line in told.lines)
    assert sorted(zip(s.kind.tolist(), s.row.tolist(), s.verdict.tolist())) == [
        ("image_point", ray, "rejected"),
        ("position", 5, "rejected"),
    ]
