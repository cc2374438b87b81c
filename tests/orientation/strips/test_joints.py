"""Scales of many joints through the compiled loop, against `scale_transfer` of each alone; chains of unlike length."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import aatri.adjustment.threads as threads
import aatri.orientation.strips.joints as many
from aatri.orientation.strips.chain import form_strips
from tests.orientation.strips.reference import Model, common_points, scale_transfer
from tests.orientation.strips.tables import table_of


def _rotation(rng: np.random.Generator) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(rng.normal(0, 0.05, 3)).as_matrix()


def _models(seed: int, n_models: int = 12, *, wrong: float = 0.0, points: int = 30) -> list[Model]:
    """Models of a strip with errors along their left rays, of a size their covariances tell; some points wrong."""
    rng = np.random.default_rng(seed)
    X0 = np.column_stack([0.6 * np.arange(n_models + 1), rng.normal(0, 0.02, (n_models + 1, 2))])
    R = [_rotation(rng) for _ in X0]
    ground = rng.uniform([-0.3, -0.6, -1.1], [0.6 * n_models + 0.3, 0.6, -0.9], (points * n_models, 3))
    models = []
    for k in range(n_models):
        seen = np.flatnonzero((ground[:, 0] > X0[k, 0] - 0.3) & (ground[:, 0] < X0[k + 1, 0] + 0.3))
        length = np.linalg.norm(X0[k + 1] - X0[k])
        xyz = (ground[seen] - X0[k]) @ R[k] / length
        base = R[k].T @ (X0[k + 1] - X0[k]) / length
        spread = rng.uniform(0.5, 2.0, len(seen)) * 1e-4
        along = xyz / np.linalg.norm(xyz, axis=1)[:, None]
        xyz = xyz + along * (3 * spread * rng.normal(size=len(seen)))[:, None]
        bad = rng.random(len(seen)) < wrong
        xyz[bad] *= rng.uniform(0.9, 1.1, (int(bad.sum()), 1))
        covariance = (spread**2)[:, None, None] * (np.eye(3) + 8 * along[:, :, None] * along[:, None, :])
        A = rng.normal(size=(9, 5))
        models.append(Model(R[k].T @ R[k + 1], base, 1e-8 * np.linalg.inv(A.T @ A), seen, xyz, covariance))
    return models


def _take(model: Model, rows: np.ndarray) -> Model:
    return Model(
        model.left_from_right,
        model.base,
        model.orientation_covariance,
        model.point[rows],
        model.xyz[rows],
        model.covariance[rows],
    )


def _assert_as_alone(found: many.JointTable, models: list[Model], joint: int) -> None:
    first, second = models[found.first[joint]], models[found.second[joint]]
    rows = slice(found.start[joint], found.start[joint + 1])
    if not len(common_points(first, second)[0]):
        assert rows.start == rows.stop
        assert np.isnan(found.scale[joint])
        return
    alone = scale_transfer(first, second)
    np.testing.assert_array_equal(found.active[rows], alone.active)
    assert found.scale[joint] == pytest.approx(alone.scale, abs=1e-9 * alone.sigma)
    assert found.sigma[joint] == pytest.approx(alone.sigma, rel=1e-9)
    assert found.spread[joint] == pytest.approx(alone.spread, rel=1e-12)
    assert found.used()[joint] == alone.active.sum()
    for name in ("log_scale", "size", "size_sigma", "test"):
        expected = getattr(alone, name)
        np.testing.assert_allclose(getattr(found, name)[rows], expected, rtol=1e-8, atol=1e-11, err_msg=name)
    largest = np.nan_to_num(alone.test[alone.active]).max(initial=0.0)
    assert found.largest_test()[joint] == pytest.approx(largest, rel=1e-8)


@pytest.mark.parametrize("wrong", [0.0, 0.05, 0.3])
def test_the_compiled_loop_rejects_and_readmits_as_the_numpy_form(wrong: float) -> None:
    for seed in range(3):
        models = _models(seed, wrong=wrong)
        found = many.scale_transfers(table_of(models), np.arange(11), np.arange(1, 12))
        assert (~found.active).any() == (wrong > 0)
        for joint in range(11):
            _assert_as_alone(found, models, joint)


def test_joints_of_none_to_three_points_come_out_as_alone() -> None:
    models = _models(5, 9)
    shared = [np.intersect1d(a.point, b.point) for a, b in pairwise(models)]
    for joint, left in enumerate((0, 1, 2, 3, 4)):
        gone = shared[joint][left:]
        models[joint] = _take(models[joint], ~np.isin(models[joint].point, gone))
    found = many.scale_transfers(table_of(models), np.arange(8), np.arange(1, 9))
    for joint in range(8):
        _assert_as_alone(found, models, joint)
    assert found.used()[:3].tolist() == [0, 1, 2]


def test_joints_of_a_model_that_is_as_good_as_open_come_out_as_alone() -> None:
    models = _models(6, 4)
    open_model = models[1]
    models[1] = Model(
        open_model.left_from_right,
        open_model.base,
        9.0 * np.eye(5),
        open_model.point,
        open_model.xyz,
        open_model.covariance,
    )
    found = many.scale_transfers(table_of(models), np.arange(3), np.arange(1, 4))
    for joint in range(3):
        alone = scale_transfer(models[joint], models[joint + 1])
        assert found.scale[joint] == pytest.approx(alone.scale, rel=1e-7)


def test_the_result_has_the_same_bits_for_any_number_of_threads_and_portions(monkeypatch: pytest.MonkeyPatch) -> None:
    table = table_of(_models(7, wrong=0.1))
    monkeypatch.setattr(many, "WORTH_A_THREAD", 1)
    results = []
    for count, at_once in ((1, 250_000), (3, 250_000), (2, 50)):
        monkeypatch.setattr(threads, "default_threads", lambda count=count: count)
        monkeypatch.setattr(many, "AT_ONCE", at_once)
        results.append(many.scale_transfers(table, np.arange(11), np.arange(1, 12)))
    for other in results[1:]:
        for name in many.JointTable.__dataclass_fields__:
            np.testing.assert_array_equal(getattr(other, name), getattr(results[0], name), err_msg=name)


def test_chains_of_unlike_length_are_followed_each_by_itself() -> None:
    models = _models(8, 9)
    table = table_of(models)
    joints = many.scale_transfers(table, np.arange(8), np.arange(1, 9))
    chains = [([4, 5, 6, 7], [4, 5, 6]), ([8], []), ([0, 1], [0])]
    formed = form_strips(table, joints, chains)
    for strip, (rows, between) in enumerate(chains):
        X0, R, scale = [np.zeros(3)], [np.eye(3)], [1.0]
        for place, k in enumerate(rows):
            X0.append(X0[-1] + scale[-1] * R[-1] @ models[k].base)
            R.append(R[-1] @ models[k].left_from_right)
            scale.append(scale[-1] * (joints.scale[between[place]] if place < len(between) else 1.0))
        at = formed.image_strip == strip
        np.testing.assert_allclose(formed.position[at], X0, atol=1e-14)
        np.testing.assert_allclose(formed.strip_from_image[at], R, atol=1e-14)
        here = formed.strip == strip
        assert (np.diff(formed.point[here]) > 0).all()
        point = int(formed.point[here][len(rows)])
        N, moment, held = np.zeros((3, 3)), np.zeros(3), 0
        for place, k in enumerate(rows):
            row = np.flatnonzero(models[k].point == point)
            gone = [
                j
                for j in between
                if k in (joints.first[j], joints.second[j])
                and point in table.point[joints.first_row[(joints.of_row() == j) & ~joints.active]]
            ]
            if len(row) and not gone:
                weight = np.linalg.inv(scale[place] ** 2 * R[place] @ models[k].covariance[row[0]] @ R[place].T)
                N += weight
                moment += weight @ (X0[place] + scale[place] * R[place] @ models[k].xyz[row[0]])
                held += 1
        mine = np.flatnonzero(here & (formed.point == point))[0]
        np.testing.assert_allclose(formed.xyz[mine], np.linalg.solve(N, moment), atol=1e-12)
        np.testing.assert_allclose(formed.covariance[mine], np.linalg.inv(N), rtol=1e-9, atol=1e-22)
        assert formed.models[mine] == held
    assert np.isnan(formed.placed[table.of_row() == 2]).all()


def test_no_joints_and_no_models_make_no_strips() -> None:
    table = table_of(_models(9, 2))
    joints = many.scale_transfers(table, np.zeros(0, np.int64), np.zeros(0, np.int64))
    formed = form_strips(table, joints, [([1], [])])
    assert len(formed.position) == 2
    assert set(formed.models) == {1}
