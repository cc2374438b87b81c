"""Adjustment with Huber's loss against independent minimisation by SciPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from aatri.adjustment.covariance.cross import covariances_of_pairs
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.loss import Huber
from aatri.adjustment.stepping.adjust import adjust_large
from tests.adjustment.block_problem import joined_problem, made_problem, shared_problem
from tests.adjustment.reference import free_columns
from tests.adjustment.test_solve import _many_fronts

MAKERS = {"plain": made_problem, "joined": joined_problem, "shared": shared_problem}
K = 1.5


def _disturbed(records, share: float = 0.1, size: float = 30.0, seed: int = 9):
    """Gross errors in some records of the first observation type; Huber's loss of all records."""
    rays, rng = records[0], np.random.default_rng(seed)
    gross = np.zeros((len(rays.active), 2))
    wrong = rng.random(len(gross)) < share
    gross[wrong] = size * rng.normal(size=(int(wrong.sum()), 2))

    def evaluate(state, rows):
        v, J = rays.evaluate(state, rows)
        return v + gross[rows], J

    return tuple(replace(r, loss=Huber(K)) for r in (replace(rays, evaluate=evaluate), *records[1:]))


def _single(records):
    """Only the first component of the first observation type, whitened by itself."""
    rays = records[0]

    def evaluate(state, rows):
        v, J = rays.evaluate(state, rows)
        return v[:, :1], tuple(j[:, :1] for j in J)

    return (replace(rays, evaluate=evaluate, whitener=np.ones((len(rays.active), 1))), *records[1:])


def _whitened(unknowns, records, start, x):
    columns, padded, found = free_columns(unknowns), np.append(x, 0.0), []
    state = {u.name: start[u.name] + padded[columns[u.name]] for u in unknowns}
    for r in records:
        v, _ = r.evaluate(state, np.arange(len(r.active)))
        L = r.whitener
        v = L * v if L.ndim == 2 else np.einsum("nij,nj->ni", L, v)
        found.append(v[r.active])
    return found


def _adjusted_values(unknowns, result, start):
    return np.concatenate([(result.state[u.name] - start[u.name])[u.free] for u in unknowns])


def _by_scipy(unknowns, records, start, x0):
    """Minimum of the robust cost: v phi(s) / s as least-squares records, phi^2 = rho, derivatives by complex step."""

    def residual(x):
        parts = []
        for v in _whitened(unknowns, records, start, x):
            s = np.sqrt((v * v).sum(axis=1))
            far = s.real > K
            factor = np.where(far, np.sqrt(np.where(far, 2 * K * s - K**2, 1.0)) / np.where(far, s, 1.0), 1.0)
            parts.append((v * factor[:, None]).ravel())
        return np.concatenate(parts)

    return least_squares(residual, x0, jac="cs", xtol=1e-12, ftol=1e-14, gtol=1e-10, max_nfev=200)


@pytest.mark.slow
@pytest.mark.parametrize("fronts", ["one", "many"])
@pytest.mark.parametrize(("maker", "seed"), [("plain", 1), ("shared", 2)])
def test_the_solution_is_the_minimum_that_scipy_finds(
    monkeypatch: pytest.MonkeyPatch, maker: str, seed: int, fronts: str
) -> None:
    if fronts == "many":
        _many_fronts(monkeypatch)
    unknowns, records, start = MAKERS[maker](seed, n_kept=8, n_points=16)
    records = _disturbed(records)
    result = adjust_large(unknowns, records, start, tolerance=1e-6, max_iterations=60)
    x = _adjusted_values(unknowns, result, start)
    reference = _by_scipy(unknowns, records, start, x + 0.01 * np.random.default_rng(2).normal(size=len(x)))
    assert result.cost == pytest.approx(2 * reference.cost, rel=1e-9)
    np.testing.assert_allclose(x, reference.x, atol=1e-4)
    sizes = [np.linalg.norm(v, axis=1) for v in _whitened(unknowns, records, start, x)]
    assert result.down_weighted == sum(int((s > K).sum()) for s in sizes) > 0


@pytest.mark.slow
@pytest.mark.parametrize(("maker", "seed"), [("plain", 2), ("joined", 0), ("joined", 2)])
def test_records_at_the_bound_do_not_keep_the_iteration_from_the_minimum(maker: str, seed: int) -> None:
    unknowns, records, start = MAKERS[maker](seed, n_kept=8, n_points=16)
    records = _disturbed(records)
    result = adjust_large(unknowns, records, start, max_iterations=60)
    reference = _by_scipy(unknowns, records, start, _adjusted_values(unknowns, result, start))
    assert result.cost == pytest.approx(2 * reference.cost, rel=1e-6)


@pytest.mark.slow
def test_records_of_one_residual_are_those_of_scipys_huber_loss() -> None:
    unknowns, records, start = made_problem(3, n_kept=8, n_points=16, rays=6)
    records = _single(_disturbed(records))
    # the loss of SciPy acts on single residuals, so the priors of four components each stay without
    records = (records[0], *(replace(r, loss=None) for r in records[1:]))
    result = adjust_large(unknowns, records, start, max_iterations=100)
    x = _adjusted_values(unknowns, result, start)

    def scalar_rho(z):
        root = np.sqrt(z)
        loss = np.arange(len(z)) < int(records[0].active.sum())
        far = loss & (z > 1)
        safe = np.where(far, root, 1.0)
        return np.array(
            [np.where(far, 2 * root - 1, z), np.where(far, 1 / safe, 1.0), np.where(far, -0.5 / safe**3, 0.0)]
        )

    def residual(x):
        return np.concatenate([v.ravel() for v in _whitened(unknowns, records, start, x)])

    reference = least_squares(
        residual, x + 0.05, jac="cs", loss=scalar_rho, f_scale=K, xtol=1e-12, ftol=1e-14, gtol=1e-10, max_nfev=200
    )
    assert result.cost == pytest.approx(2 * reference.cost, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_points_of_two_rays_with_gross_errors_do_not_hold_up_the_others(seed: int) -> None:
    unknowns, records, start = made_problem(seed, n_kept=8, n_points=30, rays=2)
    records = (replace(records[0], active=np.ones_like(records[0].active)), *records[1:])
    records = _disturbed(records, share=0.25, seed=seed)
    result = adjust_large(unknowns, records, start, max_iterations=40)
    x = _adjusted_values(unknowns, result, start)
    reference = _by_scipy(unknowns, records, start, x)
    assert result.cost == pytest.approx(2 * reference.cost, rel=1e-6)


def test_an_infinite_bound_is_least_squares() -> None:
    unknowns, records, start = joined_problem(2, n_kept=8, n_points=16)
    to_the_end = {"threads": 1, "tolerance": 1e-10}  # the last steps of one of them are chord steps
    plain = adjust_large(unknowns, records, start, **to_the_end)
    robust = adjust_large(unknowns, [replace(r, loss=Huber(np.inf)) for r in records], start, **to_the_end)
    costs = [[step.cost for step in adjusted.history[:3]] for adjusted in (robust, plain)]
    assert costs[0] == pytest.approx(costs[1], rel=1e-12)
    assert (robust.cost, robust.sigma0) == pytest.approx((plain.cost, plain.sigma0), rel=1e-12)
    assert robust.down_weighted == 0
    for name in plain.state:
        np.testing.assert_allclose(robust.state[name], plain.state[name], rtol=1e-12, atol=1e-12)
    found, expected = marginal_covariances(robust), marginal_covariances(plain)
    for name in expected.groups:
        np.testing.assert_allclose(found.groups[name], expected.groups[name], rtol=1e-9, atol=1e-12)


def test_a_bound_that_no_record_exceeds_leaves_least_squares_with_its_statistics() -> None:
    unknowns, records, start = made_problem(1)
    plain = adjust_large(unknowns, records, start)
    largest = max(np.linalg.norm(v, axis=1).max() for v in _whitened(unknowns, records, start, np.zeros(52)))
    robust = adjust_large(unknowns, [replace(r, loss=Huber(1.01 * largest)) for r in records], start)
    assert robust.down_weighted == 0
    assert robust.sigma0 == pytest.approx(plain.sigma0, rel=1e-12)
    assert len(robust.history) == len(plain.history)


def test_a_robust_solution_has_no_statistics_of_least_squares() -> None:
    unknowns, records, start = made_problem()
    result = adjust_large(unknowns, _disturbed(records), start, max_iterations=60)
    assert result.down_weighted > 0
    assert np.isnan(result.sigma0)
    with pytest.raises(ValueError, match="down-weighted"):
        marginal_covariances(result)
    with pytest.raises(ValueError, match="down-weighted"):
        covariances_of_pairs(result, [(("a", 0), ("a", 1))])


def test_an_inactive_record_has_no_influence_whatever_its_size() -> None:
    unknowns, records, start = made_problem()
    first, second = _disturbed(records), _disturbed(records)
    wild = replace(second[0], evaluate=_with_one_changed(second[0].evaluate, row=2))
    assert not second[0].active[2]
    there = adjust_large(unknowns, first, start, max_iterations=60)
    here = adjust_large(unknowns, (wild, *second[1:]), start, max_iterations=60)
    assert here.cost == pytest.approx(there.cost, rel=1e-12)
    np.testing.assert_allclose(here.state["a"], there.state["a"], rtol=1e-12, atol=1e-12)


def _with_one_changed(evaluate, row: int):
    def changed(state, rows):
        v, J = evaluate(state, rows)
        return v + 1e6 * (rows == row)[:, None], J

    return changed


@pytest.mark.slow
def test_the_same_bits_for_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    _many_fronts(monkeypatch)
    unknowns, records, start = made_problem(2, n_kept=14, n_points=40)
    records = _disturbed(records)
    first = adjust_large(unknowns, records, start, threads=1, reproducible=True, max_iterations=60)
    for threads in (1, 2, 3):
        again = adjust_large(unknowns, records, start, threads=threads, reproducible=True, max_iterations=60)
        assert (again.state["a"] == first.state["a"]).all()
        assert (again.state["p"] == first.state["p"]).all()


def test_the_loss_lowers_the_influence_of_gross_errors() -> None:
    unknowns, records, start = made_problem(4, n_kept=8, n_points=40, rays=5)
    clean = adjust_large(unknowns, records, start, tolerance=1e-6)
    disturbed = _disturbed(records, share=0.05)
    robust = adjust_large(unknowns, disturbed, start, tolerance=1e-6, max_iterations=60)
    squares = adjust_large(unknowns, [replace(r, loss=None) for r in disturbed], start, max_iterations=60)
    near, far = (np.linalg.norm(r.state["a"] - clean.state["a"]) for r in (robust, squares))
    assert near < 0.2 * far
