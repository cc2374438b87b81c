"""The report is written where a run fails, too: nothing is compiled before the error is told."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import aatri

ROOT = Path(aatri.__file__).parents[1]


@pytest.mark.slow
def test_the_page_imports_no_numba() -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)])}
    code = "import sys, aatri.report.page; print('numba' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "False"
