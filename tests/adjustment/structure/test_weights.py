"""Rejection and reweighting on one index."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.covariance.solve import solve
from aatri.adjustment.elimination.backsolve import steps
from aatri.adjustment.elimination.fronts import factorise
from aatri.adjustment.records import keys_of
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure.index_problem import prepare
from aatri.adjustment.structure.weights import Weights, taking_no_part, with_weights
from aatri.errors import GeometryError
from tests.adjustment.block_problem import joined_problem, made_problem


@pytest.mark.parametrize("maker", [made_problem, joined_problem])
def test_other_weights_on_one_index_give_the_steps_of_a_problem_made_with_them(maker) -> None:
    unknowns, records, start = maker(1, n_kept=14, n_points=40)
    rng = np.random.default_rng(3)
    active = rng.uniform(size=len(records[0].active)) > 0.2
    whitener = 2.0 * records[1].whitener
    indexed = prepare(unknowns, records)
    found = with_weights(indexed, {"ray": Weights(active), records[1].name: Weights(whitener=whitener)})
    made = (replace(records[0], active=active), replace(records[1], whitener=whitener), *records[2:])
    wanted = prepare(unknowns, made)
    assert found.tree is indexed.tree
    for p, q in ((found, wanted), (with_weights(found, {"ray": Weights(records[0].active)}), None)):
        again = q or prepare(unknowns, (records[0], *made[1:]))
        for group, step in steps(p, factorise(p, start), start).items():
            np.testing.assert_allclose(
                step, steps(again, factorise(again, start), start)[group], rtol=1e-10, atol=1e-13
            )


def _point_without(records, point: int):
    rays = records[0]
    touching = rays.touches[1][1] == point
    return (replace(rays, active=rays.active & ~touching), *records[1:]), np.flatnonzero(touching)


def test_a_point_whose_last_active_record_went_is_held_and_has_no_covariance(recwarn: pytest.WarningsRecorder) -> None:
    unknowns, records, start = made_problem(1, n_kept=14, n_points=40)
    start["p"][9] = 0.123
    without, rows = _point_without(records, 9)
    result = adjust_large(unknowns, without, start)
    assert taking_no_part(result.problem)["p"].nonzero()[0].tolist() == [9]
    assert (result.state["p"][9] == 0.123).all()
    assert result.n_unknowns == adjust_large(unknowns, records, start).n_unknowns - 3
    found = marginal_covariances(result)
    assert np.isnan(found.groups["p"][9]).all()
    assert np.isnan(found.rays[rows]).all()
    assert np.isfinite(np.delete(found.rays, rows, axis=0)).all()


def test_a_point_that_takes_no_part_comes_back_with_its_records() -> None:
    unknowns, records, start = made_problem(1, n_kept=14, n_points=40)
    without, _ = _point_without(records, 9)
    back = with_weights(prepare(unknowns, without), {"ray": Weights(records[0].active)})
    assert not any(aside.any() for aside in taking_no_part(back).values())
    wanted = prepare(unknowns, records)
    for group, step in steps(back, factorise(back, start), start).items():
        np.testing.assert_allclose(step, steps(wanted, factorise(wanted, start), start)[group], rtol=1e-10, atol=1e-13)


def test_an_image_whose_observations_are_all_inactive_is_not_determined() -> None:
    unknowns, records, start = joined_problem(1, n_kept=14, n_points=40)
    off = [
        replace(r, active=r.active & ~np.any([b == 13 for g, b in r.touches if g in "af"], axis=0))
        if any(g in "af" for g, _ in r.touches)
        else r
        for r in records
    ]
    with pytest.raises(GeometryError, match="a a13"):
        adjust_large(unknowns, off, start)


def test_a_point_that_nothing_observes_at_all_is_set_aside() -> None:
    unknowns, records, start = made_problem(1, n_kept=14, n_points=40)
    group = unknowns[0]
    more = replace(group, free=np.vstack([group.free, np.ones((1, 3), bool)]), ids=[*group.ids, "lonely"])
    start["p"] = np.vstack([start["p"], np.zeros((1, 3))])
    result = adjust_large((more, unknowns[1]), records, start)
    assert [str(note) for note in result.notes] == ["set aside, its observations do not determine it: p lonely"]


def test_weights_of_an_unknown_name_or_another_shape_are_refused() -> None:
    unknowns, records, _ = made_problem()
    indexed = prepare(unknowns, records)
    with pytest.raises(ValueError, match="no observation type has the key rays: there are ray, "):
        with_weights(indexed, {"rays": Weights(records[0].active)})
    with pytest.raises(ValueError, match="weights of ray"):
        with_weights(indexed, {"ray": Weights(records[0].active[1:])})


def test_two_observation_types_of_one_name_are_weighted_apart_by_their_keys() -> None:
    unknowns, records, start = made_problem(1, n_kept=14, n_points=40)
    direct = records[1]
    half = np.arange(len(direct.active)) % 2 == 0
    parts = [replace(direct, active=direct.active & half), replace(direct, active=direct.active & ~half)]
    both = (records[0], *parts, *records[2:])
    name = direct.name
    assert keys_of(both)[:3] == ("ray", f"{name} 1", f"{name} 2")
    indexed = prepare(unknowns, both)
    changed = {f"{name} 2": Weights(whitener=3.0 * direct.whitener)}
    wanted = prepare(unknowns, (*both[:2], replace(parts[1], whitener=3.0 * direct.whitener), *records[2:]))
    found = with_weights(indexed, changed)
    for group, step in steps(found, factorise(found, start), start).items():
        np.testing.assert_allclose(step, steps(wanted, factorise(wanted, start), start)[group], rtol=1e-10, atol=1e-13)
    assert list(solve(indexed, start).tests())[:3] == ["ray", f"{name} 1", f"{name} 2"]
    with pytest.raises(ValueError, match=f"no observation type has the key {name}: "):
        with_weights(indexed, {name: Weights(active=direct.active)})
