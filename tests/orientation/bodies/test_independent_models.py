"""Block adjustment with independent models: truth, textbook accuracies, theory against scatter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from aatri.adjusting.tied_problem import tied_problem
from aatri.geometry.rotations import exp_rotation
from aatri.observations.control import Control, observed_control
from aatri.observations.poses import POINT
from aatri.observations.ties import MODEL_TIE
from aatri.orientation.bodies.independent_models import adjust_models
from aatri.orientation.bodies.model_ties import LATENT, ModelPoses, ModelRows, model_ties
from aatri.orientation.bodies.similarity_ties import Similarities

HEIGHT = 153.0 / 92.0  # flying height over base


@dataclass(frozen=True)
class Made:
    """Strips of models of six points and two perspective centres; the base is the unit on the ground."""

    X: Any
    rows: ModelRows
    start: ModelPoses
    grid: Any
    n_ground: int


def made(
    strips: int,
    *,
    sigma: Any = (1e-4, 1e-4, 1e-4),
    centre: float = 1e-4,
    noise: Any = None,
    per_place: int = 1,
    models: int | None = None,
    turned: bool = True,
) -> Made:
    """60 % overlap along, 20 % across: columns of points a base apart, strips two rows apart."""
    rng, along = np.random.default_rng(7), 2 * strips if models is None else models
    column, row = (a.ravel() for a in np.meshgrid(np.arange(along + 1), np.arange(2 * strips + 1), indexing="ij"))
    column, row = np.repeat(column, per_place), np.repeat(row, per_place)
    ground = np.column_stack([column, row, rng.uniform(-0.05, 0.05, len(row))]).astype(float)
    if per_place > 1:
        ground[:, :2] += rng.uniform(-0.05, 0.05, (len(ground), 2))
    stations = np.array([[i, 2 * k + 1, HEIGHT] for k in range(strips) for i in range(along + 1)], dtype=float)
    X = np.concatenate([ground, stations])
    model, point, x, C, poses = [], [], [], [], []
    for k in range(strips):
        for i in range(along):
            m = k * along + i
            seen = np.flatnonzero((column >= i) & (column <= i + 1) & (row >= 2 * k) & (row <= 2 * k + 2))
            left = len(ground) + k * (along + 1) + i
            members = np.append(seen, [left, left + 1])
            R = exp_rotation(rng.normal(0, 0.05, 3)) if turned else np.eye(3)
            T, s = X[left], 1.0
            local = (X[members] - T) @ R / s
            own = np.tile(np.asarray(sigma, dtype=float) ** 2, (len(members), 1))
            own[-2:] = centre**2
            # covariances are those of level axes, turned into the model
            turned_C = R.T @ (own[:, :, None] * np.eye(3)) @ R
            if noise is not None:
                local = local + (noise.normal(size=local.shape) * np.sqrt(own)) @ R
            model.append(np.full(len(members), m))
            point.append(members)
            x.append(local)
            C.append(turned_C)
            poses.append((T, s, R))
    rows = ModelRows(
        np.concatenate(model),
        np.concatenate(point),
        np.concatenate(x),
        np.concatenate(C),
        np.zeros((sum(map(len, model)), 3, LATENT)),
    )
    T, s, R = (np.array([p[k] for p in poses]) for k in range(3))
    near = Similarities(T + 0.01, s * 1.0002, exp_rotation(np.tile([0.01, -0.01, 0.01], (len(T), 1))) @ R)
    return Made(X, rows, ModelPoses(near, np.zeros((len(T), LATENT))), np.column_stack([column, row]), len(ground))


def control(block: Made, full: Any, height: Any = (), plan: Any = ()) -> Control:
    """Exact control."""
    point = np.concatenate([full, height, plan]).astype(int)
    given = np.concatenate(
        [
            np.tile([True] * 3, (len(full), 1)),
            np.tile([False, False, True], (len(height), 1)),
            np.tile([True, True, False], (len(plan), 1)),
        ]
    )
    return Control(point, point.astype(np.int32), block.X[point], np.zeros((len(point), 3, 3)), ~given & given, given)


def perimeter(block: Made, step: int = 2) -> Any:
    """Points of the edge, every `step` bases."""
    (c, r), (C, R) = block.grid.T, block.grid.max(axis=0)
    edge = ((r == 0) | (r == R)) & (c % step == 0) | ((c == 0) | (c == C)) & (r % step == 0)
    return np.flatnonzero(edge)


def corners(block: Made) -> Any:
    (c, r), (C, R) = block.grid.T, block.grid.max(axis=0)
    return np.flatnonzero(((c == 0) | (c == C)) & ((r == 0) | (r == R)))


def adjusted(block: Made, given: Control, *, plan_height: bool = False) -> Any:
    names, ids = (np.arange(len(some)).astype(np.str_) for some in (block.start.latent, block.X))
    ties = model_ties(block.rows, names=names, latent=False)
    observed = [
        ties.observed(MODEL_TIE, names[block.rows.model], ids[block.rows.block], block.start),
        *observed_control(given, np.zeros(3), ids[given.point]),
    ]
    problem = tied_problem(observed, {POINT: ties.places(block.start, len(ids))}, {POINT: ids}, "independent models")
    everything = np.ones(problem.edges[-1], dtype=bool)
    return adjust_models(problem, limit=1e9, active=everything, plan_height=plan_height)


@pytest.mark.parametrize("plan_height", [False, True])
def test_error_free_models_give_the_truth(plan_height: bool) -> None:
    block = made(3)
    tied, rounds = adjusted(block, control(block, corners(block), perimeter(block)), plan_height=plan_height)
    assert tied.xyz_m == pytest.approx(block.X, abs=1e-8)
    assert (rounds > 0) == plan_height


def test_an_adjustment_that_rounding_keeps_from_being_linear_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    block = made(3, noise=np.random.default_rng(1))
    given = control(block, corners(block), perimeter(block))
    expected = adjusted(block, given)[0]
    monkeypatch.setattr("aatri.adjusting.tied_solution.LINEAR", 0.0)
    tied = adjusted(block, given)[0]
    assert tied.iterations <= expected.iterations + 4
    assert tied.xyz_m == pytest.approx(expected.xyz_m, abs=1e-11)


def test_plan_and_height_in_turn_end_where_all_seven_together_do() -> None:
    block = made(3, noise=np.random.default_rng(1))
    given = control(block, corners(block), perimeter(block))
    together, turn = adjusted(block, given)[0], adjusted(block, given, plan_height=True)[0]
    sigma = np.sqrt(np.einsum("nii->ni", together.covariances[POINT]))
    assert (np.abs(turn.xyz_m - together.xyz_m) / sigma).max() < 1e-2
    # weights follow the scale of the start, which is off by 2e-4
    assert turn.sigma0 == pytest.approx(together.sigma0, rel=1e-3)


def test_derivatives_equal_differences() -> None:
    block = made(1)
    rng = np.random.default_rng(2)
    rows = ModelRows(
        block.rows.model,
        block.rows.block,
        block.rows.x,
        block.rows.covariance,
        rng.normal(size=(len(block.rows.x), 3, LATENT)),
    )
    ties = model_ties(rows, names=["a", "b"], latent=True)
    state = ModelPoses(block.start.similarity, rng.normal(size=(2, LATENT)))
    J = ties.derivatives(state, ties.rows)
    for k in range(12):
        step = np.zeros((2, 12))
        step[:, k] = 1e-6
        sides = [ties.on_ground(ties.unknowns.retract(state, s), ties.rows) for s in (step, -step)]
        assert J[:, :, k] == pytest.approx((sides[0] - sides[1]) / 2e-6, abs=1e-8)


def plan_sigma(block: Made, plan: Any) -> float:
    """RMS of the plan standard deviations of the new points, in those of a model point; heights all known."""
    every = np.arange(block.n_ground)
    given = control(block, np.zeros(0), np.setdiff1d(every, plan), ())
    both = control(block, plan)
    merged = Control(
        *(
            np.concatenate([getattr(both, n), getattr(given, n)])
            for n in ("row", "point", "xyz_m", "covariance_m2", "observed", "exact")
        )
    )
    tied = adjusted(block, merged)[0]
    new = np.setdiff1d(every, plan)
    variance = np.einsum("nii->ni", tied.covariances[POINT])[new, :2]
    return float(np.sqrt(variance.mean()) / 1e-4)


@pytest.mark.parametrize(
    ("strips", "dense", "four"), [(2, 0.98, 1.25), (4, 0.96, 1.75), (6, 0.98, 2.32), (8, 1.00, 2.93)]
)
def test_plan_accuracies_of_the_anblock_method(strips: int, dense: float, four: float) -> None:
    """Four points a model at its corners and two between them (6 a model), plan only, level models; within 10 %."""
    block = made(strips, centre=1e3, turned=False)
    assert plan_sigma(block, perimeter(block)) == pytest.approx(dense, rel=0.1)
    assert plan_sigma(block, corners(block)) == pytest.approx(four, rel=0.1)


def height_sigma(block: Made, height: Any) -> float:
    tied = adjusted(block, control(block, perimeter(block), height))[0]
    new = np.setdiff1d(np.arange(block.n_ground), np.concatenate([perimeter(block), height]))
    variance = tied.covariances[POINT][new, 2, 2]
    return float(np.sqrt(variance.mean()) / 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("centre", [0.5e-4, 2e-4])
def test_heights_grow_linearly_with_the_strips_and_the_distance_of_chains(centre: float) -> None:
    """C.4 iii, for two standard deviations of the perspective centres: a straight line explains the growth."""
    none = np.zeros(0)
    of_strips = [height_sigma(made(n, centre=centre), none) for n in (4, 6, 8)]
    steps = np.diff(of_strips)
    assert (steps > 0).all()
    assert np.ptp(steps) < 0.25 * steps.mean()
    block = made(6, centre=centre)
    c, _ = block.grid.T
    of_chains = [height_sigma(block, np.flatnonzero(c % i == 0)) for i in (2, 4, 6, 12)]
    slope = np.diff(of_chains) / np.diff([2, 4, 6, 12])
    assert (slope > 0).all()


def test_theory_agrees_with_truth() -> None:
    """Standard deviations of the points against their true errors, over simulated models: ratio 0.9 to 1.1."""
    squares, counts, sigma0 = 0.0, 0, []
    for seed in range(6):
        block = made(3, noise=np.random.default_rng(seed), sigma=(1e-4, 1e-4, 2e-4), centre=2e-4)
        given = control(block, corners(block), perimeter(block))
        tied = adjusted(block, given)[0]
        new = np.setdiff1d(np.arange(len(block.X)), given.point)
        e = tied.xyz_m[new] - block.X[new]
        C = tied.covariances[POINT][new]
        squares += float(np.einsum("ni,nij,nj->", e, np.linalg.inv(C), e))
        counts += 3 * len(new)
        sigma0.append(tied.sigma0)
    assert 0.9 < np.sqrt(squares / counts) < 1.1
    assert np.mean(sigma0) == pytest.approx(1.0, abs=0.1)


def test_without_the_centres_the_heights_between_the_strips_are_loose() -> None:
    """Heights known along the edges only: the centres hold the models against turning about their rows of points."""
    with_centres, without = (made(4, centre=s) for s in (1e-4, 1e2))
    assert height_sigma(without, np.zeros(0)) > 3 * height_sigma(with_centres, np.zeros(0))
