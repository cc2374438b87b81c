"""The campaigns with small counts; each says at its top how to run it in full."""

from __future__ import annotations

import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.geometry.collinearity import collinearity
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.campaigns import gross_errors, groups
from tests.campaigns.kinds import ALL, CASES, TOGETHER, judged, one_block
from tests.campaigns.pair_of_the_notes import outcome
from tests.campaigns.separable import explaining
from tests.stages.geodetic_blocks import made

ROOT = Path(__file__).resolve().parents[2]
CAMPAIGNS = {
    "kills": ["4", "--made-up"],
    "faults": ["8", "--made-up"],
    "concurrency": ["1", "--made-up"],
    "corruptions": ["12", "--made-up"],
    "edits": ["2", "--short"],
    "edits_of_plans": ["100"],
    "kernels": ["2"],
    "equality": ["1"],
    "variance_components": ["--count", "2"],
    "ackermann": [],
    "classical_blocks": [],
    "rank_defects": ["--count", "2"],
    "near_defects": ["--count", "12"],
    "calibration": ["--count", "2", "--injections", "1"],
    "isp_1980": ["1"],
    "epochs": ["--count", "20"],
    "convergence_basin": ["1", "--few"],
    "merged_blocks": ["--strips", "6", "--images", "6"],
    "fuzz": ["all", "--count", "12"],
    "opened_files": ["--short"],
    "mutants": ["--count", "1", "--near", "--under", "aatri/geometry/vectors.py", "--at-least", "0"],
}


BESIDE = {"kills", "faults", "concurrency", "corruptions", "edits", "kernels", "equality", "opened_files", "mutants"}
"""Campaigns that fork this process, change its surroundings or the code: each has a process of its own."""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="campaigns fork their runs and kill them")
@pytest.mark.parametrize("name", CAMPAIGNS)
def test_nothing_goes_wrong_in_the_campaign(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if name == "faults" and shutil.which("gcc") is None and shutil.which("cc") is None:
        pytest.skip("no C compiler")
    if name == "opened_files" and shutil.which("strace") is None:
        pytest.skip("no strace: which files are opened is not seen")
    if name in BESIDE:
        command = [sys.executable, "-m", f"tests.campaigns.{name}", *CAMPAIGNS[name]]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    else:
        monkeypatch.setattr("sys.argv", [name, *CAMPAIGNS[name]])
        code = _carried_out(Path(__file__).with_name(f"{name}.py"))
        assert code == 0, capsys.readouterr()


def _carried_out(path: Path) -> object:
    """The exit code of a campaign that is carried out within this process."""
    try:
        runpy.run_path(str(path), run_name="__main__")
    except SystemExit as end:
        return end.code or 0
    return 0


@pytest.mark.slow
def test_every_group_is_named_and_a_clean_block_is_not_blamed() -> None:
    bad = [(block, way, found.told) for block, way, found in groups.outcomes(1, []) if found.bad]
    assert not bad


def test_the_errors_of_the_notes_pair_are_found_and_measured_and_nobody_else_is_blamed() -> None:
    recall, alarms, rms = outcome(1)
    assert recall >= 0.95
    assert alarms <= 2
    assert 0.6 < rms < 1.4  # of some 52 deviations, four standard deviations of it


@pytest.mark.slow
def test_with_six_control_points_no_ray_is_blamed_for_the_other() -> None:
    _, alarms, _ = outcome(1, control=6)
    assert alarms <= 2


def test_an_error_along_the_base_belongs_to_any_ray_of_its_strip_and_one_across_to_one_of_three() -> None:
    X0 = np.array([[-300.0, 0.0, 1000.0], [0.0, 0.0, 1000.0], [300.0, 0.0, 1000.0]])
    _, _, by_point = collinearity(X0, np.tile(np.eye(3), (3, 1, 1)), np.full((3, 3), 10.0), np.full(3, 153.0))
    B, along, across = by_point / 0.005, np.zeros((3, 2)), np.zeros((3, 2))
    along[1, 0] = across[1, 1] = 50.0
    assert explaining(B, along).tolist() == [0, 1, 2]
    assert explaining(B, across).tolist() == [1]
    assert explaining(B[:2], across[:2]).tolist() == [0, 1]
    assert explaining(B[:2], along[:2]).tolist() == []  # it moves the point, and no ray disagrees


@pytest.mark.slow
def test_gross_errors_leave_a_block_as_good_as_without() -> None:
    for name, figures, bad in gross_errors.outcomes(1, ["image_points", "swapped_numbers"], "film"):
        assert not bad, (name, figures)
        assert figures["found"] >= 0.98 * figures["wrong"], name


@pytest.mark.slow
def test_all_kinds_at_once_are_as_accurate_as_their_covariances_say() -> None:
    found = [one_block(TOGETHER, seed) for seed in range(1, 7)]
    assert found[0].kinds >= 13
    lines = judged(found, 0.01 / 4)
    assert all(ok for ok, _ in lines), lines


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_each_kind_alone_is_as_accurate_as_its_covariances_say(case: str) -> None:
    lines = judged([one_block(case, seed) for seed in range(1, 5)], 0.01 / (4 * len(CASES)))
    assert all(ok for ok, _ in lines), lines


@pytest.mark.slow
def test_large_gross_errors_of_every_kind_are_found() -> None:
    """Of geodetic observations and relative control of a surveyed block: those above twice the detectable error."""
    missed: list[tuple[int, str, int, float]] = []
    count = 0
    for seed in range(1, 4):
        gross = {"geodetic": 6, "relative_control": 3, "size_sigmas": (40.0, 60.0)}
        surveyed = ALL | {"gnss": {}, "rig": {}}
        detectable = _detectable(made(seed, 1000.0, **surveyed))
        block = made(seed, 1000.0, **surveyed, gross_errors=gross)
        # Six of some hundred geodetic observations, but up to three of the twelve of one kind.
        options = BundleOptions.model_validate({"blunders": {"method": "robust_snooping", "max_share": 0.3}})
        solution = bundle(block, calibrated(block), options=options)
        assert block.gross_errors is not None
        assert 0.8 < solution.sigma0 < 1.2
        found = set(zip(solution.suspects.kind.tolist(), solution.suspects.row.tolist()))
        for kind, row, size in zip(block.gross_errors.kind.tolist(), block.gross_errors.row, block.gross_errors.size):
            in_detectable = float(np.nanmax(np.abs(size) / detectable.get((kind, int(row)), np.full(3, np.inf))))
            if in_detectable > 2.0:
                count += 1
                if (kind, int(row)) not in found:
                    missed.append((seed, kind, int(row), in_detectable))
    assert count >= 12
    assert len(missed) <= 0.02 * count, (missed, count)


def _detectable(block: Block) -> dict[tuple[str, int], Float]:
    """Detectable error of every observation of a block without gross errors; infinite where nothing controls it."""
    solution = bundle(block, calibrated(block), options=BundleOptions(blunders="none", reliability=True))
    rows, tests = solution.residuals, solution.tests
    assert tests is not None
    size = np.where(np.isfinite(tests.detectable), tests.detectable, np.inf)
    return dict(zip(zip(rows.kind.tolist(), rows.row.tolist()), size))


@pytest.mark.slow
def test_point_numbers_whose_exchange_leads_least_squares_astray_are_found_from_the_start_as_given() -> None:
    (name, figures, bad), *others = gross_errors.outcomes(700, ["swapped_numbers"], "uav")
    assert not others
    assert name == "swapped_numbers"
    assert not bad
    assert figures["found"] == figures["wrong"] == 40
