"""Common points eliminated, against the same problem with its points as unknowns."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.orientation.free_block.tie_elimination import Control, Linearised, eliminate, observations_of, whitening
from aatri.orientation.free_block.tied_adjustment import Problem, adjust_tied

RNG = np.random.default_rng(11)


def _linear_problem(n_strips=3, n_points=8, unknowns=2, control=None):
    strip, point = (a.ravel() for a in np.indices((n_strips, n_points)))
    keep = RNG.random(len(strip)) < 0.8
    strip, point = strip[keep], point[keep]
    observations = observations_of(strip, point, n_points, control)
    n = len(observations.strip)
    J = RNG.normal(size=(n, 3, unknowns))
    root = RNG.normal(size=(n, 3, 3)) * 0.1
    C = root @ root.swapaxes(1, 2) + 0.01 * np.eye(3)
    if control is not None:
        C[len(strip) :] = control.covariance_m2
    linear = Linearised(RNG.normal(size=(n, 3)), J, C)
    return observations, linear


def _moved(observations, linear, t):
    of_block = t.reshape(observations.n_blocks, -1)[observations.block] * (observations.block >= 0)[:, None]
    return np.einsum("nik,nk->ni", linear.jacobian, of_block)


def _dense(observations, linear, tau=0.0):
    """Rows T (X - x - J t) with t and X as unknowns: (A, l) of A (t, X) = l."""
    n, per_block = len(observations.strip), linear.jacobian.shape[2]
    u = per_block * observations.n_blocks
    T = whitening(observations, linear.covariance_m2, tau)
    A = np.zeros((3 * n, u + 3 * observations.n_points))
    for k, block in enumerate(observations.block):
        if block >= 0:
            A[3 * k : 3 * k + 3, per_block * block : per_block * (block + 1)] = -linear.jacobian[k]
    for k, p in enumerate(observations.point):
        A[3 * k : 3 * k + 3, u + 3 * p : u + 3 * p + 3] = np.eye(3)
    A = np.einsum("nij,njk->nik", T, A.reshape(n, 3, -1)).reshape(3 * n, -1)
    return A, np.einsum("nij,nj->ni", T, linear.xyz_m).ravel()


def _control(n=2):
    given = np.array([[True, True, False], [True, True, True]])[:n]
    return Control(np.array([0, 3])[:n], RNG.normal(size=(n, 3)), np.tile(0.04 * np.eye(3), (n, 1, 1)), given)


def test_eliminating_points_equals_rigorous_adjustment_with_points_as_unknowns():
    observations, linear = _linear_problem(control=_control())
    use = np.ones(len(observations.strip), dtype=bool)
    system = eliminate(observations, linear, use, 0.0)
    A, rhs = _dense(observations, linear)
    full = np.linalg.lstsq(A, rhs, rcond=None)[0]
    np.testing.assert_allclose(np.linalg.solve(system.N, system.g), full[: len(system.g)], rtol=1e-9, atol=1e-10)


def test_a_point_in_k_strips_has_own_block_k_minus_1_over_k_and_mutual_block_minus_1_over_k():
    k = 4
    observations = observations_of(np.arange(k), np.zeros(k, dtype=int), 1)
    linear = Linearised(np.zeros((k, 3)), np.tile(np.eye(3), (k, 1, 1)),
                        np.tile(np.eye(3), (k, 1, 1)))  # fmt: skip
    N = eliminate(observations, linear, np.ones(k, dtype=bool), 0.0).N
    np.testing.assert_allclose(N, np.kron(np.eye(k) - np.ones((k, k)) / k, np.eye(3)), atol=1e-14)


def test_results_and_tests_equal_the_dense_adjustment():
    observations, linear = _linear_problem(n_points=12, control=_control())

    def at(t):
        return Linearised(linear.xyz_m + _moved(observations, linear, t), linear.jacobian, linear.covariance_m2)

    problem = Problem(observations, at, lambda t, d: t + d, "test")
    found = adjust_tied(problem, np.zeros(6), limit=1e9)
    assert found.tau_m > 0  # the made-up coordinates disagree by far more than their covariances say
    A, rhs = _dense(observations, linear, found.tau_m)
    A = A[:, np.linalg.norm(A, axis=0) > 0]
    Q = np.linalg.inv(A.T @ A)
    x = Q @ (A.T @ rhs)
    v = A @ x - rhs
    np.testing.assert_allclose(found.state, x[:6], rtol=1e-7, atol=1e-9)
    cofactor = np.eye(len(v)) - A @ Q @ A.T
    k = 4  # any observation of a strip
    rows = slice(3 * k, 3 * k + 3)
    expected = np.sqrt(v[rows] @ np.linalg.solve(cofactor[rows, rows], v[rows]) / 3)
    assert found.test[k] == pytest.approx(expected, rel=1e-6)
    strips = np.repeat(observations.strip >= 0, 3)
    assert (v[strips] ** 2).sum() == pytest.approx(np.diag(cofactor)[strips].sum(), rel=0.1)


def test_exact_control_holds_and_plan_only_control_leaves_heights_alone():
    strip, point = np.zeros(3, dtype=int), np.arange(3)
    xyz = np.array([[0.0, 0, 5], [10, 0, 6], [0, 10, 7]])
    given = np.array([[True, True, False], [True, True, True], [False, False, False]])
    control = Control(np.arange(3), xyz + np.array([1.0, 2.0, 3.0]), np.zeros((3, 3, 3)), given)
    observations = observations_of(strip, point, 3, control)
    J = np.concatenate([np.tile(np.eye(3), (3, 1, 1)), np.zeros((3, 3, 3))])

    def at(t):
        x = np.concatenate([xyz + t, np.where(given, control.xyz_m, 0.0)])
        C = np.concatenate([np.tile(0.01 * np.eye(3), (3, 1, 1)), control.covariance_m2])
        return Linearised(x, J, C)

    found = adjust_tied(Problem(observations, at, lambda t, d: t + d, "test"), np.zeros(3), limit=4)
    np.testing.assert_allclose(found.state, [1.0, 2.0, 3.0], atol=1e-12)
    assert np.isnan(found.residual_m[3, 2])


def test_a_wrong_tie_is_rejected_and_its_size_estimated():
    n = 20
    strip, point = np.repeat([0, 1, 2], n), np.tile(np.arange(n), 3)
    true = RNG.uniform(0, 100, (n, 3))
    shift = np.array([[0.0, 0, 0], [1, 2, 3], [-4, 5, 6]])
    xyz = true[point] - shift[strip] + RNG.normal(0, 0.01, (3 * n, 3))
    xyz[n + 7] += [0.0, 0.0, 0.5]
    observations = observations_of(strip, point, n, held=0)
    J = np.tile(np.eye(3), (3 * n, 1, 1))

    def at(t):
        moved = np.concatenate([np.zeros((1, 3)), t.reshape(2, 3)])
        C = np.tile(1e-4 * np.eye(3), (3 * n, 1, 1))
        return Linearised(xyz + moved[strip], J, C)

    found = adjust_tied(Problem(observations, at, lambda t, d: t + d, "test"), np.zeros(6), limit=5)
    assert np.flatnonzero(~found.active).tolist() == [n + 7]
    assert found.size_m[n + 7] == pytest.approx([0.0, 0.0, 0.5], abs=0.06)
    assert found.state == pytest.approx([1, 2, 3, -4, 5, 6], abs=0.02)
