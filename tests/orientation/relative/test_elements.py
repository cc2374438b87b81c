"""Elements of the methods of relative orientation, and the classical equations with equal weights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.rotations import angles_from_rotation, exp_rotation, rotation_from_angles
from aatri.geometry.vectors import tangents, unit
from aatri.orientation.relative.elements import (
    DEPENDENT,
    INDEPENDENT,
    dependent_elements,
    independent_elements,
    left_rotation,
)
from aatri.orientation.relative.equal_weights import adjusted_with_equal_weights, equation_rows
from tests.orientation.relative.pairs import gruber_ground, ray_directions, relative_orientation, rotation, simulate


@pytest.fixture
def examples(shared_data: Path) -> Any:
    text = (shared_data / "worked_examples" / "relative_orientation.yaml").read_text()
    return {example["id"]: example for example in yaml.safe_load(text)}


def rays_of_example(points: Any, c: float, pp: Any = (0.0, 0.0)) -> RayPairs:
    xy = np.array(points) - np.tile(pp, 2)
    s = np.full((len(xy), 2), 0.005)
    return RayPairs(ray_directions(xy[:, :2], c), ray_directions(xy[:, 2:], c), s, s)


def made(seed: int = 3) -> tuple[Any, Any, Any]:
    rng = np.random.default_rng(seed)
    X = gruber_ground(4, rng, 0.05)
    return simulate(X, rotation(rng), rotation(rng), np.zeros(3), np.array([0.6, 0.05, -0.03]), rng)


def test_the_frame_of_the_independent_method_has_its_x_axis_along_the_base() -> None:
    base = unit(np.array([[0.9, 0.2, -0.1], [-0.8, 0.1, 0.3]]))
    R1 = left_rotation(base)
    assert (R1 @ base[:, :, None])[:, :, 0] == pytest.approx(np.tile([1.0, 0, 0], (2, 1)), abs=1e-15)
    assert angles_from_rotation(R1, "phi-omega-kappa")[:, 1] == pytest.approx([0, 0], abs=1e-15)


@pytest.mark.parametrize("of", [dependent_elements, independent_elements])
def test_sigmas_are_those_of_propagated_small_changes(of: Any) -> None:
    _, R, b = made()
    T = tangents(b)
    rng = np.random.default_rng(5)
    root = rng.normal(size=(5, 5)) * 1e-3
    values, sigma = of(R[None], b[None], (root @ root.T)[None])
    h = 1e-6
    J = np.empty((5, 5))
    for k in range(5):
        step = np.zeros(5)
        step[k] = h
        sides = [
            of((exp_rotation(s * step[:3]) @ R)[None], unit(b + s * T @ step[3:])[None], np.eye(5)[None])[0][0]
            for s in (1, -1)
        ]
        J[:, k] = (sides[0] - sides[1]) / (2 * h)
    assert sigma[0] == pytest.approx(np.sqrt(np.diag(J @ root @ root.T @ J.T)), rel=1e-7)
    assert len(DEPENDENT) == len(INDEPENDENT) == values.shape[1]


def test_simulated_elements_come_back() -> None:
    phi1, kappa1, phi2, omega2, kappa2 = true = np.array([0.02, -0.03, -0.015, 0.01, 0.05])
    R1, R2 = (rotation_from_angles(a, "phi-omega-kappa") for a in ([phi1, 0, kappa1], [phi2, omega2, kappa2]))
    rays, _, b = simulate(gruber_ground(3, np.random.default_rng(1)), R1, R2, np.zeros(3), np.array([0.6, 0.0, 0.0]))
    found = relative_orientation(rays)
    values, _ = independent_elements(found.left_from_right[None], found.base[None], found.covariance[None])
    assert values[0] == pytest.approx(true, abs=1e-9)
    again, _ = dependent_elements(found.left_from_right[None], found.base[None], found.covariance[None])
    assert again[0, :3] == pytest.approx(angles_from_rotation(R1.T @ R2, "phi-omega-kappa"), abs=1e-9)
    assert again[0, 3:] == pytest.approx(b[1:] / b[0], abs=1e-9)


@pytest.mark.parametrize("equation", ["q", "determinant"])
@pytest.mark.parametrize("frame", ["dependent", "independent"])
def test_derivatives_and_sigmas_of_the_equations(equation: str, frame: str) -> None:
    rays, R, b = made()
    n = len(rays.left)

    def at(step: Any, moved: RayPairs = rays) -> Any:
        R_, b_ = exp_rotation(step[:3]) @ R, unit(b + tangents(b) @ step[3:])
        args = (np.tile(R_, (n, 1, 1)), np.tile(b_, (n, 1)), np.tile(tangents(b_), (n, 1, 1)))
        return equation_rows(equation, frame, *args, moved)

    v, J, sigma = at(np.zeros(5))
    h = 1e-5
    for k in range(5):
        step = h * np.eye(5)[k]
        numeric = (8 * (at(step)[0] - at(-step)[0]) - (at(2 * step)[0] - at(-2 * step)[0])) / (12 * h)
        assert J[:, k] == pytest.approx(numeric, rel=1e-8, abs=1e-8 * np.abs(J).max())
    variance = np.zeros(n)
    for side in range(2):
        for axis in range(2):
            left, right = rays.left.copy(), rays.right.copy()
            (left, right)[side][:, axis] += 1e-4
            moved = at(np.zeros(5), RayPairs(left, right, rays.left_sigma, rays.right_sigma))[0]
            variance += ((moved - v) / 1e-4 * 0.005) ** 2
    assert sigma == pytest.approx(np.sqrt(variance), rel=1e-4)


def test_q_is_what_the_projection_coefficients_leave_in_y() -> None:
    """Q = N1 Y1 - By - N2 Y2 with the notes' coefficients."""
    rays, R, b = made()
    n = len(rays.left)
    X1, Y1, Z1 = rays.left.T
    X2, Y2, Z2 = (rays.right @ R.T).T
    Bx, By, Bz = b / b[0]
    D = X1 * Z2 - X2 * Z1
    N1, N2 = (Bx * Z2 - Bz * X2) / D, (Bx * Z1 - Bz * X1) / D
    args = (np.tile(R, (n, 1, 1)), np.tile(b, (n, 1)), np.tile(tangents(b), (n, 1, 1)))
    assert equation_rows("q", "dependent", *args, rays)[0] == pytest.approx(N1 * Y1 - By - N2 * Y2, abs=1e-14)


def test_the_linear_coefficients_of_the_notes_are_the_derivatives_for_parallel_images() -> None:
    """dQ = X2 Y2 N2 / Z2 dphi + (Z2 + Y2^2 / Z2) N2 domega - X2 N2 dkappa - Bx dmu + Y2 / Z2 Bx dnu at zero angles."""
    X = gruber_ground(4, np.random.default_rng(2), 0.05)
    rays, R, b = simulate(X, np.eye(3), np.eye(3), np.zeros(3), np.array([0.6, 0.0, 0.0]))
    n = len(rays.left)
    args = (np.tile(R, (n, 1, 1)), np.tile(b, (n, 1)), np.tile(np.eye(3)[:, 1:], (n, 1, 1)))
    _, J, _ = equation_rows("q", "dependent", *args, rays)
    (X1, _, Z1), (X2, Y2, Z2) = rays.left.T, rays.right.T
    N2 = Z1 / (X1 * Z2 - X2 * Z1)
    wanted = np.stack([(Z2 + Y2**2 / Z2) * N2, -X2 * Y2 / Z2 * N2, -X2 * N2, -np.ones(n), Y2 / Z2], axis=1)
    # d about X, Y, Z: phi of the notes turns about -Y
    assert pytest.approx(wanted, abs=1e-12) == J


@pytest.mark.parametrize("name", ["mikhail_152150", "uofc_27_28_tavish"])
def test_unweighted_determinants_give_the_printed_digits(examples: Any, name: str) -> None:
    example = examples[name]
    points = example["points"]
    rays = rays_of_example(list(points.values()) if isinstance(points, dict) else points, example["f_mm"])
    first = relative_orientation(rays, snooping_limit=1e6)
    pair = np.zeros(len(rays.left), dtype=int)
    R, b, *_, iterations = adjusted_with_equal_weights(
        "determinant", "dependent", first.left_from_right[None], first.base[None], rays, pair
    )
    answer = example["answer"]
    assert iterations[0] > 0
    assert (b[0] / b[0, 0] * example["base_x_mm"])[1:] == pytest.approx([answer["by_mm"], answer["bz_mm"]], rel=1e-7)
    angles = angles_from_rotation(R[0])
    np.testing.assert_allclose(angles, [answer[f"{k}_rad"] for k in ("omega", "phi", "kappa")], atol=2e-9)


def test_the_q_equation_of_319_and_320_gives_the_printed_digits(examples: Any) -> None:
    example = examples["whu_319_320"]
    names = sorted(example["left_319"], key=str)
    rays = rays_of_example(
        [example["right_320"][k] + example["left_319"][k] for k in names], example["f_mm"], example["pp_mm"]
    )
    first = relative_orientation(rays, snooping_limit=1e6)
    R, b, covariance, *_ = adjusted_with_equal_weights(
        "q", "dependent", first.left_from_right[None], first.base[None], rays, np.zeros(len(rays.left), dtype=int)
    )
    values, _ = dependent_elements(R, b, covariance)
    answer = example["answer"]
    assert values[0] == pytest.approx([answer[k] for k in ("phi", "omega", "kappa", "u", "v")], abs=5e-5)


@pytest.mark.parametrize("equation", ["q", "determinant"])
@pytest.mark.parametrize("frame", ["dependent", "independent"])
def test_error_free_pairs_come_back_by_every_equation(equation: str, frame: str) -> None:
    rng = np.random.default_rng(9)
    rays, R, b = simulate(
        gruber_ground(3, rng, 0.05), rotation(rng), rotation(rng), np.zeros(3), np.array([0.6, 0.05, 0])
    )
    start = exp_rotation(np.array([1e-3, -2e-3, 1e-3])) @ R
    found = adjusted_with_equal_weights(
        equation, frame, start[None], b[None], rays, np.zeros(len(rays.left), dtype=int)
    )
    assert found[0][0] == pytest.approx(R, abs=1e-12)
    assert found[1][0] == pytest.approx(b, abs=1e-12)


@pytest.mark.parametrize("quarter", [1, -1])
def test_a_camera_mounted_across_gives_the_elements_and_equations_of_one_along_the_flight(quarter: int) -> None:
    rays, R, b = made()
    across = np.array([[0.0, -quarter, 0.0], [quarter, 0.0, 0.0], [0.0, 0.0, 1.0]])  # base near +y or -y
    turned = RayPairs(rays.left @ across.T, rays.right @ across.T, rays.left_sigma, rays.right_sigma)
    R_, b_ = across @ R @ across.T, across @ b
    rng = np.random.default_rng(5)
    of_d, of_t = (a @ a.T * 1e-6 for a in (rng.normal(size=(3, 3)), rng.normal(size=(2, 2))))
    C, C_ = np.zeros((5, 5)), np.zeros((5, 5))
    C[:3, :3], C[3:, 3:] = of_d, of_t
    T = tangents(b_).T @ across @ tangents(b)  # the tangents of either base span the same turns
    C_[:3, :3], C_[3:, 3:] = across @ of_d @ across.T, T @ of_t @ T.T
    along = dependent_elements(R[None], b[None], C[None])
    for one, other in zip(dependent_elements(R_[None], b_[None], C_[None]), along):
        assert one == pytest.approx(other, rel=1e-9)
    pair = np.zeros(len(rays.left), dtype=int)
    found = adjusted_with_equal_weights("q", "dependent", R_[None], b_[None], turned, pair)
    wanted = adjusted_with_equal_weights("q", "dependent", R[None], b[None], rays, pair)
    assert found[0][0] == pytest.approx(across @ wanted[0][0] @ across.T, abs=1e-12)
    assert found[1][0] == pytest.approx(across @ wanted[1][0], abs=1e-12)
    assert found[3] == pytest.approx(wanted[3], rel=1e-9)


def test_redundancy_numbers_of_gruber_positions() -> None:
    """C.7: 1/3 and 1/12 at six points, 2/3 and 13/24 at twelve, vertical images of flat ground, y-parallaxes."""
    for count, middle, corner in ((1, 1 / 3, 1 / 12), (2, 2 / 3, 13 / 24)):
        X = gruber_ground(count)
        rays, R, b = simulate(X, np.eye(3), np.eye(3), np.zeros(3), np.array([0.6, 0.0, 0.0]))
        n = len(X)
        args = (np.tile(R, (n, 1, 1)), np.tile(b, (n, 1)), np.tile(tangents(b), (n, 1, 1)))
        _, J, _ = equation_rows("q", "dependent", *args, rays)
        r = 1 - np.einsum("ni,ij,nj->n", J, np.linalg.inv(J.T @ J), J)
        at_middle = np.abs(X[:, 1]) < 0.1
        assert r[at_middle] == pytest.approx(np.full(at_middle.sum(), middle), abs=1e-9)
        assert r[~at_middle] == pytest.approx(np.full((~at_middle).sum(), corner), abs=1e-9)
