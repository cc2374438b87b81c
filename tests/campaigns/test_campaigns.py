"""The campaigns with small counts; each says at its top how to run it in full."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CAMPAIGNS = {
    "kills": ["6", "--made-up"],
    "faults": ["12", "--made-up"],
    "concurrency": ["1", "--made-up"],
    "corruptions": ["20", "--made-up"],
    "edits": ["6", "--short"],
    "edits_of_plans": ["100"],
    "kernels": ["2"],
    "equality": ["2"],
    "variance_components": ["--count", "2"],
    "ackermann": [],
    "classical_blocks": [],
    "rank_defects": ["--count", "10"],
    "near_defects": ["--count", "12"],
    "calibration": ["--count", "4", "--injections", "1"],
    "isp_1980": ["12"],
    "convergence_basin": ["1"],
    "fuzz": ["all", "--count", "25"],
    "opened_files": ["--short"],
    "mutants": ["--count", "2", "--near", "--under", "aatri/geometry/vectors.py", "--at-least", "0"],
}


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="campaigns fork their runs and kill them")
@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n == "opened_files")) for n in CAMPAIGNS])
def test_nothing_goes_wrong_in_the_campaign(name: str) -> None:
    if name == "faults" and shutil.which("gcc") is None and shutil.which("cc") is None:
        pytest.skip("no C compiler")
    if name == "opened_files" and shutil.which("strace") is None:
        pytest.skip("no strace: which files are opened is not seen")
    command = [sys.executable, "-m", f"tests.campaigns.{name}", *CAMPAIGNS[name]]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
