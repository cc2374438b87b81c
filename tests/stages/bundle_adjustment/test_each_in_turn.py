"""Distances, control and their like that contradict each other: each is tried against the others of its kind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.bundle_adjustment.test_bundle_input import CORNERS, OF
from tests.stages.hand_block import Heard, ground_rows, read, start, suspected

BARS = ((0, 5), (24, 29), (7, 22), (2, 26))
"""Pairs of points whose distance is measured."""


def _noisy() -> np.ndarray:
    """2 um of noise, a sigma0 of 0.4: residuals of an example without any say nothing."""
    return OF.xy_mm + np.random.default_rng(3).normal(0, 0.005, OF.xy_mm.shape)


def _with_bars(folder: Path, count: int, wrong: int, times: float, begins: float = 1.0) -> tuple[Solution, Heard]:
    """The block on a free datum, scaled by bars of which one is too long; the start has the scale `begins`."""
    rows = []
    for k, (a, b) in enumerate(BARS[:count]):
        d = float(np.linalg.norm(OF.xyz_m[a] - OF.xyz_m[b])) * (times if k == wrong else 1.0)
        rows.append(f"distance,p{a:02},p{b:02},{d!r},0.05")
    folder.mkdir()
    (folder / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *rows]) + "\n")
    block, points = read(folder, OF, xy_mm=_noisy())
    begin = start(OF, block, position_m=begins * OF.position_m, xyz_m=begins * OF.xyz_m)
    heard = Heard()
    return bundle(block, points, begin, options=BundleOptions(datum="free"), context=heard), heard


def _called(bar: int) -> str:
    a, b = BARS[bar]
    return f"p{a:02}-p{b:02}"


def _out(solution: Solution, kind: str) -> list[int]:
    s = solution.suspects
    return sorted(s.row[(s.kind == kind) & s.staying_out].tolist())


@pytest.mark.slow
def test_a_wrong_control_point_that_the_datum_rests_on_stays_and_is_named(tmp_path: Path) -> None:
    """One of three, 5 m off, contradicts four bars; without it a turn of the block would be open."""
    bars = [(a, b, float(np.linalg.norm(OF.xyz_m[a] - OF.xyz_m[b]))) for a, b in ((0, 5), (5, 24), (0, 24), (2, 26))]
    rows = [f"distance,p{a:02},p{b:02},{d!r},0.05" for a, b, d in bars]
    (tmp_path / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *rows]) + "\n")
    ground = ground_rows(OF, CORNERS[:3], off=np.outer([0, 0, 1], [-3.0, 4.0, 0.0]))
    block, points = read(tmp_path, OF, ground=ground, xy_mm=_noisy())
    heard = Heard()
    solution = bundle(block, points, start(OF, block), options=BundleOptions(max_sigma0=1e9), context=heard)
    assert _out(solution, "control") == []
    assert any(text.startswith("control: ") and "kept" in text and f"p{CORNERS[2]}" in text for text in heard.warned)
    assert any(text.startswith("control: ") and "without them the datum is open" in text for text in heard.warned)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("begins", [1.0, 1.01, 1.02])
@pytest.mark.parametrize("wrong", [0, 1])
def test_of_two_bars_that_contradict_each_other_neither_is_rejected(tmp_path: Path, wrong: int, begins: float) -> None:
    solution, heard = _with_bars(tmp_path / "two", 2, wrong, 1.02, begins)
    assert _out(solution, "distance") == []
    (line,) = [text for text in heard.warned if "nothing tells which" in text]
    assert line.startswith("distance: one of these is wrong")
    assert all(f"p{a:02}" in line for a, _ in BARS[:2])
    assert sorted(solution.suspects.verdict[solution.suspects.kind == "distance"].tolist()) == ["kept", "kept"]


@pytest.mark.slow
def test_rays_are_not_blamed_for_two_bars_that_contradict_each_other(tmp_path: Path) -> None:
    """5 mm for bars of metres that differ by a tenth: with these weights they would bend the block."""
    solution, heard = _with_bars(tmp_path / "two", 2, 0, 1.1)
    clean, _ = _with_bars(tmp_path / "clean", 2, 0, 1.0)
    assert solution.sigma0 == pytest.approx(clean.sigma0, abs=0.02)
    assert "image_point" not in solution.suspects.kind
    assert not [text for text in heard.warned if text.startswith("image_point")]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("begins", [1.0, 1.02])
@pytest.mark.parametrize("wrong", [0, 1, 3])
def test_of_four_bars_the_wrong_one_goes_whatever_the_start(tmp_path: Path, wrong: int, begins: float) -> None:
    solution, heard = _with_bars(tmp_path / "four", 4, wrong, 1.02, begins)
    (row,) = _out(solution, "distance")
    assert solution.suspects.point[solution.suspects.row == row].tolist() == [_called(wrong)]
    assert not [text for text in heard.warned if "nothing tells which" in text]


def test_a_block_on_four_exact_points_of_a_stretched_sheet_loses_none_of_them(tmp_path: Path) -> None:
    """The corners of the sheet, 2 % longer in X than in Y: each of them explains as much."""
    xyz = OF.xyz_m * [1.0006, 0.9994, 1.0]
    rows = [f"p{p:02},{x!r},{y!r},{z!r},0,0,0" for p, (x, y, z) in zip(CORNERS, xyz[list(CORNERS)].tolist())]
    ground = "\n".join(["point,X,Y,Z,sX,sY,sZ", *rows]) + "\n"
    block, points = read(tmp_path, OF, ground=ground, xy_mm=_noisy())
    heard = Heard()
    solution = bundle(block, points, start(OF, block), options=BundleOptions(max_sigma0=1e9), context=heard)
    assert _out(solution, "control") == []


def test_what_earlier_stages_left_out_gets_its_two_components_here(tmp_path: Path) -> None:
    """An earlier stage knows a y-parallax; the bundle sees both components of the error, 0.2 and -0.3 mm."""
    measured = _noisy()
    row = int(np.flatnonzero((OF.image == 1) & (OF.point == 14))[0])
    measured[row] += [0.2, -0.3]
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), xy_mm=measured)
    before = replace(suspected("image_point", [row]), size=np.array([0.017]), test=np.array([5.0]))
    s = bundle(block, points, start(OF, block, before)).suspects
    assert s.stage.tolist() == ["earlier"]
    np.testing.assert_allclose(s.error[0, :2], [0.2, -0.3], atol=0.02)
    assert np.isnan(s.error[0, 2])
    assert s.size[0] == pytest.approx(np.hypot(0.2, 0.3), abs=0.02)
    assert s.test[0] > 20


def test_none_uses_what_an_earlier_stage_left_out_and_says_so(tmp_path: Path) -> None:
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS), xy_mm=_noisy())
    begin = start(OF, block, suspected("image_point", [3, 9]))
    heard = Heard()
    solution = bundle(block, points, begin, options=BundleOptions(blunders="none"), context=heard)
    assert solution.suspects.verdict.tolist() == ["readmitted"] * 2
    assert solution.residuals.active[np.isin(solution.residuals.row, [3, 9])].all()
    assert any("left out by earlier stages, taken back" in text and "2 image_point" in text for text in heard.logged)
    heard = Heard()
    bundle(block, points, begin, context=heard)
    assert any("stays out unless it fits" in text for text in heard.logged)


def test_a_robust_adjustment_lists_all_kinds(tmp_path: Path) -> None:
    off = np.zeros((len(CORNERS), 3))
    off[1, 2] = 5.0
    block, points = read(tmp_path, OF, ground=ground_rows(OF, CORNERS, off=off), xy_mm=_noisy())
    solution = bundle(block, points, start(OF, block), options=BundleOptions(blunders="robust"))
    s = solution.suspects
    assert 1 in s.row[s.kind == "control"].tolist()
    assert (s.unit[s.kind == "control"] == "m").all()


@pytest.mark.parametrize("wrong", range(4))
def test_an_exact_control_point_far_off_goes_alone_and_all_rays_stay(tmp_path: Path, wrong: int) -> None:
    """One of four, 5 m off, in a block of few points: it bends every ray, as standard deviations too small would."""
    chosen = np.union1d(CORNERS, np.arange(1, 29, 2))
    seen = np.isin(OF.point, chosen)
    few = replace(
        OF,
        xyz_m=OF.xyz_m[chosen],
        image=OF.image[seen],
        point=np.searchsorted(chosen, OF.point[seen]),
        xy_mm=OF.xy_mm[seen],
    )
    corners, off = np.searchsorted(chosen, CORNERS).tolist(), np.zeros((len(CORNERS), 3))
    off[wrong] = [3.0, -4.0, 0.0]
    ground = ground_rows(few, corners, tail=",0,0,0", head=",sX,sY,sZ", off=off)
    block, points = read(tmp_path, few, ground=ground, xy_mm=_noisy()[seen])
    heard = Heard()
    solution = bundle(block, points, start(few, block), options=BundleOptions(max_sigma0=1e9), context=heard)
    assert _out(solution, "control") == [wrong]
    assert _out(solution, "image_point") == []
    assert not [text for text in heard.warned if "ask for" in text]
