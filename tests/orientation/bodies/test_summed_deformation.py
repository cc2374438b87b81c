"""Deformations that add up along strips: their shape, their variance, and standard deviations that hold for them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from aatri.geometry.strip_bases import strip_axes
from aatri.observations.control import Control
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.deformation_components import deformation_components
from aatri.orientation.bodies.deformed_covariances import _inverses, covariance_notes, deformed_covariances
from aatri.orientation.bodies.deformed_normals import DeformedTies, of_control
from aatri.orientation.bodies.strip_polynomials import adjust_strip_polynomials
from aatri.orientation.bodies.summed_deformation import COMPONENT, COMPONENTS, SCALE, causes, covariances

MODELS, BASE_M, WIDTH_M = 20, 100.0, 360.0


def test_legendre_coefficients_of_a_random_walk_hold_all_of_its_variance() -> None:
    # int_0^1 t dt = 1/2, of which the mean takes int int min(s, t) = 1/3; squares of P_a have the mean 1 / (2a + 1).
    # The degrees above 59 have 1 / (8 * 59).
    a = np.arange(1, 60)
    K = covariances(tuple(a.tolist()), 1)
    assert (K.diagonal() / (2 * a + 1)).sum() == pytest.approx(1 / 2 - 1 / 3 - 1 / (8 * 59), rel=1e-3)


def test_white_noise_summed_twice_less_its_best_line_has_the_variance_of_the_law() -> None:
    # 1/420, as `deformation` has it.
    a = np.arange(2, 40)
    K = covariances(tuple(a.tolist()), 2)
    assert (K.diagonal() / (2 * a + 1)).sum() == pytest.approx(1 / 420, rel=1e-4)


def test_covariances_of_coefficients_are_those_of_summed_random_numbers() -> None:
    rng, n, u = np.random.default_rng(3), 400, (np.arange(400) + 0.5) / 200 - 1
    walks = np.cumsum(rng.standard_normal((4000, n)), axis=1) / np.sqrt(n)
    twice = np.cumsum(walks, axis=1) / n
    second, third = (3 * u**2 - 1) / 2, (5 * u**3 - 3 * u) / 2
    found = np.cov([twice @ second * 5 / n, twice @ third * 7 / n])
    np.testing.assert_allclose(found.diagonal(), covariances((2, 3), 2).diagonal(), rtol=0.1)


def test_variances_of_two_components_come_out_as_put_in() -> None:
    rng, found = np.random.default_rng(5), []
    component = np.repeat([0, 1], 40)
    root = rng.standard_normal((80, 90)) * np.repeat([3.0, 1.0], 40)[:, None]
    S, true, phi = root @ root.T, np.array([0.25, 1.0]), 0.5
    L = np.linalg.cholesky(S)
    for _ in range(40):
        z = rng.standard_normal(80) * np.sqrt(true[component])
        noise = np.sqrt(phi) * rng.standard_normal(500)
        # A regression of 500 observations on 80 deformations, turned so that the first 80 hold all there is of them.
        y = L.T @ z + noise[:80]
        squares = float(y @ y + noise[80:] @ noise[80:])
        estimate = deformation_components(csr_array(S), L @ y, component, 0 * component, squares, 500, 0.0)
        found.append([*(estimate.variance / true), estimate.phi / phi])
        assert estimate.redundancy.sum() < 80
    # Forty times at least thirty degrees of freedom: the mean is known to 4 %.
    np.testing.assert_allclose(np.mean(found, axis=0), 1.0, atol=0.12)


def test_bodies_of_which_one_errs_by_more_come_out_as_put_in() -> None:
    rng, found = np.random.default_rng(6), []
    component, body, size = np.tile([0, 1], 40), np.repeat(np.arange(4), 20), np.array([0.4, 0.4, 0.4, 2.8])
    root = rng.standard_normal((80, 90)) * 6.0
    S, true = root @ root.T, np.array([0.25, 1.0])
    L = np.linalg.cholesky(S)
    for _ in range(40):
        y = L.T @ (rng.standard_normal(80) * np.sqrt(true[component] * size[body])) + rng.standard_normal(80)
        squares = float(y @ y + rng.chisquare(420))
        estimate = deformation_components(csr_array(S), L @ y, component, body, squares, 500, 0.0)
        found.append([*(estimate.variance / true), *(estimate.size / size)])
    found = np.mean(found, axis=0)
    np.testing.assert_allclose(found[[0, 1, 5]], 1.0, atol=0.3)
    assert (found[2:5] < 2.0).all()  # ten redundancies say 1 beforehand, some twenty are there


def test_a_walk_of_the_scale_lengthens_widens_and_lowers_as_its_sums_do() -> None:
    rng, n, u = np.random.default_rng(4), 400, (np.arange(400) + 0.5) / 200 - 1
    # Half lengths of 1000 and 300 m, cameras 50 m aside and 500 m above, 25 models; walks of unit variance a joint.
    walk = 5 * np.cumsum(rng.standard_normal((4000, n)), axis=1) / np.sqrt(n)
    summed = np.cumsum(walk, axis=1) * 2000 / n
    P = [np.ones(n), u, (3 * u**2 - 1) / 2, (5 * u**3 - 3 * u) / 2]
    sampled = np.stack([summed @ P[2] * 5, 300 * walk @ P[1] * 3, -50 * walk @ P[1] * 3, -500 * walk @ P[1] * 3]) / n
    made = causes(np.array([[1000.0, 300.0]]), np.array([[50.0, 500.0]]), np.array([25]), 13)[0]
    rows = np.stack([made[0, 2], made[1, 8], made[1, 1], made[2, 1]])[:, COMPONENT == SCALE]
    scale = np.sqrt(np.outer(*2 * [np.einsum("ij,ij->i", rows, rows)]))
    np.testing.assert_allclose(np.cov(sampled) / scale, rows @ rows.T / scale, atol=0.08)


def _walked(rng: np.random.Generator, X, start_m, lasting=4e-5, passing=0.0):
    """A deformation by joints that err, and by bases and images: (dU, dV, dW) of points, the cameras 400 m high."""
    stations = np.arange(MODELS + 1) * BASE_M
    scale, azimuth, pitch, roll = lasting * np.cumsum(rng.standard_normal((4, MODELS + 1)), axis=1)
    along = X[:, 0] - start_m
    base, image = passing * rng.standard_normal((2, MODELS + 1))

    def at(values):
        return np.interp(along, stations, values)

    def summed(values):
        return at(np.concatenate([[0.0], np.cumsum(values[:-1])]) * BASE_M)

    return np.column_stack(
        [
            summed(scale) - X[:, 1] * at(azimuth),
            summed(azimuth + base) + X[:, 1] * at(scale),
            summed(pitch) + X[:, 1] * at(roll + image) - (400 - X[:, 2]) * at(scale),
        ]
    )


def _errors_and_variances(seed: int, strips=6, every=23, **errors):
    """Mean squares of true errors and of standard deviations of a made-up block of parallel strips."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(
        np.arange(0, MODELS * BASE_M + 1, 50.0), np.arange(-180, 300 * strips - 119, 30.0), indexing="ij"
    )
    truth = np.column_stack([x.ravel(), y.ravel(), rng.uniform(0, 20, x.size)])
    parts, axes, members = [], [], []
    for k in range(strips):
        mine = np.flatnonzero(abs(truth[:, 1] - 300 * k) <= WIDTH_M / 2)
        local = truth[mine] - [0, 300 * k, 0]
        parts.append(truth[mine] + _walked(rng, local, 0.0, **errors) + rng.normal(0, 0.01, (len(mine), 3)))
        axes.append(
            strip_axes(
                parts[-1],
                np.column_stack(
                    [np.arange(MODELS + 1) * BASE_M, np.full(MODELS + 1, 300.0 * k), np.full(MODELS + 1, 400.0)]
                ),
            )
        )
        members.append(mine)
    n = [len(p) for p in parts]
    points = BodyPoints(
        np.repeat(np.arange(strips), n),
        np.concatenate(members),
        np.concatenate(parts),
        np.tile(1e-4 * np.eye(3), (sum(n), 1, 1)),
    )
    rows = np.arange(0, len(truth), every)
    exact = np.zeros((len(rows), 3, 3))
    control = Control(
        np.arange(len(rows)),
        rows,
        truth[rows],
        exact,
        np.zeros((len(rows), 3), dtype=bool),
        np.ones((len(rows), 3), dtype=bool),
    )
    found = adjust_strip_polynomials(points, len(truth), axes, control)
    deformed = deformed_covariances(found, points, len(truth), axes, control, np.full(strips, MODELS))
    new = np.setdiff1d(np.arange(len(truth)), rows)
    error, C = found.point_m - truth, deformed.point_covariance_m2
    return np.array([(error[new] ** 2).mean(axis=0), np.einsum("nii->ni", C[new]).mean(axis=0)]), deformed


def test_a_normal_matrix_that_rounding_leaves_indefinite_gives_what_the_exact_one_gives() -> None:
    """Of points at infinity it is a difference of large numbers: here 1e-5 of its largest is lost."""
    rng = np.random.default_rng(7)
    vectors = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    exact, lost = (vectors * v @ vectors.T for v in ([1e9, 1e8, 1e7, 1e6, 0.0, 0.0], [1e9, 1e8, 1e7, 1e6, -1e4, -1e4]))
    component, g = np.array([0, 0, 0, 1, 1, 1]), exact @ rng.normal(0, 30.0, 6)
    wanted = deformation_components(csr_array(exact), g, component, 0 * component, 400.0, 200, 0.5)
    found = deformation_components(csr_array(lost), g, component, 0 * component, 400.0, 200, 0.5)
    np.testing.assert_allclose(found.variance, wanted.variance, rtol=1e-3)
    np.testing.assert_allclose(found.redundancy, wanted.redundancy, rtol=1e-3)
    assert not len(
        deformation_components(csr_array(exact[:0, :0]), g[:0], component[:0], component[:0], 400.0, 200, 0.5).variance
    )


def test_nuisances_beside_deformations_are_what_their_elimination_leaves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two bodies of twelve deformations and three nuisances each, in a regression of 300 observations."""
    monkeypatch.setattr("aatri.orientation.bodies.deformation_components.SETTLED", 1e-9)
    rng = np.random.default_rng(8)
    A, y = rng.normal(size=(300, 30)), rng.normal(size=300)
    body, nuisance = np.repeat([0, 1], 15), np.tile(np.arange(15) < 3, 2)
    y += A[:, ~nuisance] @ rng.normal(0, 0.3, 24) + A[:, nuisance] @ rng.normal(0, 100.0, 6)
    component = np.where(nuisance, -1, np.tile(np.arange(15) % 2, 2))
    together = deformation_components(csr_array(A.T @ A), A.T @ y, component, body, float(y @ y), 300, 0.0)
    Q = np.linalg.qr(A[:, nuisance], mode="complete")[0][:, 6:]
    B, x = Q.T @ A[:, ~nuisance], Q.T @ y
    apart = deformation_components(
        csr_array(B.T @ B), B.T @ x, component[~nuisance], body[~nuisance], float(x @ x), 294, 0.0
    )
    # A deformation that nothing shows is none.
    unseen = [np.append(x, last) for x, last in ((A.T @ y, 0.0), (component, 0), (body, 0))]
    beside = deformation_components(csr_array(np.pad(A.T @ A, (0, 1))), *unseen, float(y @ y), 300, 0.0)
    np.testing.assert_allclose(beside.redundancy, together.redundancy, rtol=1e-3)
    # A third body that has nothing but a nuisance, as a strip whose deformations are taken up whole.
    N = np.pad(A.T @ A, (0, 1)) + np.diag(np.eye(31)[30])
    more = [np.append(x, last) for x, last in ((A.T @ y, 0.0), (component, -1), (body, 2))]
    with_third = deformation_components(csr_array(N), *more, float(y @ y), 301, 0.0)
    of_bodies = np.outer(together.variance, together.size)
    np.testing.assert_allclose(np.outer(with_third.variance, with_third.size)[:, :2], of_bodies, rtol=1e-2)
    for name in ("variance", "redundancy", "size", "phi"):
        np.testing.assert_allclose(getattr(together, name), getattr(apart, name), rtol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("lasting", "passing"), [(4e-5, 0.0), (4e-5, 1e-4)])
def test_standard_deviations_of_strips_that_sum_up_errors_hold(lasting: float, passing: float) -> None:
    errors = {"lasting": lasting, "passing": passing}
    squares = np.array([_errors_and_variances(seed, **errors)[0] for seed in range(1, 9)]).sum(axis=0)
    ratio = np.sqrt(squares[0] / squares[1])
    assert ((ratio > 0.7) & (ratio < 1.4)).all(), ratio


def test_a_single_strip_with_little_control_has_no_standard_deviations_and_says_so() -> None:
    _, deformed = _errors_and_variances(1, strips=1, every=70)
    assert np.isnan(deformed.point_covariance_m2).all()
    assert min(deformed.redundancy.values()) < 10
    (note,) = covariance_notes(deformed)
    assert "not estimable" in note.text


def test_how_far_joints_err_is_told() -> None:
    _, deformed = _errors_and_variances(1, strips=9)
    (note,) = covariance_notes(deformed)
    assert "joints, tilt across" in note.text
    joints = [deformed.sigma[name] for name in COMPONENTS[:4]]
    assert joints == pytest.approx([4e-5] * 4, rel=0.3)


@pytest.mark.slow
def test_what_bases_err_by_alone_is_told_apart_from_what_lasts() -> None:
    found = [_errors_and_variances(seed, strips=9, passing=4e-4)[1].sigma for seed in range(1, 5)]
    assert np.mean([sigma["bases, azimuth"] for sigma in found]) == pytest.approx(4e-4, rel=0.2)
    in_plan = [sigma.get("joints, in plan", sigma.get("joints, scale", 0.0)) for sigma in found]
    assert np.mean(in_plan) == pytest.approx(4e-5, rel=0.3)


def test_height_control_whose_ties_are_all_rejected_has_a_weight_in_height_alone() -> None:
    weights = np.stack([np.diag([0.0, 0.0, 4.0]), np.zeros((3, 3)), np.diag([1.0, 2.0, 4.0])])
    np.testing.assert_allclose(_inverses(weights)[[0, 2], 2, 2], 0.25)
    assert np.isfinite(_inverses(weights)).all()


def test_without_a_control_point_among_the_ties_nothing_is_brought_in() -> None:
    nothing = np.zeros(0, dtype=np.int64)
    ties = DeformedTies(nothing, nothing, nothing, np.zeros((0, 3, 3)), np.zeros((0, 3, 3)), np.zeros((0, 5)))
    assert of_control(ties, 4, np.zeros((2, 3, 3)), nothing, np.zeros((0, 3, 3))).shape == (4, 15, 0)
