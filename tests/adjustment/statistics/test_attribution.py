"""Which records of a block are wrong, and when that cannot be told: points fixed by rays of the plane."""

from __future__ import annotations

import numpy as np

from aatri.adjustment.statistics.attribution import BlockRecords, explain

LIMIT = 4.0


def _rays(places: list[float], errors: dict[int, tuple[float, float]], firm: bool = False) -> BlockRecords:
    """A point at height 1 seen from places along x: x_i = X - (X_i) Z, y_i = Y, whitened; the last may be exact."""
    k = len(places)
    B = np.zeros((1, k, 3, 3))
    v = np.zeros((1, k, 3))
    for i, x in enumerate(places):
        B[0, i, 0] = 1.0, 0.0, x
        B[0, i, 1] = 0.0, 1.0, 0.0
    for i, error in errors.items():
        v[0, i, :2] = error
    demanded = np.zeros((1, k), dtype=bool)
    if firm:
        B[0, -1] = 1e4 * np.eye(3)
        demanded[0, -1] = True
    return BlockRecords(v, B, np.ones((1, k), dtype=bool), demanded, np.full((1, k), LIMIT))


def _found(records: BlockRecords, suspected: bool = False) -> tuple[list[int], list[int]]:
    found = explain(records, np.array([suspected]))
    return np.flatnonzero(found.out[0]).tolist(), np.flatnonzero(found.undecided[0]).tolist()


def test_where_all_agree_nothing_goes() -> None:
    assert _found(_rays([0, 1, 2, 3], {})) == ([], [])


def test_one_wrong_of_many_is_named() -> None:
    assert _found(_rays([0, 1, 2, 3, 4], {2: (30.0, -20.0)})) == ([2], [])


def test_two_wrong_ones_are_named() -> None:
    assert _found(_rays([0, 1, 2, 3, 4, 5], {1: (30.0, 25.0), 4: (-20.0, 40.0)})) == ([1, 4], [])


def test_of_two_rays_nobody_is_blamed() -> None:
    assert _found(_rays([0, 1], {1: (0.0, 20.0)})) == ([0, 1], [0, 1])


def test_along_the_line_of_flight_any_of_three_rays_may_be_wrong_across_it_one() -> None:
    assert _found(_rays([0, 1, 2], {1: (50.0, 0.0)})) == ([0, 1, 2], [0, 1, 2])
    assert _found(_rays([0, 1, 2], {1: (0.0, 50.0)})) == ([1], [])


def test_exact_control_gives_way_where_two_others_would_have_to() -> None:
    assert _found(_rays([0, 1, 2, 0], {1: (0.0, 50.0)}, firm=True)) == ([1], [])
    shifted = {0: (50.0, 60.0), 1: (50.0, 60.0), 2: (50.0, 60.0)}  # all rays see the point elsewhere, and agree
    assert _found(_rays([0, 1, 2, 0], shifted, firm=True)) == ([3], [])


def test_what_a_stricter_test_suspects_is_found_below_the_limit() -> None:
    records = _rays([0, 1, 2, 3, 4], {2: (0.0, 3.9)})
    assert _found(records) == ([], [])
    assert _found(records, suspected=True) == ([2], [])


def test_blocks_beside_larger_ones_are_explained_as_they_are_alone() -> None:
    """Each is padded to the largest: with no record there, too, and with none at all."""
    alone = [_rays([0, 1], {1: (0.0, 20.0)}), _rays([0, 1, 2, 3, 4], {2: (30.0, -20.0)}), _rays([*range(9)], {})]
    v, B, firm = np.zeros((4, 9, 3)), np.zeros((4, 9, 3, 3)), np.zeros((4, 9), dtype=bool)
    present = np.zeros((4, 9), dtype=bool)
    for i, records in enumerate(alone):
        k = records.present.shape[1]
        v[i, :k], B[i, :k], present[i, :k] = records.v[0], records.B[0], True
    together = explain(BlockRecords(v, B, present, firm, np.full((4, 9), LIMIT)), np.zeros(4, dtype=bool))
    assert [np.flatnonzero(row).tolist() for row in together.out] == [[0, 1], [2], [], []]
    for i, records in enumerate(alone):
        by_itself = explain(records, np.array([False]))
        np.testing.assert_allclose(together.step[i], by_itself.step[0], atol=1e-12)
        np.testing.assert_allclose(together.gain[i], by_itself.gain[0], atol=1e-9)


def test_without_any_record_there_is_nothing_to_explain() -> None:
    none = BlockRecords(
        np.zeros((2, 0, 1)), np.zeros((2, 0, 1, 3)), *[np.zeros((2, 0), dtype=bool)] * 2, np.ones((2, 0))
    )
    assert explain(none, np.array([True, False])).out.shape == (2, 0)
