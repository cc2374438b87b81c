"""Relative orientation against published examples, in their own conventions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from aatri.geometry.coplanarity import (
    RayPairs,
    coplanarity,
    coplanarity_derivatives,
    essential_derivatives,
    essential_matrix,
)
from aatri.geometry.intersection import intersect_pair
from aatri.geometry.rotations import angle_covariance, angles_from_rotation, exp_rotation
from aatri.geometry.vectors import tangents
from aatri.orientation.relative.elements import dependent_elements
from tests.adjustment.dense import adjust
from tests.orientation.relative.pairs import ray_directions, relative_orientation


@pytest.fixture
def examples(shared_data: Path) -> dict:
    text = (shared_data / "worked_examples" / "relative_orientation.yaml").read_text()
    return {example["id"]: example for example in yaml.safe_load(text)}


def _rays(points, c, pp=(0.0, 0.0), sigma=0.005):
    xy = np.array(points) - np.tile(pp, 2)
    s = np.full((len(xy), 2), sigma)
    return RayPairs(ray_directions(xy[:, :2], c), ray_directions(xy[:, 2:], c), s, s)


def _unweighted(rays, bx):
    """Dependent pair with bx fixed and every coplanarity condition of weight 1, as the examples have it."""
    by_bz = np.eye(3)[:, 1:]

    def linearise(state):
        R, b = state
        F, _ = coplanarity(essential_matrix(R, b), rays.left, rays.right)
        return F, coplanarity_derivatives(essential_derivatives(R, b, by_bz), rays.left, rays.right)[0]

    def update(state, step):
        return exp_rotation(step[:3]) @ state[0], state[1] + by_bz @ step[3:]

    start = (np.eye(3), np.array([bx, 0.0, 0.0]))
    return adjust(linearise, update, start, tolerance=1e-8).state


@pytest.mark.parametrize("name", ["mikhail_152150", "uofc_27_28_tavish"])
def test_unweighted_coplanarity_gives_the_printed_digits(examples: dict, name: str) -> None:
    example = examples[name]
    points = example["points"]
    points = list(points.values()) if isinstance(points, dict) else points
    rays, answer = _rays(points, example["f_mm"]), example["answer"]
    R, b = _unweighted(rays, example["base_x_mm"])
    np.testing.assert_allclose(b[1:], [answer["by_mm"], answer["bz_mm"]], rtol=1e-7)
    angles = angles_from_rotation(R)
    np.testing.assert_allclose(angles, [answer[f"{k}_rad"] for k in ("omega", "phi", "kappa")], atol=2e-9)
    if "model_coords_mm" in example:
        found = intersect_pair(R, b, rays)
        np.testing.assert_allclose(found.xyz, list(example["model_coords_mm"].values()), atol=2e-3)


def test_the_rigorous_two_image_adjustment_of_wolf_and_dewitt_is_met(examples: dict) -> None:
    example = examples["wolf_dewitt_152113"]
    answer = example["answer"]
    found = relative_orientation(_rays(list(example["points"].values()), example["f_mm"]))
    omega, phi, kappa = np.degrees(angles_from_rotation(found.left_from_right))
    assert found.redundancy == answer["dof"]
    assert [omega, phi, kappa] == pytest.approx([answer[f"{k}_deg"] for k in ("omega", "phi", "kappa")], abs=6e-5)
    base = found.base * answer["XL"] / found.base[0]
    assert base[1:] == pytest.approx([answer["YL"], answer["ZL"] - example["f_mm"]], abs=6e-5)
    assert found.sigma0 * 0.005 == pytest.approx(answer["s0_mm"], abs=6e-5)
    sigma = np.sqrt(
        np.diag(angle_covariance(found.left_from_right[None], found.covariance[None, :3, :3], "omega-phi-kappa")[0])
    )
    expected = np.array([answer["sd"][f"{k}_deg"] for k in ("omega", "phi", "kappa")])
    np.testing.assert_allclose(np.degrees(sigma) * found.sigma0, expected, atol=6e-5)
    T = tangents(found.base)
    by_turn = (T[1:] * found.base[0] - np.outer(found.base[1:], T[0])) / found.base[0] ** 2
    sigma_base = np.sqrt(np.diag(by_turn @ found.covariance[3:, 3:] @ by_turn.T)) * answer["XL"] * found.sigma0
    np.testing.assert_allclose(sigma_base, [answer["sd"]["YL"], answer["sd"]["ZL"]], atol=6e-5)


def test_whu_319_320_in_the_chinese_system(examples: dict) -> None:
    example = examples["whu_319_320"]
    names = sorted(example["left_319"], key=str)
    # the source's program has photo 320 on the left
    points = [example["right_320"][k] + example["left_319"][k] for k in names]
    found = relative_orientation(_rays(points, example["f_mm"], example["pp_mm"]))
    answer = example["answer"]
    expected = [answer[k] for k in ("phi", "omega", "kappa", "u", "v")]
    values, _ = dependent_elements(found.left_from_right[None], found.base[None], found.covariance[None])
    assert values[0] == pytest.approx(expected, abs=5e-5)
