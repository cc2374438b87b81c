"""The Schur complement solver against a dense reference."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment import factor
from aatri.adjustment.covariance import block_covariances, eliminated_covariances, kept_inverse
from aatri.adjustment.normal import jacobian, layout_of
from aatri.adjustment.solve import adjust_large
from aatri.errors import ConvergenceError, GeometryError
from tests.adjustment.block_problem import made_problem


def _dense(unknowns, records, state):
    """All free columns of the whitened Jacobian, and where each scalar stands."""
    layout = layout_of(unknowns)
    A, E, v = jacobian(records, layout, state)
    free = np.flatnonzero(unknowns[0].free.ravel())
    return np.hstack([A.toarray(), E.toarray()[:, free]]), v, layout


def _reference(unknowns, records, start):
    """Gauss-Newton on the dense Jacobian, by numpy's least squares."""
    state = {k: x.copy() for k, x in start.items()}
    for _ in range(30):
        J, v, layout = _dense(unknowns, records, state)
        dx = np.linalg.lstsq(J, -v, rcond=None)[0]
        state["a"][unknowns[1].free] += dx[: layout.n_kept]
        state["p"][unknowns[0].free] += dx[layout.n_kept :]
    return state


@pytest.mark.parametrize("dense_limit", [6000, 0])
@pytest.mark.parametrize("seed", range(5))
def test_solution_equals_the_dense_reference(monkeypatch: pytest.MonkeyPatch, seed: int, dense_limit: int) -> None:
    monkeypatch.setattr(factor, "DENSE_LIMIT", dense_limit)
    unknowns, records, start = made_problem(seed)
    result = adjust_large(unknowns, records, start, tolerance=1e-9)
    reference = _reference(unknowns, records, start)
    np.testing.assert_allclose(result.state["a"], reference["a"], atol=1e-9)
    np.testing.assert_allclose(result.state["p"], reference["p"], atol=1e-9)


def test_held_scalars_keep_their_value_and_have_no_variance() -> None:
    unknowns, records, start = made_problem()
    result = adjust_large(unknowns, records, start)
    assert result.state["a"][1, 2] == 0.0
    assert (result.state["p"][7] == 0.0).all()
    Q = kept_inverse(result)
    assert (block_covariances(result, "a", Q)[1, 2] == 0).all()
    assert (eliminated_covariances(result, Q)[7] == 0).all()


def test_counts_are_those_of_free_unknowns_and_active_observations() -> None:
    unknowns, records, start = made_problem()
    result = adjust_large(unknowns, records, start)
    assert result.observations == 2 * (36 - 1) + 5 * 4
    assert result.n_unknowns == 5 * 4 - 1 + 12 * 3 - 4
    assert result.redundancy == result.observations - result.n_unknowns
    assert result.sigma0 == pytest.approx(np.sqrt(result.cost / result.redundancy))


@pytest.mark.parametrize("seed", range(3))
def test_covariances_equal_the_dense_inverse(seed: int) -> None:
    unknowns, records, start = made_problem(seed)
    result = adjust_large(unknowns, records, start)
    J, _, layout = _dense(unknowns, records, result.state)
    inverse = np.linalg.inv(J.T @ J)
    Q = kept_inverse(result)
    np.testing.assert_allclose(Q, inverse[: layout.n_kept, : layout.n_kept], rtol=1e-9, atol=1e-12)
    expected = np.zeros((36, 36))
    free = np.flatnonzero(unknowns[0].free.ravel())
    expected[np.ix_(free, free)] = inverse[layout.n_kept :, layout.n_kept :]
    blocks = np.stack([expected[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(12)])
    np.testing.assert_allclose(eliminated_covariances(result, Q), blocks, rtol=1e-9, atol=1e-12)


def test_an_open_kept_unknown_is_named() -> None:
    unknowns, records, start = made_problem()
    # without the prior and with the rays of block a0 switched off nothing determines it
    rays = records[0]
    active = rays.active & (rays.touches[0][1] != 0)
    off = type(rays)(rays.name, rays.touches, rays.evaluate, rays.whitener, active)
    with pytest.raises(GeometryError, match="a0"):
        adjust_large(unknowns, (off,), start)


def test_an_open_point_is_named() -> None:
    unknowns, records, start = made_problem()
    rays = records[0]
    active = rays.active & (rays.touches[1][1] != 9)
    off = type(rays)(rays.name, rays.touches, rays.evaluate, rays.whitener, active)
    with pytest.raises(GeometryError, match="p p9"):
        adjust_large(unknowns, (off, records[1]), start)


def test_no_convergence_is_a_failure_that_names_the_worst_records() -> None:
    unknowns, records, start = made_problem()
    with pytest.raises(ConvergenceError, match="ray row"):
        adjust_large(unknowns, records, start, max_iterations=1)


def test_a_vetoed_step_is_damped() -> None:
    unknowns, records, start = made_problem()
    vetoes = iter(["too far", "still too far"])
    result = adjust_large(unknowns, records, start, veto=lambda old, new: next(vetoes, ""))
    assert [s.damping > 0 for s in result.history][:3] == [False, True, True]
    np.testing.assert_allclose(result.state["a"], _reference(unknowns, records, start)["a"], atol=1e-4)
