"""Exchanged numbers, mirrored marks and wrong scales are recognised."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.orientation.interior.fiducial_numbering import is_misfit, renumbering, scale_problem

CORNERS = np.array([[106.0, -106.0], [-106.0, -106.0], [-106.0, 106.0], [106.0, 106.0]])
EIGHT = np.concatenate([CORNERS, [[112.0, 0.0], [-112.0, 0.0], [0.0, 112.0], [0.0, -112.0]]])


def turned(points: np.ndarray, degrees: float) -> np.ndarray:
    a = np.deg2rad(degrees)
    return points @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])


def test_exchanged_numbers_are_found() -> None:
    order = [1, 0, 2, 3, 4, 6, 5, 7]
    assert renumbering(turned(EIGHT[order], 1.0) + 50.0, EIGHT).tolist() == order


@pytest.mark.parametrize("quarter", [0, 90, 180, 270])
def test_a_scan_on_its_side_with_one_exchange_gives_a_numbering_that_fits(quarter: float) -> None:
    measured = turned(CORNERS[[1, 0, 2, 3]], quarter + 0.5)
    found = renumbering(measured, CORNERS)
    assert found is not None
    design = np.column_stack([measured, np.ones(4)])
    solution = np.linalg.lstsq(design, CORNERS[found], rcond=None)[0]
    assert np.abs(design @ solution - CORNERS[found]).max() < 1e-9
    assert np.linalg.det(solution[:2]) > 0


def test_a_mark_that_is_elsewhere_is_no_exchange() -> None:
    measured = CORNERS.copy()
    measured[2] = [0.0, 40.0]
    assert renumbering(measured, CORNERS) is None


@pytest.mark.parametrize(
    ("scale", "told"),
    [
        (1.0, ""),
        (1.019, ""),
        (25.4, "inches taken"),
        (1e-3, "micrometres taken"),
        (1000.0, "metres taken"),
        (0.96, "0.96"),
    ],
)
def test_scales(scale: float, told: str) -> None:
    found = scale_problem(scale * np.eye(2))
    assert told in found
    assert bool(found) == bool(told)


def test_misfits() -> None:
    assert is_misfit(np.array([[0.0, 5.0]] * 4), CORNERS)
    assert not is_misfit(np.array([[0.0, 0.5]] * 4), CORNERS)
