"""Collocation of image residuals against simulated correlated fields."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.adjustment.statistics.limits import CLEAR_SIGMAS
from aatri.errors import SpecError
from aatri.orientation.refinement.collocation import CovarianceFunction, collocate, collocate_groups, predict
from aatri.orientation.refinement.residual_covariance import EmpiricalCovariance, fit_covariance

SIGNAL, NOISE, LENGTH = 0.004, 0.005, 50.0


def _correlation(model: str, d: Any) -> Any:
    return np.exp(-((d / LENGTH) ** (2 if model == "gaussian" else 1)))


def _field(model: str, xy: Any, rng: Any) -> Any:
    """A Gaussian field with the covariance SIGNAL^2 times the correlation."""
    d = np.linalg.norm(xy[:, None] - xy[None], axis=2)
    factor = np.linalg.cholesky(_correlation(model, d) + 1e-9 * np.eye(len(xy)))
    return SIGNAL * factor @ rng.normal(size=(len(xy), 2))


def _rms(a: Any) -> float:
    return float(np.sqrt((a**2).mean()))


def test_one_residual_by_hand() -> None:
    # s = C0/(C0 + D) v at its place, variance C0 - C0^2/(C0 + D); exp(-1) of it at the distance L
    f = CovarianceFunction("exponential", 16.0, 10.0, 9.0)
    c = collocate(np.array([[0.0, 0.0]]), np.array([[5.0, -2.5]]), function=f)
    correction, sigma = predict(c, np.array([[0.0, 0.0], [0.0, 10.0]]))
    assert correction[0] == pytest.approx([3.2, -1.6], rel=1e-8)
    assert correction[1] == pytest.approx(correction[0] * np.exp(-1), rel=1e-8)
    assert sigma == pytest.approx([np.sqrt(16 - 256 / 25), np.sqrt(16 - 256 / 25 * np.exp(-2))], rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["gaussian", "exponential"])
def test_a_correlated_field_is_recovered_as_well_as_theory_says(model: str) -> None:
    rng = np.random.default_rng(1)
    known = CovarianceFunction(model, SIGNAL**2, LENGTH, NOISE**2)
    error, theory, fitted, before = [], [], [], []
    for _ in range(5):
        xy = rng.uniform(-110, 110, (450, 2))
        signal = _field(model, xy, rng)
        residual = signal + NOISE * rng.normal(size=signal.shape)
        seen, unseen = slice(0, 300), slice(300, None)
        found, sigma = predict(collocate(xy[seen], residual[seen], function=known), xy[unseen])
        error.append(_rms(found - signal[unseen]))
        theory.append(_rms(sigma))
        fitted.append(_rms(predict(collocate(xy[seen], residual[seen]), xy[unseen])[0] - signal[unseen]))
        before.append(_rms(signal[unseen]))
    # theory: C0 - c'(C + D)^-1 c with the true covariance function
    assert _rms(np.array(error)) == pytest.approx(_rms(np.array(theory)), rel=0.1)
    # a fitted covariance function costs little
    assert _rms(np.array(fitted)) < 1.1 * _rms(np.array(error))
    assert _rms(np.array(error)) < 0.7 * _rms(np.array(before))


@pytest.mark.slow
def test_the_covariance_function_is_found() -> None:
    rng = np.random.default_rng(2)
    variance, noise, models = [], [], []
    for _ in range(8):
        xy = rng.uniform(-110, 110, (350, 2))
        f = collocate(xy, _field("gaussian", xy, rng) + NOISE * rng.normal(size=xy.shape)).function
        assert f is not None
        variance.append(f.variance_mm2)
        noise.append(f.noise_mm2)
        models.append(f.model)
    assert np.mean(variance) == pytest.approx(SIGNAL**2, rel=0.3)  # few independent patches fit on one plate
    assert np.mean(noise) == pytest.approx(NOISE**2, rel=0.05)
    assert models.count("gaussian") >= 6


@pytest.mark.slow
def test_many_residuals_are_gathered_and_average_their_noise() -> None:
    # the same plate seen in 200 images: noise of a cell falls with the root of their number
    rng = np.random.default_rng(3)
    xy = rng.uniform(-110, 110, (20000, 2))
    signal = SIGNAL * np.stack([np.sin(xy[:, 0] / 40), np.cos(xy[:, 1] / 50)], axis=1)
    residual = signal + NOISE * rng.normal(size=xy.shape)
    c = collocate(xy, residual)
    assert len(c.cells_mm) <= 400
    assert _rms(predict(c, xy)[0] - signal) < 0.15 * SIGNAL


def test_without_common_signal_nothing_is_corrected() -> None:
    rng = np.random.default_rng(4)
    for _ in range(10):
        xy = rng.uniform(-110, 110, (2000, 2))
        c = collocate(xy, NOISE * rng.normal(size=xy.shape))
        correction, sigma = predict(c, xy)
        assert c.function is None
        assert not correction.any()
        assert not sigma.any()


@pytest.mark.parametrize(("products", "is_signal"), [(1.05, True), (0.95, False)])
def test_a_signal_is_told_from_its_standard_deviation_by_the_number_of_products(
    products: float, is_signal: bool
) -> None:
    """C0 is a sum of a_k C_k over the classes; without signal C_k has the variance s^4 / (2 N_k)."""
    distance, correlation, count = (10.0, 20.0), (0.5, 0.25), (300.0, 900.0)  # exp(-d / L), L = 10 / ln 2
    weighted = [n / d**2 * f for n, d, f in zip(count, distance, correlation)]
    a = [w / sum(w * f for w, f in zip(weighted, correlation)) for w in weighted]
    total, variance = 30.0, 6.0
    sigma = total * sum(a_k**2 / (2 * n) for a_k, n in zip(a, count)) ** 0.5
    border = (CLEAR_SIGMAS * sigma / variance) ** 2
    c = EmpiricalCovariance(
        np.array(distance), variance * np.array(correlation), products * border * np.array(count), total
    )
    found = fit_covariance(c, "exponential")
    assert (found is not None) == is_signal
    assert found is None or found.variance_mm2 == pytest.approx(variance, rel=1e-4)
    assert found is None or found.length_mm == pytest.approx(10 / np.log(2), rel=1e-4)


def test_groups_are_corrected_apart_and_inactive_points_too() -> None:
    rng = np.random.default_rng(5)
    xy = rng.uniform(-110, 110, (4000, 2))
    signal = SIGNAL * np.stack([np.sin(xy[:, 0] / 40), np.cos(xy[:, 1] / 50)], axis=1)
    group = np.arange(4000) % 3
    signal[group == 1] *= -1.0
    signal[group == 2] = 0.0
    residual = signal + NOISE * rng.normal(size=xy.shape)
    active = np.ones(4000, dtype=bool)
    active[:100] = False
    residual[:100] += 1.0  # gross errors, set aside
    correction, _, found = collocate_groups(group, xy, residual, active)
    assert list(found) == [0, 1, 2]
    assert found[2].function is None
    for number in (0, 1):
        rows = group == number
        assert _rms((correction - signal)[rows]) < 0.35 * SIGNAL
    assert _rms((correction - signal)[:100]) < 0.5 * SIGNAL


def test_a_gross_error_that_was_left_out_compensates_nothing_and_one_that_stayed_does_as_the_equation_says() -> None:
    """s = c'(C + D)^-1 v in dense matrices: an error of 100 um in one of 60 residuals, 5 mm and 40 mm from it."""
    rng = np.random.default_rng(8)
    f = CovarianceFunction("gaussian", SIGNAL**2, LENGTH, NOISE**2)
    grid = np.stack(np.meshgrid(np.linspace(-100, 100, 8), np.linspace(-100, 100, 8)), axis=-1).reshape(-1, 2)
    xy, v = grid[:60] + rng.uniform(-5, 5, (60, 2)), NOISE * rng.normal(size=(60, 2))  # one to a cell of the plate
    wrong, places = np.zeros((60, 2)), xy[0] + np.array([[5.0, 0.0], [40.0, 0.0]])
    wrong[0] = [0.1, 0.0]
    left_out = predict(collocate(xy[1:], v[1:], function=f), places)[0]
    without = np.linalg.norm(xy[1:, None] - xy[None, 1:], axis=2)
    C = SIGNAL**2 * _correlation("gaussian", without) + NOISE**2 * np.eye(59)
    c = SIGNAL**2 * _correlation("gaussian", np.linalg.norm(places[:, None] - xy[None, 1:], axis=2))
    np.testing.assert_allclose(left_out, c @ np.linalg.solve(C, v[1:]), rtol=1e-7)
    clean, stayed = (predict(collocate(xy, v + e, function=f), places)[0] for e in (0 * wrong, wrong))
    whole = SIGNAL**2 * _correlation("gaussian", np.linalg.norm(xy[:, None] - xy[None], axis=2)) + NOISE**2 * np.eye(60)
    c = SIGNAL**2 * _correlation("gaussian", np.linalg.norm(places[:, None] - xy[None], axis=2))
    np.testing.assert_allclose(stayed - clean, c @ np.linalg.solve(whole, wrong), atol=1e-9)


def test_the_same_residuals_in_another_order_give_the_same_correction() -> None:
    rng = np.random.default_rng(6)
    xy = rng.uniform(-110, 110, (500, 2))
    residual = SIGNAL * np.sin(xy / 40) + NOISE * rng.normal(size=xy.shape)
    order = rng.permutation(500)
    one, other = (predict(collocate(xy[o], residual[o]), xy)[0] for o in (np.arange(500), order))
    assert np.abs(one - other).max() < 1e-9


def test_wrong_calls_are_refused() -> None:
    with pytest.raises(SpecError, match="gaussian"):
        collocate(np.zeros((1, 2)), np.zeros((1, 2)), model="gauss")
    with pytest.raises(SpecError, match="no residuals"):
        collocate(np.zeros((0, 2)), np.zeros((0, 2)))
