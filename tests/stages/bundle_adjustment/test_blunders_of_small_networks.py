"""Levelling networks of few observations: good rows stay where standard deviations are too small, gross errors go."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle

HEAD = """aatri_block: 1
name: levelling
terrain_height: 10.0
frames: {local: {axes: [east, north, up], crs: local}}
earth_curvature: ignore
units: {ground: m, angle: deg, sigma_image: um, sigma_ground: m, sigma_angle: deg, time: s}
"""
HEIGHTS = {"A": 10.0, "B": 11.5, "C": 10.8, "D": 14.2, "E": 9.1, "F": 12.6}
LINES = ("AB", "BC", "CA", "BD", "DC", "CE", "EA", "DF", "FE")
SIGMA = 0.001


def _adjusted(
    folder: Path, seed: int, *, times: float = 1.0, off_m: float = 0.0, lines: tuple[str, ...] = LINES
) -> Solution:
    """Nine lines, redundancy four; noise `times` what it is said to be, one line off."""
    folder.mkdir()
    rng = np.random.default_rng(seed)
    (folder / "block.yaml").write_text(HEAD)
    used = sorted({name for line in lines for name in line})
    points = [f"{k},,,{HEIGHTS[k]},{'0' if k == 'A' else ''},{'control' if k == 'A' else 'approximate'}" for k in used]
    (folder / "ground_points.csv").write_text("\n".join(["point,X,Y,Z,sZ,role", *points]) + "\n")
    rows = []
    for k, (a, b) in enumerate(lines):
        value = HEIGHTS[b] - HEIGHTS[a] + rng.normal(0, times * SIGMA) + (off_m if k == 3 else 0.0)
        rows.append(f"height_difference,{a},{b},{value!r},{SIGMA}")
    (folder / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *rows]) + "\n")
    return bundle(tables(options=TablesOptions(path=folder)), options=BundleOptions())


def _rejected(solution: Solution) -> list[int]:
    mine = (solution.residuals.kind == "height_difference") & ~solution.residuals.active
    return solution.residuals.row[mine].tolist()


def test_standard_deviations_too_small_by_four_cost_no_observation(tmp_path: Path) -> None:
    kept = 0
    for seed in range(10):
        solution = _adjusted(tmp_path / str(seed), seed, times=4.0)
        assert not _rejected(solution)
        assert solution.redundancy == 4
        kept += int((solution.suspects.verdict == "kept").any())
    assert kept >= 5  # and it is said that something is beyond the limit


def test_a_gross_error_that_stands_out_goes(tmp_path: Path) -> None:
    found = [_rejected(_adjusted(tmp_path / str(seed), seed, off_m=0.3)) for seed in range(5)]
    assert found == [[sorted(LINES).index("BD")]] * 5


def test_a_single_loop_loses_nothing(tmp_path: Path) -> None:
    """One redundant observation: every one of the loop could be the wrong one."""
    solution = _adjusted(tmp_path / "loop", 1, lines=("AB", "BC", "CA"), times=0.0)
    assert solution.redundancy == 1
    solution = _adjusted(tmp_path / "wrong", 1, lines=("AB", "BC", "CE", "EA"), off_m=0.02)
    assert not _rejected(solution)
    assert solution.redundancy == 1
    assert solution.sigma0 == pytest.approx(0.02 / SIGMA / 2, rel=0.2)


def test_two_control_points_of_a_network_that_contradict_each_other_are_both_named(tmp_path: Path) -> None:
    xyz_m = {"A": (0, 0, 10), "B": (300, 40, 25), "C": (-60, 280, 5), "D": (350, 330, 30), "E": (160, 120, 18)}
    (tmp_path / "block.yaml").write_text(HEAD)
    lines = list(combinations(xyz_m, 2))
    rows = [f"distance,{a},{b},{float(np.linalg.norm(np.subtract(xyz_m[b], xyz_m[a])))!r},0.003" for a, b in lines]
    rows += [f"height_difference,{a},{b},{xyz_m[b][2] - xyz_m[a][2]},0.002" for a, b in lines]
    rows.append(f"azimuth,A,B,{float(np.degrees(np.arctan2(300, 40)))!r},0.001")
    (tmp_path / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *rows]) + "\n")
    points = ["A,0,0,10,0.002,0.002,0.002,control", "D,350,330,30.2,0.002,0.002,0.002,control"]
    points += [f"{k},{x + 0.05},{y},{z},,,,approximate" for k, (x, y, z) in xyz_m.items() if k not in "AD"]
    (tmp_path / "ground_points.csv").write_text("\n".join(["point,X,Y,Z,sX,sY,sZ,role", *points]) + "\n")
    solution = bundle(tables(options=TablesOptions(path=tmp_path)), options=BundleOptions())
    of_control = solution.suspects.kind == "control"
    assert sorted(solution.suspects.point[of_control].tolist()) == ["A", "D"]
    assert solution.sigma0 < 1.0
