"""`aatri plot`: pictures by name as files of three formats."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from aatri.cli.main import app
from tests.made_solutions import made_block
from tests.report.test_page import made_artifacts, make_run


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return make_run(tmp_path / "run", made_artifacts(made_block(columns=6)))


def test_pictures_are_listed_and_a_wrong_name_is_answered(run: Path) -> None:
    listed = CliRunner().invoke(app, ["plot", str(run)])
    assert listed.exit_code == 0
    assert {"plan", "differences_height", "ties", "angles"} <= {line.split()[0] for line in listed.stdout.splitlines()}
    wrong = CliRunner().invoke(app, ["plot", str(run), "plann"])
    assert wrong.exit_code == 2
    assert "did you mean 'plan'" in wrong.output


@pytest.mark.slow
@pytest.mark.parametrize(("form", "begin"), [("svg", b"<?xml"), ("png", b"\x89PNG"), ("pdf", b"%PDF")])
def test_a_picture_is_a_file_and_the_same_each_time(run: Path, tmp_path: Path, form: str, begin: bytes) -> None:
    pytest.importorskip("matplotlib")
    names = ["plan", "angles", "ties"] if form == "svg" else ["plan"]
    made = []
    for folder in ("a", "b"):
        done = CliRunner().invoke(app, ["plot", str(run), *names, "--format", form, "--into", str(tmp_path / folder)])
        assert done.exit_code == 0, done.output
        made.append({file.name: file.read_bytes() for file in (tmp_path / folder).iterdir()})
    assert made[0] == made[1]
    assert all(content.startswith(begin) for content in made[0].values())
    assert f"plan.{form}" in made[0]
