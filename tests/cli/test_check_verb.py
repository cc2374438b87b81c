"""`aatri check` says what a run would refuse, all of it at once, and writes nothing."""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from aatri.cli.main import app
from aatri.pipeline.methods import compile_kernels
from aatri.pipeline.store import inside

WITHOUT_COMPILER = compile_kernels.without_compiler
"""Which other tests do without."""

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    return Path(shutil.copytree(TUTORIAL, tmp_path / "project"))


def check(project: Path, *more: str) -> Result:
    return CliRunner().invoke(app, ["check", str(project), *more])


def replaced(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


@pytest.mark.slow
def test_a_project_in_order_is_read_and_left_alone(project: Path) -> None:
    before = sorted(project.rglob("*"))
    result = check(project)
    assert result.exit_code == 0, result.output
    assert "15 images, 67 points, 419 image points" in result.stdout
    assert "nothing that a run would refuse" in result.stdout
    assert sorted(project.rglob("*")) == before


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [("check", "project"), ("new", "made", "--from", "project/quarry")])
def test_where_nothing_is_compiled_yet_nothing_is_compiled(
    project: Path, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    """A check of a fresh environment compiled all kernels, one after the other, for half a minute."""
    code = "import sys\nfrom aatri.cli.main import app\ntry: app()\nfinally: print('numba' in sys.modules)"
    caches = {"XDG_CACHE_HOME": str(tmp_path / "cache"), "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    environment = {**os.environ, **caches, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("False\n")
    assert ("nothing that a run would refuse" in done.stdout) == (arguments[0] == "check")
    assert not [*tmp_path.rglob("*.nbi")]


OWN_ERROR = """

class OddError(GeometryError):
    exit_code = 5

    def __init__(self, size: float, *, unit: str) -> None:
        super().__init__(f"{size} {unit} is odd", remedy="give an even one")
        self.tell = lambda: size
"""
VALIDATOR = """
    @field_validator("example")
    @classmethod
    def _even(cls, value: float) -> float:
        if value == 3.0:
            raise OddError(value, unit="mm")
        return value

"""


@pytest.mark.slow
def test_what_another_process_refuses_is_told_as_here(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stages are imported in a process that ends; an error of a local stage may be of a class that only it knows."""
    monkeypatch.setattr(compile_kernels, "without_compiler", WITHOUT_COMPILER)
    monkeypatch.chdir(project)
    pipeline, stage = project / "pipeline.yaml", project / "stages" / "interior_orientation" / "mine.py"
    replaced(pipeline, "bundle_adjustment/bundle", "bundle_adjustment/bundl")
    refused = check(project)
    assert (refused.exit_code, "did you mean 'bundle_adjustment/bundle'" in refused.stderr) == (9, True)
    replaced(pipeline, "bundle_adjustment/bundl", "bundle_adjustment/bundle")
    assert CliRunner().invoke(app, ["new", "--plugin", "interior_orientation/mine"]).exit_code == 0
    replaced(pipeline, "calibrated, from: {block}", "mine, from: {block}, with: {example: 2.0}")
    code = stage.read_text(encoding="utf-8").replace("\n\n\nclass", f"{OWN_ERROR}\n\nclass", 1)
    code = code.replace("\n\n\n@stage", f"\n{VALIDATOR}\n@stage", 1)
    imports = "from pydantic import field_validator\nfrom aatri.errors import GeometryError\nfrom aatri.plugin"
    stage.write_text(code.replace("from aatri.plugin", imports, 1), encoding="utf-8")
    assert check(project, "--local-plugins").exit_code == 0
    replaced(pipeline, "example: 2.0", "example: 3.0")
    odd = check(project, "--local-plugins")
    assert odd.exit_code == 5, odd.output
    assert "3.0 mm is odd\n    fix: give an even one" in odd.stderr
    assert "67 points" in odd.stdout
    stage.write_text("import no_such_package\n" + stage.read_text(encoding="utf-8"), encoding="utf-8")
    failing = check(project, "--local-plugins")
    assert failing.exit_code == 9, failing.output
    assert "cannot be imported: ModuleNotFoundError: No module named 'no_such_package'" in failing.stderr


@pytest.mark.slow
def test_what_is_wrong_in_pipeline_and_tables_is_told_together(project: Path) -> None:
    replaced(project / "pipeline.yaml", "bundle_adjustment/bundle", "bundle_adjustment/bundl")
    replaced(project / "quarry" / "image_points.csv", "0101,101,", "0199,101,")
    result = check(project)
    assert result.exit_code == 9
    assert "did you mean 'bundle_adjustment/bundle'" in result.stderr
    assert "image_points.csv:2" in result.stderr
    assert "image '0199' is unknown" in result.stderr
    assert "a run would be refused" in result.stdout


def test_a_file_that_is_not_there_is_told_at_its_line_before_anything_is_made(project: Path) -> None:
    replaced(project / "pipeline.yaml", "path: quarry", "path: quary")
    for verb in ("check", "run"):
        result = CliRunner().invoke(app, [verb, str(project / "pipeline.yaml")])
        assert result.exit_code == 3
        assert f"{project}/pipeline.yaml:5:46: path is '{project}/quary', which does not exist" in result.stderr
        assert "did you mean 'quarry'?" in result.stderr
    assert not list((project / "run").glob("failed/*"))


@pytest.mark.slow
def test_a_bundle_without_start_values_is_told_before_it_runs(project: Path) -> None:
    """Without them the run orients the images that show control, one of fifteen here."""
    (project / "quarry" / "exterior.csv").unlink()
    assert "no start values" not in check(project).stdout
    replaced(project / "pipeline.yaml", ", initial: start", "")
    result = check(project)
    assert result.exit_code == 0
    assert "warning: bundle: no start values: block has neither orientations nor positions" in result.stdout


@pytest.mark.slow
@pytest.mark.parametrize("use", ["", "approximate", "observed"])
def test_a_sigma_of_positions_that_are_start_values_for_want_of_a_word_is_told(project: Path, use: str) -> None:
    path = project / "quarry" / "exterior.csv"
    path.write_text(path.read_text(encoding="utf-8").replace("approximate", use), encoding="utf-8")
    result = check(project)
    assert result.exit_code == 0, result.output
    told = "block.yaml:11:13: sigma.position has no effect: exterior.csv does not say that its positions are observed"
    assert (told in result.stdout) == (not use)


@pytest.mark.slow
@pytest.mark.parametrize(("positions", "exit_code"), [(False, 4), (True, 0)])
def test_two_control_points_and_nothing_else_do_not_say_how_a_block_lies(
    project: Path, positions: bool, exit_code: int
) -> None:
    table = project / "quarry" / "ground_points.csv"
    lines = table.read_text(encoding="utf-8").splitlines()
    control = [line for line in lines if line.endswith(",control")]
    text = "\n".join(line for line in lines if line not in control[2:])
    table.write_text(f"{text}\n", encoding="utf-8")
    if positions:
        path = project / "quarry" / "exterior.csv"
        path.write_text(path.read_text(encoding="utf-8").replace("approximate", "observed"), encoding="utf-8")
    result = check(project)
    assert result.exit_code == exit_code, result.output
    told = "stage bundle: the block has neither three control points nor anything else that says how it lies, "
    told += "without which the stage cannot work: it has 2 control points (ground_points.csv: X, Y, Z)\n"
    assert (told in result.stderr) == (exit_code == 4)
    if exit_code:
        run = CliRunner().invoke(app, ["run", "-q", str(project / "pipeline.yaml")])
        assert (run.exit_code, told in run.stderr) == (exit_code, True)
        assert not list(project.glob("run/objects/start/*"))
        assert check(project, "--set", "bundle.datum=free").exit_code == 0


@pytest.mark.slow
def test_a_finished_run_on_a_disk_that_may_only_be_read_has_nothing_to_write(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, run, open_kept = project / "pipeline.yaml", project / "done", inside.open_kept
    path.write_text("run: done\nstages:\n  block: {use: block/tables, with: {path: quarry}}\n", encoding="utf-8")
    assert CliRunner().invoke(app, ["run", "-q", str(path)]).exit_code == 0

    def read_only(folder: Path, *names: str, flags: int = 0) -> int:
        if folder.absolute() == run:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(run))
        return open_kept(folder, *names, flags=flags)

    monkeypatch.setattr(inside, "open_kept", read_only)
    monkeypatch.setattr(os, "access", lambda _, mode, **__: mode != os.W_OK)
    result = check(project)
    assert result.exit_code == 0, result.stderr
    assert "nothing to write: all stages are up to date" in result.stdout
    assert check(project, "--set", "block.max_reject_share=0.5").exit_code == 8


@pytest.mark.slow
def test_warnings_of_the_block_are_told(project: Path) -> None:
    replaced(project / "pipeline.yaml", "seed: 1", "seed: 1\nignore: [geodetic]")
    result = check(project)
    assert result.exit_code == 0
    assert "warning: block: pipeline.yaml, ignore: geodetic: there is nothing of that name" in result.stdout


@pytest.mark.slow
def test_options_of_variants_and_a_folder_that_may_not_be_written(project: Path) -> None:
    path = project / "pipeline.yaml"
    path.write_text(path.read_text(encoding="utf-8") + "variants:\n  odd: {bundle: {with: {datums: free}}}\n")
    told = json.loads(check(project, "--json").stdout)
    assert told["ok"] is False
    (wrong,) = [one for one in told["checks"] if one["errors"]]
    assert wrong["check"] == "variants"
    assert "unknown option 'datums'" in wrong["errors"][0]["what"]
