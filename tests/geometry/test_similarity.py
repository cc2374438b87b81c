"""Similarities in space, against closed forms, published examples and complex-step derivatives."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from scipy.linalg import expm

from aatri.geometry.rotations import angles_from_rotation, exp_rotation, skew
from aatri.geometry.similarity import (
    Similarity,
    centroid_normals,
    closed_form,
    compose,
    from_centroids,
    inverse,
    jacobian,
    robust_closed_form,
    transform,
    transform_covariance,
    updated,
)
from tests.complex_step import complex_step

RNG = np.random.default_rng(7)
X = RNG.normal(0, 1, (12, 3))
TRUE = Similarity(np.array([4.0, -7.0, 2.0]), 3.5, exp_rotation(np.array([2.0, -1.0, 0.7])))


@pytest.fixture(scope="module")
def examples(shared_data):
    text = (shared_data / "worked_examples" / "absolute_orientation.yaml").read_text()
    return {example["id"]: example for example in yaml.safe_load(text)}


def _opk(rotation):
    return np.rad2deg(angles_from_rotation(rotation, "omega-phi-kappa"))


def test_any_rotation_is_found_exactly_without_initial_values() -> None:
    found = closed_form(X, transform(TRUE, X))
    np.testing.assert_allclose(found.rotation, TRUE.rotation, atol=1e-14)
    np.testing.assert_allclose(found.translation, TRUE.translation, atol=1e-13)
    assert found.scale == pytest.approx(3.5, rel=1e-14)


def test_points_in_a_plane_do_not_make_a_reflection() -> None:
    flat = X * [1.0, 1.0, 0.0]
    found = closed_form(flat, transform(TRUE, flat))
    assert np.linalg.det(found.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(found.rotation, TRUE.rotation, atol=1e-13)


def test_jacobian_equals_complex_step():
    def f(t):
        rotation = expm(skew(t[3:6])) @ TRUE.rotation
        arm = TRUE.scale * np.exp(t[6]) * X
        return TRUE.translation + t[:3] + arm @ rotation.T

    np.testing.assert_allclose(jacobian(TRUE, X).reshape(-1, 7), complex_step(f, np.zeros(7)), rtol=1e-12, atol=1e-13)


def test_update_inverse_and_composition_agree() -> None:
    step = np.array([0.1, 0.2, -0.1, 0.02, -0.03, 0.01, 0.04])
    moved = updated(TRUE, step)
    assert moved.scale == pytest.approx(3.5 * np.exp(0.04))
    np.testing.assert_allclose(transform(inverse(moved), transform(moved, X)), X, atol=1e-13)
    np.testing.assert_allclose(transform(compose(moved, TRUE), X), transform(moved, transform(TRUE, X)), atol=1e-12)


def test_covariance_turns_and_scales_with_the_points() -> None:
    C = np.diag([1.0, 4.0, 9.0])[None]
    expected = 3.5**2 * TRUE.rotation @ C[0] @ TRUE.rotation.T
    np.testing.assert_allclose(transform_covariance(TRUE, C)[0], expected)


def test_a_third_of_wrong_points_do_not_disturb_the_robust_form() -> None:
    target = transform(TRUE, X)
    target[[1, 4, 6, 9]] += [[30, 5, 2], [-3, 40, 7], [8, 8, -50], [20, -20, 10]]
    found, distance = robust_closed_form(X, target)
    assert np.linalg.norm(found.rotation - TRUE.rotation) < 1e-6
    assert set(np.argsort(-distance)[:4]) == {1, 4, 6, 9}


def _both(example, model, ground):
    return np.array(list(example[model].values())), np.array(list(example[ground].values()))


def test_mikhail_six_points(examples) -> None:
    # object = lambda M model + T, where M' = Rx(omega) Ry(phi) Rz(kappa)
    example = examples["mikhail_ao"]
    answer = example["answer_converged_here"]
    found = closed_form(*_both(example, "model_mm", "object_m"))
    assert found.scale == pytest.approx(answer["lambda"], abs=1e-8)
    angles = [answer["omega_deg"], answer["phi_deg"], answer["kappa_deg"]]
    np.testing.assert_allclose(_opk(found.rotation.T), angles, atol=1e-7)
    np.testing.assert_allclose(found.translation, answer["T"], atol=1e-6)


def test_dewitt_program_3dconf(examples) -> None:
    # X = scale M' x + T
    example = examples["dewitt_3dconf"]
    both, answer = np.array(list(example["control"].values())), example["answer"]
    x, ground = both[:, :3], both[:, 3:]
    found = closed_form(x, ground)
    assert found.scale == pytest.approx(answer["scale"], abs=5e-6)
    angles = [answer["omega_deg"], answer["phi_deg"], answer["kappa_deg"]]
    np.testing.assert_allclose(_opk(found.rotation), angles, atol=6e-5)
    np.testing.assert_allclose(found.translation, answer["T"], atol=6e-4)
    residual = transform(found, x) - ground
    assert np.sqrt((residual**2).sum() / (residual.size - 7)) == pytest.approx(answer["s0"], abs=6e-6)
    new = np.array(list(example["unknown"].values()))
    np.testing.assert_allclose(transform(found, new), list(answer["transformed"].values()), atol=6e-4)


def test_six_points_far_from_the_origin(examples) -> None:
    example = examples["whu_ao_6pt"]
    both, answer = np.array(list(example["points"].values())), example["answer_converged_here"]
    found = closed_form(both[:, :3], both[:, 3:])
    assert found.scale == pytest.approx(answer["lambda"], rel=1e-10)
    angles = [answer["omega_rad"], answer["phi_rad"], answer["kappa_rad"]]
    np.testing.assert_allclose(np.deg2rad(_opk(found.rotation.T)), angles, atol=6e-9)
    residual = transform(found, both[:, :3]) - both[:, 3:]
    assert np.sqrt((residual**2).sum() / 11) == pytest.approx(answer["sigma0_m_dof11"], rel=1e-9)
    assert -residual[4, [0, 2]] == pytest.approx(
        [example["answer"][k] for k in ("residual_X5", "residual_Z5")], abs=1e-4
    )


def test_three_real_points_and_their_check_points(examples) -> None:
    # The printed answer stopped before full convergence: its angles are right to some 4e-4 degrees only.
    example = examples["uofc_ao_3pt"]
    answer = example["answer"]
    found = closed_form(*_both(example, "model_mm", "object_m"))
    assert found.scale == pytest.approx(answer["lambda"], abs=6e-6)
    check, ground = _both(example, "check_model", "check_object")
    expected = np.array(list(answer["check_diff_obj_minus_calc"].values()))
    np.testing.assert_allclose(ground - transform(found, check), expected, atol=2.5e-3)


def test_centroid_reduced_normal_equations_fall_apart_and_give_the_general_solution() -> None:
    """A502: of weighted points with errors, far from the origin, against dense least squares of all seven unknowns."""
    rng = np.random.default_rng(12)
    x, weight = rng.normal(size=(9, 3)) * [3.0, 2.0, 0.5] + 5.0, rng.uniform(0.5, 2.0, 9)
    true = Similarity(np.array([4.5e3, -4.4e2, 100.0]), 120.0, exp_rotation(np.array([0.2, -0.1, 2.5])))
    X = transform(true, x) + rng.normal(size=x.shape)
    found = from_centroids(x, X, Similarity(np.zeros(3), 100.0, exp_rotation(np.array([0.0, 0.0, 2.0]))), weight)
    closed = closed_form(x, X, weight)
    assert found.scale == pytest.approx(closed.scale, rel=1e-12)
    np.testing.assert_allclose(found.rotation, closed.rotation, atol=1e-12)
    np.testing.assert_allclose(found.translation, closed.translation, rtol=1e-12)
    J = (np.sqrt(weight)[:, None, None] * jacobian(found, x)).reshape(-1, 7)
    v = (np.sqrt(weight)[:, None] * (X - transform(found, x))).ravel()
    step = np.linalg.lstsq(J, v, rcond=None)[0]  # the general equations have nothing left to do
    assert np.abs(step[3:]).max() < 1e-12
    # about the centroid, the general normal matrix is the block-diagonal one
    centred = Similarity(np.zeros(3), found.scale, found.rotation)
    x0 = weight @ x / weight.sum()
    J = (np.sqrt(weight)[:, None, None] * jacobian(centred, x - x0)).reshape(-1, 7)
    N = centroid_normals(transform(centred, x - x0), weight)
    np.testing.assert_allclose(J.T @ J, N, atol=1e-12 * N.max())
    assert not N[:3, 3:].any()
    assert not N[6, 3:6].any()
