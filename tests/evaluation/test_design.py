"""Criteria of layouts against dense computations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.stats import chi2

from aatri.adjustment.statistics.limits import ALARM
from aatri.arrays import Float
from aatri.artifacts.block import CONTROL, Block
from aatri.artifacts.builder import block_of
from aatri.errors import InputError
from aatri.evaluation.design import criterion_eigenvalue, gains, next_control
from aatri.evaluation.field_layout import FieldOptions, _crowding
from aatri.stages.accuracy.field_layout import field_layout
from tests.stages.film_blocks import Told

SIGMA_M = np.array([0.02, 0.02, 0.05])


def _covariance(seed: int, n: int) -> np.ndarray:
    A = np.random.default_rng(seed).normal(size=(3 * n, 3 * n))
    return (A @ A.T / (3 * n) + 0.1 * np.eye(3 * n)) * 1e-3


@pytest.mark.parametrize("control_sigma_m", [(0.01, 0.01, 0.02), (np.inf, np.inf, 0.02), (0.01, 0.03, np.inf)])
def test_a_gain_is_that_of_an_adjustment_with_the_point_observed(control_sigma_m) -> None:
    n, sigma = 6, np.array(control_sigma_m)
    C = _covariance(1, n)
    A, P = np.zeros((3, 3 * n)), np.diag(1 / sigma**2)
    A[:, 6:9] = np.eye(3)
    after = np.linalg.inv(np.linalg.inv(C) + A.T @ P @ A)
    before, left = (np.diag(M).reshape(n, 3) / SIGMA_M**2 for M in (C, after))
    (gain,) = gains(C.reshape(n, 3, n, 3), SIGMA_M, sigma, np.array([2]))
    assert gain.mean == pytest.approx(1 - left.sum() / before.sum(), rel=1e-10)
    assert gain.worst == pytest.approx(1 - left.max() / before.max(), rel=1e-10)


def test_the_second_control_point_is_the_best_beside_the_first() -> None:
    n, sigma = 7, np.full(3, 0.01)
    C = _covariance(2, n)
    first, second = next_control(C.reshape(n, 3, n, 3), SIGMA_M, sigma, np.arange(n), 2, "mean")
    sums = {}
    for k in range(n):
        A = np.zeros((6, 3 * n))
        A[:3, 3 * first.point : 3 * first.point + 3] = A[3:, 3 * k : 3 * k + 3] = np.eye(3)
        after = np.linalg.inv(np.linalg.inv(C) + A.T @ A / sigma[0] ** 2)
        sums[k] = float((np.diag(after).reshape(n, 3) / SIGMA_M**2).sum())
    del sums[first.point]
    assert second.point == min(sums, key=lambda k: sums[k])


def test_the_criterion_is_the_largest_generalised_eigenvalue() -> None:
    n = 5
    xyz_m, C = np.random.default_rng(3).uniform(0, 500, (n, 3)), _covariance(3, n)
    distance = np.linalg.norm(xyz_m[:, None] - xyz_m, axis=2)
    K = np.kron(0.5 * np.exp(-distance / 200.0) + 0.5 * np.eye(n), np.diag(SIGMA_M**2))
    value, function = criterion_eigenvalue(xyz_m, C.reshape(n, 3, n, 3), SIGMA_M, 200.0)
    assert value == pytest.approx(eigh(C, K, eigvals_only=True)[-1], rel=1e-10)
    f = (function / SIGMA_M).ravel()
    assert f @ C @ f / (f @ K @ f) == pytest.approx(value, rel=1e-8)


def test_a_layout_that_is_the_criterion_has_1_and_two_points_at_one_place_are_no_obstacle() -> None:
    xyz_m = np.array([[0.0, 0, 0], [0, 0, 0], [300, 0, 0]])
    distance = np.linalg.norm(xyz_m[:, None] - xyz_m, axis=2)
    K = np.kron(0.5 * np.exp(-distance / 200.0) + 0.5 * np.eye(3), np.diag(SIGMA_M**2))
    assert criterion_eigenvalue(xyz_m, K.reshape(3, 3, 3, 3), SIGMA_M, 200.0)[0] == pytest.approx(1.0)


# Layout of a test field: one that keeps the rules, and each rule broken by itself.


def grid(n: int = 4, depth: float = 1.5) -> Float:
    """n x n x 3 targets over 4 m x 3 m, so deep."""
    x, y, z = np.meshgrid(np.linspace(0, 4, n), np.linspace(0, 3, n), np.linspace(0, depth, 3), indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()])


def crowded() -> Float:
    """A grid of 25 targets, and 50 more in its middle."""
    more = np.random.default_rng(1).uniform([1.7, 1.2, 0.0], [2.3, 1.8, 1.5], (50, 3))
    return np.concatenate([grid(5)[::3], more])


def field(X: Float, pillars: int = 2, camera: tuple[float, float, float] = (2.0, 1.5, 6.0)) -> Block:
    ids = [f"T{k}" for k in range(len(X))]
    stations = [f"S{k}" for k in range(pillars)]
    return block_of(
        name="field",
        cameras={"id": "c", "principal_distance_mm": 24.0},
        images={"id": ["1"], "camera": "c"},
        exterior={"image": ["1"], "position_m": [camera]},
        ground_points={"point": ids, "xyz_m": X, "sigma_m": 1e-4, "role": [[CONTROL] * 3] * len(X)},
        geodetic={
            "type": ["direction"] * pillars,
            "start": stations,
            "end": ["T0"] * pillars,
            "value": [0.1] * pillars,
            "sigma": [1e-5] * pillars,
        }
        if pillars
        else None,
    )


def test_a_field_that_keeps_the_rules() -> None:
    told = Told()
    result = field_layout(field(grid()), context=told)
    assert not told.warnings
    assert "all 5 rules are kept" in result.verdict
    figures = dict(zip(result.figures.name.tolist(), result.figures.value.tolist()))
    assert figures["field_targets"] == 48
    assert figures["field_depth_ratio"] == pytest.approx(1.5 / 4)
    assert figures["field_pillars"] == 2


@pytest.mark.parametrize(
    ("block", "told"),
    [
        (field(grid(3)), "27 targets, 30 or more"),
        (field(grid(5, 0.3)), "its depth is 0.075 of its length"),
        (
            field(grid(7)[np.abs(grid(7)[:, :2] - [2.0, 1.5]).max(axis=1) > 0.7]),
            "1 of 9 parts of the field have no target",
        ),
        (field(crowded()), "of 75 targets are in one of its 9 parts"),
        (field(grid(), pillars=1), "from 1 pillar, 2 or more"),
        (field(grid(), pillars=0), "from 0 pillars"),
        (field(grid(), camera=(2.0, 1.5, 0.7)), "1 of 1 cameras stand among the targets"),
    ],
)
def test_every_rule_that_is_broken_is_told_alone(block: Block, told: str) -> None:
    context = Told()
    result = field_layout(block, context=context)
    assert len(context.warnings) == 1
    assert told in context.warnings[0]
    assert "1 of 5 rules" in result.verdict


def test_the_rules_are_options_and_a_block_without_targets_is_refused() -> None:
    told = Told()
    field_layout(field(grid(3), pillars=0), options=FieldOptions(targets=20, pillars=0), context=told)
    assert not told.warnings
    with pytest.raises(InputError, match="no field: 3 targets known in three coordinates"):
        field_layout(field(grid()[:3]))


def test_a_field_in_one_plane_does_not_stop_the_check() -> None:
    told = Told()
    field_layout(field(grid(6, 0.0)), context=told)
    assert any("its depth is 0 of its length" in text for text in told.warnings)


def test_targets_thrown_at_random_are_evenly_spread_but_for_the_stated_share() -> None:
    """Of 2,000 fields of 200 targets 0.1 % are expected beyond chi2(8) at 0.001: 2; seven or more have 0.5 %."""
    rng, crowds = np.random.default_rng(3), 0
    for _ in range(2000):
        count = rng.multinomial(200, np.outer([0.35, 0.3, 0.35], [0.35, 0.3, 0.35]).ravel())
        crowds += _crowding(count) > chi2.isf(ALARM, 8)
    assert crowds < 7
