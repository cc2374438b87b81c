"""Strips that share five points with the next one each, in part with each other's numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.small_blocks import Small, flown, off_m
from tests.stages.film_blocks import Told

SHARED = 5


def of_three(control: str, shifts: dict[str, int]) -> Small:
    """Three strips; a strip beside the middle one has the numbers of the shared points shifted cyclically by so many.

    Parameters
    ----------
    control : str
        The strip that has all of it.
    shifts : dict of str to int
        Of S1 and S3; one that is not named shares nothing.
    """
    small = flown(3, 4, points=40)
    strips = {p: {small.strip[i][0] for i, q in small.rays if q == p} for p in small.xyz_m}
    number, xyz_m = dict[tuple[str, str], str](), dict(small.xyz_m)
    for strip in ("S1", "S3"):
        both = [p for p in small.xyz_m if strips[p] == {strip, "S2"} and sum(q == p for _, q in small.rays) > 5]
        spread = sorted(both, key=lambda p: small.xyz_m[p][0])
        kept = [spread[k] for k in np.linspace(0, len(spread) - 1, SHARED).astype(int)] if strip in shifts else []
        number |= {(strip, p): kept[(k + shifts[strip]) % SHARED] for k, p in enumerate(kept)}
    rays = {}
    for (i, p), xy in small.rays.items():
        strip = small.strip[i][0]
        name = p if strip == "S2" or len(strips[p]) == 1 else number.get((strip, p), f"{p}{strip}")
        rays[i, name] = xy
        xyz_m.setdefault(name, small.xyz_m[p])
    small.rays, small.xyz_m, small.observed = rays, xyz_m, {}
    holding = {p: {small.strip[i][0] for i, q in rays if q == p} for p in xyz_m}
    own = [p for p in xyz_m if holding[p] == {control} and sum(q == p for _, q in rays) > 1]
    corners = [min(own, key=lambda p: xyz_m[p][:2] @ to) for to in ((1, 1), (-1, 1), (1, -1), (-1, -1))]
    small.control = dict.fromkeys(corners, "XYZ")
    return small


def oriented(small: Small, folder: Path) -> tuple[Solution, Told]:
    told = Told()
    block = tables(options=TablesOptions(path=small.write(folder)), context=told)
    return graph(block, calibrated(block, context=told), context=told, rng=np.random.default_rng(1)), told


def strips_of(small: Small, solution: Solution) -> set[str]:
    return {small.strip[i][0] for i in solution.images.id[solution.images.oriented].tolist()}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shifts", "good"),
    [
        pytest.param({"S1": 2, "S3": 2}, {"S2"}, id="both contradict"),
        pytest.param({"S1": 2}, {"S2"}, id="one contradicts, the other shares nothing"),
        pytest.param({"S1": 2, "S3": 0}, {"S2", "S3"}, id="one contradicts, the other fits"),
    ],
)
def test_a_strip_that_contradicts_what_it_shares_stays_apart(
    tmp_path: Path, shifts: dict[str, int], good: set[str]
) -> None:
    small = of_three("S2", shifts)
    solution, told = oriented(small, tmp_path / "b")
    assert strips_of(small, solution) == good
    assert off_m(small, solution) < 1.0
    apart = [text for text in told.warnings if "stays apart" in text]
    assert len(apart) == 3 - len(good)
    assert any("by the images and points it shares with others" in text and "101, 102" in text for text in apart)


@pytest.mark.slow
def test_a_strip_whose_neighbour_is_placed_after_it_is_oriented_by_it(tmp_path: Path) -> None:
    small = of_three("S3", {"S1": 0, "S3": 0})
    solution, told = oriented(small, tmp_path / "b")
    assert strips_of(small, solution) == {"S1", "S2", "S3"}
    assert off_m(small, solution) < 1.0
    assert not [text for text in told.warnings if "stays apart" in text]
