"""The campaigns with small counts; each says at its top how to run it in full."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CAMPAIGNS = {
    "kills": ["6", "--made-up"], "faults": ["12", "--made-up"], "concurrency": ["1", "--made-up"],
    "corruptions": ["20", "--made-up"], "edits": ["6", "--short"],
    "edits_of_plans": ["100"], "kernels": ["2"], "equality": ["2"],
    "convergence_basin": ["1"],
}  # fmt: skip


@pytest.fixture(scope="session")
def compiled_code() -> str:
    """Compiled code is kept from one session to the next."""
    return os.environ.get("NUMBA_CACHE_DIR") or str(Path.home() / ".cache" / "aatri" / "numba")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="campaigns fork their runs and kill them")
@pytest.mark.parametrize("name", CAMPAIGNS)
def test_nothing_goes_wrong_in_the_campaign(name: str, compiled_code: str) -> None:
    if name == "faults" and shutil.which("gcc") is None and shutil.which("cc") is None:
        pytest.skip("no C compiler")
    command = [sys.executable, "-m", f"tests.campaigns.{name}", *CAMPAIGNS[name]]
    environment = {**os.environ, "NUMBA_CACHE_DIR": compiled_code}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
