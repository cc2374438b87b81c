"""Common points eliminated, against the same problem with its points as unknowns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjusting.added_variance import bent, tie_whitener, typical_variance, whitener_beside
from aatri.adjusting.tied_adjustment import adjust_tied
from aatri.adjusting.tied_problem import tied_problem
from aatri.adjusting.tied_solution import _is_steady
from aatri.adjustment.elimination.reduced import reduced_normals
from aatri.adjustment.statistics.rejection import Snooping
from aatri.adjustment.structure.index_problem import prepare
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.errors import GeometryError
from aatri.observations.control import Control, observed_control
from aatri.observations.observed import Spread
from aatri.observations.poses import POINT
from aatri.observations.ties import BODY, STRIP_TIE, Ties

RNG = np.random.default_rng(11)


def _linear(strip, point, xyz, J, C, *, n_strips: int, held=None):
    """Ties whose points move linearly with the unknowns of their strip."""
    values, vectors = np.linalg.eigh(C)

    def on_ground(state, rows):
        return xyz[rows] + np.einsum("nik,nk->ni", J[rows], state[strip[rows]])

    free = np.ones((n_strips, J.shape[2]), dtype=bool)
    if held is not None:
        free[held] = False
    labels = tuple("abcdef"[: J.shape[2]])
    unknowns = Unknowns(BODY, free, labels, [str(k) for k in range(n_strips)], add_step)
    return Ties(
        strip.astype(np.int32),
        point.astype(np.int32),
        on_ground,
        lambda _, rows: J[rows],
        lambda _: (values, vectors),
        unknowns,
        linear=True,
    )


def _made(n_strips: int = 3, n_points: int = 8, unknowns=2):
    strip, point = (a.ravel() for a in np.indices((n_strips, n_points)))
    keep = RNG.random(len(strip)) < 0.8
    strip, point = strip[keep], point[keep]
    n = len(strip)
    J = RNG.normal(size=(n, 3, unknowns))
    root = RNG.normal(size=(n, 3, 3)) * 0.1
    C = root @ root.swapaxes(1, 2) + 0.01 * np.eye(3)
    xyz = RNG.normal(size=(n, 3))
    return _linear(strip, point, xyz, J, C, n_strips=n_strips)


def _dense(ties, given, tau):
    """Rows T (X - x - J t) with t and X as unknowns: (A, l) of A (t, X) = l."""
    n, n_strips, per_strip, n_points = len(ties.body), *ties.unknowns.free.shape, int(ties.block.max()) + 1
    u = n_strips * per_strip
    nothing = np.zeros((n_strips, per_strip))
    xyz, J = ties.on_ground(nothing, ties.rows), ties.derivatives(nothing, ties.rows)
    spread = Spread(*ties.spectrum(None), lambda state: state)
    (control,) = observed_control(given, np.zeros(3), given.row.astype(np.str_))
    beside = whitener_beside(control, control.covariances(), typical_variance(spread, tau))
    T = np.concatenate([tie_whitener(spread, tau), beside])
    m = n + len(given.point)
    A, rhs = np.zeros((m, 3, u + 3 * n_points)), np.concatenate([xyz, np.where(given.given, given.xyz_m, 0.0)])
    for k in range(n):
        A[k, :, per_strip * ties.body[k] : per_strip * (ties.body[k] + 1)] = -J[k]
    for k, p in enumerate([*ties.block, *given.point]):
        A[k, :, u + 3 * p : u + 3 * p + 3] = np.eye(3)
    return np.einsum("nij,njk->nik", T, A).reshape(3 * m, -1), np.einsum("nij,nj->ni", T, rhs).ravel()


def _given(n: int = 2):
    given = np.array([[True, True, False], [True, True, True]])[:n]
    covariance = np.tile(0.04 * np.eye(3), (n, 1, 1))
    return _control(np.array([0, 3])[:n], RNG.normal(size=(n, 3)), covariance, given)


def _control(point, xyz, covariance, given):
    exact = given & (np.einsum("nii->ni", covariance) == 0)
    return Control(point, point.astype(np.int32), xyz, covariance, given & ~exact, exact)


def _problem(ties, given):
    start, ids = np.zeros(ties.unknowns.free.shape), np.arange(int(ties.block.max()) + 1).astype(np.str_)
    strips = np.array(ties.unknowns.ids, dtype=np.str_)
    observed = [ties.observed(STRIP_TIE, strips[ties.body], ids[ties.block], start)]
    for control in given:
        observed += observed_control(control, np.zeros(3), ids[control.point])
    return tied_problem(observed, {POINT: ties.places(start, len(ids))}, {POINT: ids}, "test")


def _adjusted(ties, given, limit):
    return adjust_tied(_problem(ties, given), Snooping(limit))


def test_what_is_left_open_is_an_error_that_names_the_adjustment() -> None:
    """Four strips of three points that may be shifted, and no control."""
    strip, point = (a.ravel() for a in np.indices((4, 3)))
    eye = np.tile(np.eye(3), (12, 1, 1))
    ties = _linear(strip, point, np.zeros((12, 3)), eye, eye, n_strips=4)
    with pytest.raises(GeometryError, match=r"^test: "):
        _adjusted(ties, [], 1e9)


def test_a_point_in_k_strips_has_own_block_k_minus_1_over_k_and_mutual_block_minus_1_over_k() -> None:
    k = 4
    eye = np.tile(np.eye(3), (k, 1, 1))
    ties = _linear(np.arange(k), np.zeros(k, dtype=int), np.zeros((k, 3)), eye, eye, n_strips=k)
    records = replace(ties.records(STRIP_TIE), whitener=eye)
    unknowns = [ties.unknowns, Unknowns(POINT, np.ones((1, 3), dtype=bool), tuple("XYZ"), ["1"], add_step, True)]
    state = {BODY: np.zeros((k, 3)), POINT: np.zeros((1, 3))}
    N = reduced_normals(prepare(unknowns, [records]), state).N
    np.testing.assert_allclose(N, np.kron(np.eye(k) - np.ones((k, k)) / k, np.eye(3)), atol=1e-14)


def test_results_and_tests_equal_the_dense_adjustment() -> None:
    ties, given = _made(n_points=12), _given()
    found = _adjusted(ties, [given], 1e9)
    assert found.tau_m > 0  # the made-up coordinates disagree by far more than their covariances say
    A, rhs = _dense(ties, given, found.tau_m)
    A = A[:, np.linalg.norm(A, axis=0) > 0]
    Q = np.linalg.inv(A.T @ A)
    x = Q @ (A.T @ rhs)
    v = A @ x - rhs
    np.testing.assert_allclose(found.state[BODY].ravel(), x[:6], rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(np.einsum("nii->ni", found.covariances[BODY]).ravel(), np.diag(Q)[:6], rtol=1e-7)
    cofactor = np.eye(len(v)) - A @ Q @ A.T
    n = len(ties.body)
    for k in range(n):
        rows = slice(3 * k, 3 * k + 3)
        if np.trace(cofactor[rows, rows]) < 1e-6:  # the only observation of its point
            assert np.isnan(found.test[k])
            continue
        expected = np.sqrt(v[rows] @ np.linalg.solve(cofactor[rows, rows], v[rows]) / 3)
        assert found.test[k] == pytest.approx(expected, rel=1e-6)
    assert (v[: 3 * n] ** 2).sum() == pytest.approx(np.diag(cofactor)[: 3 * n].sum(), rel=0.1)


def test_what_is_rejected_is_predicted_by_the_others() -> None:
    ties, given = _made(n_points=12), _given()
    out = 5
    active = np.ones(len(ties.body) + 2, dtype=bool)
    active[out] = False
    found = adjust_tied(_problem(ties, [given]), Snooping(1e-9), active=active)
    # With a limit of nothing whatever is rejected stays so; at least the tie is.
    assert not found.active[out]
    use = np.repeat(found.active, 3)
    A, rhs = _dense(ties, given, found.tau_m)
    columns = np.linalg.norm(A[use], axis=0) > 0
    rows = slice(3 * out, 3 * out + 3)
    assert (np.linalg.norm(A[rows], axis=0) > 0)[~columns].sum() == 0
    Q = np.linalg.inv(A[use][:, columns].T @ A[use][:, columns])
    x = Q @ A[use][:, columns].T @ rhs[use]
    v = A[rows][:, columns] @ x - rhs[rows]
    cofactor = np.eye(3) + A[rows][:, columns] @ Q @ A[rows][:, columns].T
    assert found.test[out] == pytest.approx(np.sqrt(v @ np.linalg.solve(cofactor, v) / 3), rel=1e-6)


def test_exact_control_holds_and_plan_only_control_leaves_heights_alone() -> None:
    xyz = np.array([[0.0, 0, 5], [10, 0, 6], [0, 10, 7]])
    known = np.array([[True, True, False], [True, True, True], [False, False, False]])
    given = _control(np.arange(3), xyz + np.array([1.0, 2.0, 3.0]), np.zeros((3, 3, 3)), known)
    eye = np.tile(np.eye(3), (3, 1, 1))
    ties = _linear(np.zeros(3, dtype=int), np.arange(3), xyz, eye, 0.01 * eye, n_strips=1)
    found = _adjusted(ties, [given], 4)
    np.testing.assert_allclose(found.state[BODY][0], [1.0, 2.0, 3.0], atol=1e-12)
    assert np.isnan(found.residuals[3, 2])


def test_a_wrong_tie_is_rejected_and_its_size_estimated() -> None:
    n = 20
    strip, point = np.repeat([0, 1, 2], n), np.tile(np.arange(n), 3)
    true = RNG.uniform(0, 100, (n, 3))
    shift = np.array([[0.0, 0, 0], [1, 2, 3], [-4, 5, 6]])
    xyz = true[point] - shift[strip] + RNG.normal(0, 0.01, (3 * n, 3))
    xyz[n + 7] += [0.0, 0.0, 0.5]
    eye = np.tile(np.eye(3), (3 * n, 1, 1))
    ties = _linear(strip, point, xyz, eye, 1e-4 * eye, n_strips=3, held=0)
    found = _adjusted(ties, [], 5)
    assert np.flatnonzero(~found.active).tolist() == [n + 7]
    assert found.size[n + 7] == pytest.approx([0.0, 0.0, 0.5], abs=0.06)
    assert found.state[BODY][1:].ravel() == pytest.approx([1, 2, 3, -4, 5, 6], abs=0.02)


@pytest.mark.parametrize(("leverage", "rejected"), [(0.1, True), (1e-3, False)])
def test_control_that_alone_determines_something_is_kept_and_named_however_large_its_test(
    leverage: float, rejected: bool
) -> None:
    n = 400
    rng = np.random.default_rng(4)
    xyz = rng.uniform(0, 100, (n, 3))
    J = np.zeros((n, 3, 4))
    J[:, :, :3] = np.eye(3)
    J[:, 0, 3] = leverage * rng.choice([-1.0, 1.0], n)
    J[0, 0, 3] = 1.0  # what the fourth unknown moves: the first point, the others hardly
    eye = np.tile(np.eye(3), (n, 1, 1))
    ties = _linear(np.zeros(n, dtype=int), np.arange(n), xyz, J, 1e-4 * eye, n_strips=1)
    given = xyz + rng.normal(0, 0.01, (n, 3))
    given[0, 0] += 100.0
    control = _control(np.arange(n), given, 1e-4 * eye, np.ones((n, 3), dtype=bool))
    found = _adjusted(ties, [control], 4)
    assert found.test[n] > 4
    assert np.flatnonzero(~found.active).tolist() == ([n] if rejected else [])
    assert found.above[[0, n]].tolist() == [not rejected] * 2


@pytest.mark.parametrize("wrong", [False, True])
def test_ties_that_a_bent_end_moves_together_are_right_and_a_single_wrong_one_among_them_is_not(wrong: bool) -> None:
    """Three strips of 200 common points, shifted only; the last tenth of one rises to 20 standard deviations."""
    n, rng = 200, np.random.default_rng(5)
    strip, point = (a.ravel() for a in np.indices((3, n)))
    true = np.column_stack([np.linspace(0, 1000, n), rng.uniform(0, 50, n), np.zeros(n)])
    xyz = np.tile(true, (3, 1)) + rng.normal(0, 0.01, (3 * n, 3))
    bent = np.flatnonzero((strip == 2) & (xyz[:, 0] > 900))
    xyz[bent, 2] += 0.2 * (xyz[bent, 0] - 900) / 100
    xyz[bent[12], 2] += 0.5 * wrong
    eye = np.tile(np.eye(3), (3 * n, 1, 1))
    ties = _linear(strip, point, xyz, eye, 1e-4 * eye, n_strips=3)
    control = _control(np.arange(0, n, 20), true[::20], np.tile(1e-4 * np.eye(3), (10, 1, 1)), np.ones((10, 3), bool))
    adjusted = _adjusted(ties, [control], 4.5)
    rejected = np.flatnonzero(~adjusted.active[: 3 * n])
    assert rejected.tolist() == ([bent[12]] if wrong else [])


@pytest.mark.parametrize("size_m", [0.2, 1.0])
def test_neighbouring_ties_that_are_wrong_together_are_no_bend(size_m: float) -> None:
    """They begin at once: the ties beside them are right."""
    n, rng = 200, np.random.default_rng(5)
    strip, point = (a.ravel() for a in np.indices((3, n)))
    true = np.column_stack([np.linspace(0, 1000, n), rng.uniform(0, 50, n), np.zeros(n)])
    xyz = np.tile(true, (3, 1)) + rng.normal(0, 0.01, (3 * n, 3))
    wrong = 2 * n + np.arange(90, 100)
    xyz[wrong, 2] += size_m
    eye = np.tile(np.eye(3), (3 * n, 1, 1))
    ties = _linear(strip, point, xyz, eye, 1e-4 * eye, n_strips=3)
    control = _control(np.arange(0, n, 20), true[::20], np.tile(1e-4 * np.eye(3), (10, 1, 1)), np.ones((10, 3), bool))
    adjusted = _adjusted(ties, [control], 4.5)
    assert np.flatnonzero(~adjusted.active[: 3 * n]).tolist() == wrong.tolist()


@pytest.mark.parametrize(("neighbours", "bends"), [(5.0, True), (0.0, False)])
def test_a_tie_just_above_the_limit_is_right_where_the_nearest_below_it_err_by_as_much(
    neighbours: float, bends: bool
) -> None:
    """Their tests need not be large: what holds a point in one body alone takes up most of what it errs."""
    n, eye = 40, np.tile(np.eye(3), (40, 1, 1))
    xyz, residual, test = np.column_stack([np.arange(n), np.zeros((n, 2))]), np.zeros((n, 3)), np.full(n, 1.0)
    residual[:, 2], residual[7, 2], test[7] = neighbours, 5.7, 5.7
    line = np.zeros(n, dtype=np.int64)
    assert (
        np.flatnonzero(bent(line, xyz, residual, eye, eye, test, np.ones(n, dtype=bool), 5.6)).tolist() == [7] * bends
    )


def test_what_is_open_is_an_error_that_names_the_problem() -> None:
    """One strip without any control: all its coefficients are open."""
    eye = np.tile(np.eye(3), (4, 1, 1))
    ties = _linear(np.zeros(4, dtype=int), np.arange(4), RNG.normal(size=(4, 3)), eye, eye, n_strips=1)
    with pytest.raises(GeometryError, match=r"^test: the observations leave"):
        _adjusted(ties, [], 5.0)


@pytest.mark.parametrize(("share", "steady"), [(0.9, True), (1.1, False)])
def test_covariances_are_steady_by_their_share_of_those_with_the_deformation_added(share: float, steady: bool) -> None:
    """Of equal eigenvalues: (after - before) / (before + tau^2), against a thousandth."""
    tau_m, before, vectors = 0.1, np.full((4, 3), 1e-4), np.tile(np.eye(3), (4, 1, 1))
    after = before.copy()
    after[2] += 1e-3 * share * (before[2] + tau_m**2)
    one, other = (Spread(values, vectors, lambda _: other) for values in (before, after))
    assert _is_steady(one, other, tau_m) == steady
