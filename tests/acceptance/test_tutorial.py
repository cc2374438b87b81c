"""Pages with commands are followed literally: every command is run, and every output shown is the output.

APPROVE=1 pytest -m slow tests/acceptance/test_tutorial.py     draws the pictures of the tutorial anew
"""

from __future__ import annotations

import math
import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aatri.cli.main import app
from aatri.report.drawing.standalone import standalone
from aatri.report.page import seen_in
from aatri.report.questions import gallery

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs/tutorial"
SECONDS = re.compile(r"\d+\.\d\d$")


def _steps(page: str) -> list[tuple[str, str]]:
    """Commands and what they print, as the page has them."""
    steps = []
    for block in re.findall(r"^```console\n(.*?)^```$", page, flags=re.MULTILINE | re.DOTALL):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, output = part.partition("\n")
            steps.append((command, output))
    return steps


def _without_seconds(text: str) -> str:
    """The column of seconds differs from run to run."""
    return "\n".join(SECONDS.sub("", line.rstrip()).rstrip() for line in text.rstrip().splitlines())


def _alike(printed: str, shown: str) -> bool:
    """The same words, and numbers that differ by rounding alone: last digits depend on the processor."""
    words, others = printed.split(), shown.split()
    return len(words) == len(others) and all(a == b or _same_number(a, b) for a, b in zip(words, others))


def _same_number(a: str, b: str) -> bool:
    try:
        return math.isclose(float(a), float(b), rel_tol=1e-4)
    except ValueError:
        return False


def _printed(command: str, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    """What a line of commands prints, and what `aatri` says beside it; `aatri` is called here, all else by a shell."""
    printed = said = ""
    for part in re.split(r" && (?=\w)", command):
        words, _, after = part.partition(" | ")
        if words.startswith("cd "):
            monkeypatch.chdir(words.removeprefix("cd "))
        elif words.startswith("aatri "):
            done = CliRunner().invoke(app, shlex.split(re.sub(r" 2?>.*", "", words))[1:])
            if done.exception and not isinstance(done.exception, SystemExit):
                raise done.exception
            said += done.stderr
            of_this = "" if words.endswith(" > /dev/null") else done.output if words.endswith("2>&1") else done.stdout
            printed += _by_shell(after, of_this) if after else of_this
            if done.exit_code:
                break
        else:
            printed += _by_shell(part)
    return printed, said


def _by_shell(command: str, given: str = "") -> str:
    return subprocess.run(["bash", "-c", command], input=given, stdout=subprocess.PIPE, text=True, check=False).stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "pictures"), [("tutorial.md", True), ("other_programs.md", False), ("what_now.md", False)]
)
def test_what_a_page_shows_is_what_happens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, page: str, pictures: bool
) -> None:
    project = tmp_path / "tutorial"
    shutil.copytree(FOLDER, project)
    monkeypatch.setenv("LC_ALL", "C.UTF-8")
    monkeypatch.setenv("COLUMNS", "200")
    steps = _steps((ROOT / "docs" / page).read_text(encoding="utf-8"))
    assert len(steps) > 8
    drawn = not pictures
    for command, shown in steps:
        monkeypatch.chdir(project)
        happened, said = _printed(command, monkeypatch)
        printed, expected = _without_seconds(happened), _without_seconds(shown)
        assert _alike(printed, expected), f"$ {command}\n{said}\n{printed}\n instead of\n{expected}"
        if command.startswith("aatri run") and not drawn:
            picture = standalone(gallery(*seen_in(project / "run")).pictures["plan"])
            if os.environ.get("APPROVE"):
                (FOLDER / "plan.svg").write_text(picture, encoding="utf-8")
            drawn = (FOLDER / "plan.svg").read_text(encoding="utf-8") == picture
            assert drawn, "docs/tutorial/plan.svg is not what the report draws"
