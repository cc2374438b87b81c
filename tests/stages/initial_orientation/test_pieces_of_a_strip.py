"""Pieces of a strip that share nothing, with control points of each other's number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.small_blocks import Small, adjusted_by, flown, off_m


def two_pieces(control: int) -> tuple[Small, list[str], list[str]]:
    """A strip of eight images of which the middle two share nothing; so many control points in each half."""
    small = flown(1, 8, points=40)
    middle = (small.position_m["104"][0] + small.position_m["105"][0]) / 2
    small.rays = {
        (i, p): xy
        for (i, p), xy in small.rays.items()
        if (small.position_m[i][0] < middle) == (small.xyz_m[p][0] < middle)
    }
    chosen = list[list[str]]()
    for sign in (-1, 1):
        half = [p for p in small.xyz_m if sum(q == p for _, q in small.rays) > 1]
        half = [p for p in half if sign * (small.xyz_m[p][0] - middle) > 0]
        towards = [[np.cos(a), np.sin(a), 0.0] for a in 0.4 + np.arange(control) * 2 * np.pi / control]
        chosen.append([max(half, key=lambda p, way=way: float(small.xyz_m[p] @ way)) for way in towards])
    small.observed, small.control = {}, dict.fromkeys([*chosen[0], *chosen[1]], "XYZ")
    return small, *chosen


@pytest.mark.slow
@pytest.mark.parametrize("chain", ["graph", "chain"])
@pytest.mark.parametrize("control", [4, 5])
def test_two_control_points_of_two_pieces_with_each_others_number_are_named(
    tmp_path: Path, chain: str, control: int
) -> None:
    small, left, right = two_pieces(control)
    a, b = left[1], right[2]
    folder = small.write(tmp_path / "b")
    table = folder / "ground_points.csv"
    text = table.read_text().replace(f"\n{a},", "\nOTHER,").replace(f"\n{b},", f"\n{a},")
    table.write_text(text.replace("\nOTHER,", f"\n{b},"))
    done = adjusted_by(chain, folder)
    assert any(f"fit with their numbers exchanged: {a}, {b}" in text for text in done.warnings)
    assert done.bundle.images.oriented.all()
    assert off_m(small, done.bundle) < 0.5
