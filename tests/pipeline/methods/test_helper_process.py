"""A process that calls functions for this one: its answers, its errors, its end; and from a script without a guard."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from aatri.errors import ResourceError
from aatri.pipeline.methods.helper_process import HelperProcess


def test_it_answers_one_call_after_the_other_and_passes_errors_on() -> None:
    with HelperProcess(HELPED="yes") as helper:
        assert helper.call(math.sqrt, 9.0) == 3.0
        assert helper.call(os.getenv, "HELPED") == "yes"
        with pytest.raises(ValueError, match="math domain error"):
            helper.call(math.sqrt, -1.0)
        helper.call(print, "not an answer")
        assert helper.call(os.getpid) != os.getpid()


def test_a_process_that_ends_is_an_error() -> None:
    with HelperProcess() as helper, pytest.raises(ResourceError, match="ended from outside"):
        helper.call(os._exit, 3)


def test_a_script_that_is_not_guarded_runs_once(tmp_path: Path) -> None:
    (tmp_path / "json.py").write_text("raise SystemExit('imported from the working folder')")
    (tmp_path / "script").mkdir()
    script = tmp_path / "script" / "script.py"
    script.write_text(
        "import math\n"
        "from aatri.pipeline.methods.helper_process import HelperProcess\n"
        "with HelperProcess() as helper:\n"
        "    print(helper.call(math.floor, 2.5))\n"
    )
    path = os.pathsep.join(filter(None, sys.path))
    done = subprocess.run(
        [sys.executable, script],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout, done.stderr) == ("2\n", "")
