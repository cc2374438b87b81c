"""Strips joined by common points."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.errors import AatriError, ConvergenceError, GeometryError
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.similarity import Similarity, closed_form, transform
from aatri.orientation.bodies import components
from aatri.orientation.bodies.component_growth import BodyPoints, grow_components
from aatri.orientation.bodies.components import join_strips
from aatri.orientation.bodies.limits import WEAKEST_TIE_RAD

RNG = np.random.default_rng(5)


def _strips(members, frames=None, noise=0.0):
    """Strips of points known on the ground: members are (k, 3) ground points by number."""
    ground, sets = members
    frames = frames or [
        Similarity(RNG.normal(0, 5, 3), RNG.uniform(0.5, 2), exp_rotation(RNG.normal(0, 1, 3))) for _ in sets
    ]
    strip = np.concatenate([np.full(len(s), k) for k, s in enumerate(sets)])
    point = np.concatenate(sets)
    xyz = np.concatenate([transform(f, ground[s] + RNG.normal(0, noise, (len(s), 3))) for f, s in zip(frames, sets)])
    scale = np.array([f.scale for f in frames])[strip]
    return BodyPoints(strip, point, xyz, (0.01 * scale[:, None, None]) ** 2 * np.eye(3)), frames


def _fits(point, x, ground):
    """Largest discrepancy from the ground, after the similarity of the points."""
    return np.abs(transform(closed_form(x, ground[point]), x) - ground[point]).max()


GROUND = np.column_stack([RNG.uniform(0, 1000, 40), RNG.uniform(0, 600, 40), RNG.uniform(0, 30, 40)])


def test_error_free_strips_join_exactly() -> None:
    points, _ = _strips((GROUND, [np.arange(0, 18), np.arange(10, 30), np.arange(24, 40)]))
    free = join_strips(points, ["1", "2", "3"])
    assert len(free.components) == 1
    assert free.unjoined == ()
    assert _fits(free.components[0].point, free.components[0].xyz, GROUND) < 1e-9
    assert free.components[0].tied.tau_m == 0.0


def test_a_strip_tied_only_to_two_others_together_is_joined_to_both() -> None:
    # Two points in common with each neighbour: no pair is enough, the two joined neighbours are.
    points, _ = _strips((GROUND, [np.arange(0, 18), np.arange(10, 30), np.array([0, 1, 28, 29, 35, 36, 37])]))
    free = join_strips(points, ["1", "2", "3"])
    assert len(free.components) == 1
    assert _fits(free.components[0].point, free.components[0].xyz, GROUND) < 1e-9


def test_strips_with_nothing_in_common_stay_apart_and_say_so() -> None:
    points, _ = _strips((GROUND, [np.arange(0, 20), np.arange(20, 40)]))
    free = join_strips(points, ["1", "2"])
    assert [c.strips.tolist() for c in free.components] == [[0], [1]]
    assert free.unjoined == ("strip 1 and strip 2 have no common point",)


def test_two_common_points_are_too_few_and_collinear_ones_are_named() -> None:
    points, _ = _strips((GROUND, [np.arange(0, 20), np.arange(18, 40)]))
    assert join_strips(points, ["1", "2"]).unjoined == ("strip 1 and strip 2 have 2 common points, 3 are needed",)
    line = GROUND.copy()
    line[15:20] = np.array([[0.0, 300, 10]]) + np.arange(5)[:, None] * [100.0, 0, 0]
    points, _ = _strips((line, [np.arange(0, 20), np.arange(15, 40)]))
    assert join_strips(points, ["1", "2"]).unjoined == ("strip 1 and strip 2 have 5 common points that lie on a line",)


def test_ties_near_a_line_join_if_their_distances_from_it_exceed_their_noise() -> None:
    near = GROUND.copy()
    near[14:20] = np.array([[0.0, 300, 10]]) + np.arange(6)[:, None] * [100.0, 0, 0] + RNG.normal(0, 10, (6, 3))
    points, _ = _strips((near, [np.arange(0, 20), np.arange(14, 40)]), noise=0.01)
    free = join_strips(points, ["1", "2"])
    assert len(free.components) == 1


def test_a_wrong_tie_is_found_among_noisy_ones() -> None:
    points, _ = _strips((GROUND, [np.arange(0, 25), np.arange(10, 40)]), noise=0.01)
    wrong = np.flatnonzero((points.strip == 1) & (points.point == 15))[0]
    xyz = points.xyz.copy()
    xyz[wrong] += 3.0
    free = join_strips(BodyPoints(points.strip, points.point, xyz, points.covariance), ["1", "2"])
    assert points.point[~free.active].tolist() == [15]
    # Two strips cannot tell which of them is wrong: the tie is cut, the other points fit.
    component = free.components[0]
    right = component.point != 15
    assert _fits(component.point[right], component.xyz[right], GROUND) < 0.1


def test_an_observation_rejected_before_is_readmitted_where_it_fits() -> None:
    points, _ = _strips((GROUND, [np.arange(0, 25), np.arange(10, 40)]), noise=0.01)
    active = np.ones(len(points.strip), dtype=bool)
    active[12] = False
    assert join_strips(points, ["1", "2"], active=active).active.all()


def test_the_order_of_rows_does_not_matter() -> None:
    points, _ = _strips((GROUND, [np.arange(0, 25), np.arange(10, 40)]), noise=0.01)
    order = RNG.permutation(len(points.strip))
    first, second = join_strips(points, ["1", "2"]), join_strips(points.take(order), ["1", "2"])
    np.testing.assert_allclose(first.components[0].xyz, second.components[0].xyz, rtol=0, atol=1e-9)


def test_common_points_that_do_not_fit_each_other_tie_nothing() -> None:
    one = np.array([[95.0, 14.4, 94.9], [31.2, 42.3, 82.8], [40.9, 55.0, 2.8]])
    other = np.array([[2034.6, 0.3, 0.8], [2804.1, 0.5, 1.0], [9616.6, 0.7, 0.5]])  # two of them can be made to fit
    covariance = np.tile(1e-12 * np.eye(3), (6, 1, 1))
    points = BodyPoints(np.repeat([0, 1], 3), np.tile([0, 1, 2], 2), np.concatenate([one, other]), covariance)
    member, _, ties = grow_components(points, 2)
    assert member.tolist() == [0, 1]
    assert ties[0, 1].sigma_rad > WEAKEST_TIE_RAD


@pytest.mark.parametrize("n", [5, 7, 12])
def test_one_number_at_two_places_parts_no_strips(n: int) -> None:
    """Common points of two strips lie along their overlap; the last of them is another place in the second strip."""
    chance = np.random.default_rng(n)
    one = np.column_stack([np.linspace(0.0, 5.0, n), chance.uniform(-0.1, 0.1, n), chance.uniform(-0.2, 0.2, n)])
    turn, scale, shift = exp_rotation(np.array([0.02, -0.3, 1.1])), 1.7, np.array([3.0, -1.0, 0.5])
    other = one.copy()
    other[-1] += [-4.0, 1.5, 0.1]
    other = (other - shift) @ turn / scale  # one = shift + scale turn other
    xyz = np.concatenate([one, other]) + chance.normal(0, 1e-4, (2 * n, 3))
    points = BodyPoints(np.repeat([0, 1], n), np.tile(np.arange(n), 2), xyz, np.tile(1e-8 * np.eye(3), (2 * n, 1, 1)))
    member, pose, _ = grow_components(points, 2)
    assert member.tolist() == [0, 0]
    np.testing.assert_allclose(pose[1].rotation, turn, rtol=0, atol=0.01)
    assert pose[1].scale == pytest.approx(scale, rel=1e-3)


@pytest.mark.parametrize("kind", [GeometryError, ConvergenceError])
def test_a_strip_that_its_ties_leave_open_or_turn_over_stands_apart_and_other_gaps_are_still_told(
    monkeypatch: pytest.MonkeyPatch, kind: type[AatriError]
) -> None:
    xyz = np.random.default_rng(1).uniform(0, 1, (8, 3))
    strip, point = np.repeat([0, 1, 2, 3], [8, 6, 8, 8]), np.r_[0:8, 0:6, 10:18, 20:28]
    points = BodyPoints(strip, point, xyz[np.r_[0:8, 0:6, 0:8, 0:8]], np.tile(1e-6 * np.eye(3), (30, 1, 1)))
    adjusted = components._adjusted

    def open_if_several(points, strips, *more):  # type: ignore[no-untyped-def]
        if len(strips) > 1:
            raise kind("1 unknown open")
        return adjusted(points, strips, *more)

    monkeypatch.setattr(components, "_adjusted", open_if_several)
    free = components.join_strips(points, ["a", "b", "c", "d"])
    assert sorted(c.strips.tolist() for c in free.components) == [[0], [1], [2], [3]]
    assert "strip b: 1 unknown open" in free.unjoined or "strip a: 1 unknown open" in free.unjoined
    assert any("have no common point" in text and "c" in text and "d" in text for text in free.unjoined)
