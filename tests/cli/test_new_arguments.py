"""Arguments of `aatri new` that say two things at once are refused, not dropped."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from aatri.cli.main import app
from tests.formats.opensfm.made_project import write_project


def invoked(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["new", *(str(a) for a in arguments)])


def _refused(*arguments: object) -> str:
    result = invoked(*arguments)
    assert result.exit_code == 2, result.stderr
    return " ".join(result.stderr.split())


def test_a_source_is_not_taken_for_the_folder_to_write_to(tmp_path: Path) -> None:
    """Of `--from A B C` the command line takes B for FOLDER."""
    folder = write_project(tmp_path / "odm")
    flight, other = tmp_path / "positions.txt", tmp_path / "flight"
    flight.write_text("image X Y Z\nIMG_0.JPG 0 0 100\n")
    (other / "day_1").mkdir(parents=True)
    (other / "day_1" / "positions.txt").write_text(flight.read_text())
    for words in (("--from", folder, flight, other), ("--from", folder, other, flight), ("--from", folder, other)):
        assert "FOLDER comes before --from: `aatri new FOLDER --from A B C`" in _refused(*words)
    assert not (other / "pipeline.yaml").exists()


def test_a_folder_that_is_empty_or_has_the_source_or_is_this_one_is_written_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_project(tmp_path / "odm" / "opensfm")
    (tmp_path / "empty" / ".git").mkdir(parents=True)
    (tmp_path / "empty" / ".git" / "HEAD").write_text("ref\n")
    (tmp_path / "empty" / ".gitignore").write_text("runs\n")
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "notes.txt").write_text("notes\n")
    for target in (tmp_path / "empty", tmp_path / "odm"):
        result = invoked(target, "--from", folder)
        assert result.exit_code == 0, result.stderr
    monkeypatch.chdir(tmp_path / "here")
    assert invoked("--from", folder).exit_code == 0
    assert "is there already" in _refused("--from", folder)


def test_options_beside_those_that_they_do_not_go_with_are_refused(tmp_path: Path) -> None:
    folder = write_project(tmp_path / "odm")
    target = tmp_path / "o"
    assert "a second path" in _refused(target, tmp_path / "a", tmp_path, "--block", "photos")
    for block in ("film", "simulate"):
        assert "leave --block out" in _refused(target, "--from", folder, "--block", block)
    for words in (["--set", "crs=EPSG:25832"], ["--without", "a.txt"], ["--lens-misfit", "1"]):
        assert "go with --from" in _refused(target, *words)
    plugin = ["--plugin", "interior_orientation/mine"]
    for words in ([tmp_path / "a"], ["--from", folder], ["--block", "film"], ["--set", "crs=EPSG:25832"]):
        assert "--plugin beside a block" in _refused(target, *words, *plugin)
    assert not target.exists()
