"""What a stranger's project may try at the command line, and remedies that must be true."""

from __future__ import annotations

import json
import os
import resource
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from aatri.cli.main import app
from aatri.errors import PluginError, ResourceError
from aatri.pipeline.methods import registry
from aatri.pipeline.methods.registry import find_stages
from tests.formats.tables.block_folder import write_folder
from tests.made_up_stages import made_up_registry, write_pipeline

LINES = "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: a}}\n"
SPY = "from pathlib import Path\nPath('executed').touch()\nnames = ['s']\ndef basis(x, y): return None\n"
BUNDLE = """\
  block:    {use: block/simulate, with: {preset: rc30}}
  interior: {use: interior_orientation/affine, from: {block}}
  bundle:   {use: bundle_adjustment/bundle, from: {block, image_points: interior},
             with: {self_calibration: {set: user, user: mine.py}}}
"""


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def made_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aatri.pipeline.methods.registry.find_stages", made_up_registry)


def aatri(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def refused(result: Result, code: int, *words: str) -> None:
    assert result.exit_code == code, result.output
    assert "internal error" not in result.stderr
    for word in words:
        assert word in result.stderr


# -- code that a project names --


@pytest.mark.slow
def test_python_named_by_an_option_runs_only_with_local_plugins(tmp_path: Path) -> None:
    write_pipeline(tmp_path, BUNDLE)
    (tmp_path / "mine.py").write_text(SPY)
    for verb in (["run"], ["status"], ["dag"], ["run", "-n"], ["exec", "pipeline.yaml", "bundle"]):
        refused(aatri(*verb), 2, "pipeline.yaml:7:", "self_calibration.user", "only with --local-plugins")
    assert not (tmp_path / "executed").exists()
    assert aatri("status", "--local-plugins").exit_code == 0
    refused(aatri("status"), 2, "--local-plugins")  # also after it was permitted once: nothing is taken from a cache
    assert not (tmp_path / "executed").exists()


@pytest.mark.slow
def test_the_stage_executes_it_where_it_is_permitted(tmp_path: Path) -> None:
    block = "{preset: rc30, flight: {strips: 2, images_per_strip: 5}}"
    lines = BUNDLE.replace("{preset: rc30}", block).replace("self_cal", "datum: minimal, self_cal")
    write_pipeline(tmp_path, lines)
    (tmp_path / "mine.py").write_text(SPY)
    aatri("run", "-q", "--local-plugins")
    assert (tmp_path / "executed").exists()


@pytest.mark.slow
def test_a_run_folder_cannot_permit_its_own_code(tmp_path: Path, made_up: None) -> None:
    write_pipeline(tmp_path, LINES)
    (tmp_path / "stages").mkdir()
    assert aatri("run").exit_code == 0
    overview = json.loads(Path("out/run.json").read_bytes())
    overview["request"]["local_plugins"] = True
    Path("out/run.json").write_text(json.dumps(overview))
    for verb in ("status", "dag", "run"):
        refused(aatri(verb, "out"), 2, "was run with --local-plugins")
    assert aatri("metrics", "out").exit_code == 0


# -- names and texts --


@pytest.mark.parametrize("run", ['"a\\0b"', "x" * 300, "'" + "/".join(["y" * 200] * 30) + "'"])
def test_a_run_folder_with_an_impossible_name_is_refused(tmp_path: Path, run: str) -> None:
    (tmp_path / "pipeline.yaml").write_text(f"run: {run}\nstages:\n{LINES}")
    refused(aatri("run"), 2, "pipeline.yaml:1:6")


@pytest.mark.parametrize("path", ['"a\\0b"', "x" * 300])
def test_an_input_with_an_impossible_name_is_refused(tmp_path: Path, path: str) -> None:
    write_pipeline(tmp_path, f"  block: {{use: block/tables, with: {{path: {path}}}}}\n")
    refused(aatri("run"), 2, "pipeline.yaml:4:", "option path")


@pytest.mark.parametrize("verb", ["run", "status", "show", "metrics", "report", "gc", "compare", "dag"])
def test_an_impossible_name_on_the_command_line_is_refused(verb: str) -> None:
    for name in ("x" * 300, "x" * 300 + ".h5"):
        result = aatri(verb, name)
        assert result.exit_code in (2, 7)
        assert "internal error" not in result.stderr
    assert "internal error" not in aatri("run", "--into", "y" * 300).stderr


def test_a_pipe_in_the_place_of_a_pipeline_or_block_does_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.yaml")
    refused(aatri("run", "pipe.yaml"), 2, "a pipe, not a file")


def test_a_newline_in_the_name_of_a_pipeline_starts_no_line_of_the_slurm_script(tmp_path: Path, made_up: None) -> None:
    folder = tmp_path / "a\ntouch executed\n#"
    folder.mkdir()
    write_pipeline(folder, LINES)
    assert aatri("export", str(folder / "pipeline.yaml"), "slurm", "jobs.sh").exit_code == 0
    (tmp_path / "sbatch").write_text("#!/bin/sh\necho 1\n")
    (tmp_path / "sbatch").chmod(0o755)
    subprocess.run(["bash", "jobs.sh"], check=True, env={"PATH": f"{tmp_path}:/usr/bin:/bin"}, capture_output=True)
    assert not (tmp_path / "executed").exists()


def test_what_drives_a_terminal_is_escaped_in_json_and_keeps_its_value(capsys: pytest.CaptureFixture[str]) -> None:
    from aatri.cli.terminal.console import say_json

    value = {"a\u009b31m": "\u009b2J\u202e\U000e0001\x7f \u70b9\n"}
    say_json(value)
    told = capsys.readouterr().out
    assert all(sign.isprintable() or sign == "\n" for sign in told)
    assert "\u70b9" in told
    assert json.loads(told) == value


def test_an_export_does_not_write_through_links(tmp_path: Path) -> None:
    write_folder(tmp_path / "block")
    write_pipeline(tmp_path, "  block: {use: block/tables, with: {path: block}}\n")
    assert aatri("run", "-q").exit_code == 0
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "images.csv").symlink_to(tmp_path / "mine")
    refused(aatri("export", "out:block", "tables", "there", "--overwrite"), 2, "written through")
    (tmp_path / "jobs.sh").symlink_to(tmp_path / "mine")
    refused(aatri("export", "pipeline.yaml", "slurm", "jobs.sh", "--overwrite"), 2, "is there already")
    assert (tmp_path / "mine").read_text() == "mine"


# -- remedies --


@pytest.mark.slow
def test_the_report_says_the_command_that_makes_the_run_again(tmp_path: Path, made_up: None) -> None:
    write_pipeline(tmp_path, LINES + "variants:\n  far: {s: {with: {offset: 9.0}}}\n")
    assert aatri("run", "--set", "a.count=4", "--use", "s=sum/add", "--into", "other place").exit_code == 0
    import html

    text = html.unescape(Path("other place/report.html").read_text())
    command = text.split("To make it again: <code>")[1].split("</code>")[0]
    words = shlex.split(command)
    assert words[:2] == ["aatri", "run"]
    digests = [
        json.loads(p.read_bytes())["output"]["content_digest"] for p in Path("other place/current").glob("*.json")
    ]
    assert "nothing to do" in aatri(*words[1:]).stderr
    Path("other place").rename("first")
    assert aatri(*words[1:]).exit_code == 0
    again = [json.loads(p.read_bytes())["output"]["content_digest"] for p in Path("other place/current").glob("*.json")]
    assert sorted(again) == sorted(digests)


@pytest.mark.slow
def test_a_run_folder_and_a_project_folder_serve_as_the_pipeline(tmp_path: Path, made_up: None) -> None:
    write_pipeline(tmp_path, LINES)
    assert aatri("run", ".", "--set", "a.count=4").exit_code == 0
    assert "nothing to do" in aatri("run", "out").stderr
    assert "count" in aatri("run", "out", "-n", "--set", "a.count=5").stdout
    refused(aatri("run", "out", "--into", "x"), 2, "--into")
    for verb in ("status", "metrics", "dag", "report"):
        assert aatri(verb, ".").exit_code == 0
    refused(aatri("export", ".", "tables", "d"), 7, "no stage with a Solution")
    refused(aatri("compare", "."), 2, "one run only")
    assert aatri("compare", ".", "out").exit_code == 0
    os.chdir("out")
    refused(aatri("export", ".", "tables", "../d"), 7, "no stage with a Solution")
    assert aatri("status", ".").exit_code == 0


def test_a_port_is_not_offered_its_own_stage(tmp_path: Path, made_up: None) -> None:
    write_pipeline(tmp_path, "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: s}}\n")
    assert "STAGE is s" not in aatri("run").stderr
    write_pipeline(tmp_path, "  a: {use: source/fixed}\n  s: {use: sum/add}\n")
    refused(aatri("run"), 2, "STAGE}`, where STAGE is a\n")


def test_a_missing_table_is_not_taken_for_another_table(tmp_path: Path) -> None:
    write_folder(tmp_path / "block", {"images.csv": None})
    write_pipeline(tmp_path, "  block: {use: block/tables, with: {path: block}}\n")
    result = aatri("run", "-q")
    refused(result, 3, "images.csv: does not exist")
    assert "did you mean" not in result.stderr


# -- memory --


def test_too_little_memory_is_no_fault_of_a_plugin(monkeypatch: pytest.MonkeyPatch) -> None:
    for error in (
        MemoryError(),
        ImportError("x.so: failed to map segment from shared object"),
        OSError(12, "Cannot allocate memory"),
    ):

        def fails(_: str, error: Exception = error) -> None:
            raise error

        monkeypatch.setattr(registry.importlib, "import_module", fails)
        with pytest.raises(ResourceError, match="memory"):
            registry._imported(found())
    monkeypatch.undo()


def found() -> registry.Origin:
    return registry.Origin("built-in", "aatri.stages.block.tables", "tables")


@pytest.mark.slow(after=1)
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="limits of address space")
@pytest.mark.parametrize("megabytes", [150, 300, 450])
def test_a_limit_of_memory_ends_with_its_exit_code_and_does_not_hang(tmp_path: Path, megabytes: int) -> None:
    write_pipeline(tmp_path, "  block: {use: block/simulate, with: {preset: rc30}}\n")

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (megabytes << 20, megabytes << 20))

    done = subprocess.run(
        [sys.executable, "-c", "from aatri.cli.main import main; main()", "run", "-q"],
        capture_output=True,
        text=True,
        preexec_fn=limit,
        timeout=120,
        check=False,
    )
    assert done.returncode in (0, 8), done.stderr[-2000:]
    assert "a bug" not in done.stderr


def test_a_broken_plugin_is_still_told_as_one(tmp_path: Path) -> None:
    (tmp_path / "stages" / "block").mkdir(parents=True)
    (tmp_path / "stages" / "block" / "mine.py").write_text("import nothing_of_this_name\n")
    with pytest.raises(PluginError, match="cannot be imported: ModuleNotFoundError"):
        find_stages(tmp_path / "stages").card("block/mine")
