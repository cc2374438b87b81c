"""Long work shows itself: bars, counts, times, iterations, compilation; colours and pipes as the user wants them."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from aatri.cli.run_ending import judgement, say_end
from aatri.cli.terminal.compiling import wait_for
from aatri.cli.terminal.console import NARRATED
from aatri.cli.terminal.live import Live
from aatri.cli.terminal.narrator import Narrator
from aatri.notes import CONTRADICTION
from aatri.progress import SILENT, tell_iteration
from aatri.units import METRES_OF_MODEL


def _live(width: int = 100) -> tuple[Live, io.StringIO]:
    screen = io.StringIO()
    return Live(Console(file=screen, force_terminal=True, width=width)), screen


def test_bars_tell_count_elapsed_expected_and_what_is_left_overall() -> None:
    live, screen = _live()
    with live:
        live.planned(1, ["models", "bundle"], {"models": 12.0, "bundle": 30.0})
        live.started("models", "[2/3] models", 12.0)
        live.advanced("models", 211, 244, "models")
        live.tick()
        live._progress.refresh()
    shown = screen.getvalue()
    assert "1/3 stages" in shown
    assert "about 42 s left" in shown
    assert "[2/3] models" in shown
    assert "0 s of about 12 s  211/244 models" in shown


def test_nothing_is_said_of_the_time_left_where_a_stage_never_ran_before() -> None:
    live, screen = _live()
    with live:
        live.planned(0, ["models", "bundle"], {"models": 12.0})
        live._progress.refresh()
    assert "left" not in screen.getvalue()


def test_an_ended_stage_has_no_bar_and_counts_in_that_of_the_run() -> None:
    live, screen = _live()
    with live:
        live.planned(0, ["a", "b"], {})
        live.started("a", "[1/2] a", 0.0)
        live.ended("a")
        screen.truncate(0)
        live._progress.refresh()
    assert "1/2 stages" in screen.getvalue()
    assert "[1/2] a" not in screen.getvalue()


@pytest.mark.parametrize(("variables", "coloured"), [({}, True), ({"NO_COLOR": "1"}, False)])
def test_no_color_is_respected(monkeypatch: pytest.MonkeyPatch, variables: dict[str, str], coloured: bool) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    live, screen = _live()
    live.line("warning: models: weak", "yellow")
    assert ("\x1b[33m" in screen.getvalue()) is coloured
    assert "warning: models: weak" in screen.getvalue()


def test_bars_keep_to_the_width() -> None:
    live, screen = _live(width=50)
    with live:
        live.planned(0, ["a"], {})
        live.started("a", "[1/1] a_stage_with_quite_a_long_name", 0.0)
        live.advanced("a", 1, 0, "iteration 1: sigma0 57.97, steps up to 182 sigma, damping 0")
        live._progress.refresh()
    plain = [line for part in screen.getvalue().split("\x1b") for line in part.partition("m")[2].splitlines()]
    assert max(len(line) for line in plain) <= 50


def test_into_a_pipe_go_plain_lines(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aatri.cli.terminal.narrator._HEARTBEAT_S", 0.02)
    monkeypatch.setattr("aatri.cli.terminal.narrator._LOOK_S", 0.01)
    with Narrator(quiet=False) as narrator:
        plan: Any = SimpleNamespace(decisions=[SimpleNamespace(record=None, stage="bundle")], stale=[])
        narrator.planned(plan, {"bundle": 30.0})
        narrator.started("bundle", "bundle_adjustment/bundle", 1, 1)
        narrator.advanced("bundle", 3, 0, "iteration 3: sigma0 1.01, steps up to 2e-06 sigma, damping 0")
        narrator._ended.wait(0.2)
        narrator.finished({"stage": "bundle", "seconds": 1.5, "metrics": {"sigma0": 1.01}})
    told = capsys.readouterr().err
    assert "[1/1] bundle: bundle_adjustment/bundle  0 s of about 30 s  iteration 3: sigma0 1.01" in told
    assert "[1/1] bundle  1.50 s  sigma0 1.01" in told
    assert "\x1b" not in told


def test_iterations_are_told_with_sigma0_step_and_damping() -> None:
    told: list[Any] = []
    reporter = SimpleNamespace(log=told.append, progress=lambda *about: told.append(about), warn=told.append)
    tell_iteration(reporter, 2, 400.0, 100, 0.037, 1e-3)
    line = "iteration 2: sigma0 2, steps up to 0.037 sigma, damping 0.001"
    assert told == [f"{line}, cost 400.000000", (2, 0, line)]
    tell_iteration(SILENT, 1, 1.0, 0, 1.0, 0.0)  # without redundancy there is no sigma0, and no error


class _Compiling:
    """A compilation of three modules, of which one more is ready each time that somebody asks how far it is."""

    def __init__(self) -> None:
        self.ready = 0

    def wait(self, timeout_s: float) -> bool:
        return self.ready == 3

    def progress(self) -> str:
        self.ready += 1
        return f"compiling, once: {self.ready} of 3 modules ready"


def test_compilation_is_told_beside_the_stages_that_wait_for_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aatri.cli.terminal.narrator._LOOK_S", 0.01)
    monkeypatch.setattr("aatri.cli.terminal.narrator._HEARTBEAT_S", 0.02)
    compiling: Any = _Compiling()
    with Narrator(quiet=False, compilation=compiling) as narrator:
        narrator.started("bundle", "bundle_adjustment/bundle", 1, 1)
        narrator._ended.wait(0.2)
        narrator.finished({"stage": "bundle", "seconds": 7.9, "metrics": {}})
    told = capsys.readouterr().err
    assert "[1/1] bundle: bundle_adjustment/bundle  0 s  compiling, once: 1 of 3 modules ready\n" in told
    assert "[1/1] bundle  7.90 s" in told


@pytest.mark.parametrize("terminal", [False, True])
def test_compilation_is_told_while_a_pipeline_is_planned(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, terminal: bool
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    told: list[str] = []
    compiling: Any = _Compiling()
    wait_for(compiling, told.append, terminal=terminal)
    assert "of 3 modules ready" in (capsys.readouterr().err if terminal else told[1])


@pytest.mark.slow
def test_where_the_narration_has_no_place_to_go_the_work_goes_on(tmp_path: Path) -> None:
    """Closed, opened for reading only, or on a disk that is full."""
    said = "from aatri.cli.main import main; main()"
    whole = f"{sys.executable} -c '{said}' run {tmp_path / 'nothing.yaml'}"
    for where in ("2>&-", "2</dev/null", "2>/dev/full", "<&- >&- 2>&-"):
        assert subprocess.run(["sh", "-c", f"{whole} {where}"], check=False).returncode == 2, where


def test_standard_files_that_are_closed_leave_their_numbers_to_nothing_else() -> None:
    program = "from aatri.cli.main import _open_standard_files as o; import sys; o(); open(sys.argv[1]); print(2)"
    done = subprocess.run(
        ["sh", "-c", f"{sys.executable} -c '{program}; import os; os.write(2, b\"lost\")' {__file__} 2>&-"],
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, "2\n")


@pytest.mark.slow
def test_a_reader_that_has_seen_enough_is_no_internal_error() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-c", "from aatri.cli.main import main; main()", "stages"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.slow
def test_where_nobody_reads_the_narration_the_work_goes_on(tmp_path: Path) -> None:
    """`aatri run 2>&1 | head -1`: what is told later has no reader, which is no failure of a stage, nor of the verb."""
    reader, writer = os.pipe()
    os.close(reader)
    program = "from aatri.cli.terminal.console import narrate; narrate('one'); narrate('two'); print('done')"
    done = subprocess.run(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=writer, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "done\n")
    program = "from aatri.cli.main import main; main()"
    command = [sys.executable, "-c", program, "run", str(tmp_path / "nothing.yaml")]
    assert subprocess.run(command, stderr=writer, check=False).returncode == 2
    os.close(writer)


def test_the_judgement_has_plain_blanks(tmp_path: Path) -> None:
    """A terminal shows thin ones as their codes."""
    (tmp_path / "report.json").write_text('{"judgement": "35 of 14\\u202f267 image points are left out."}')
    assert judgement(tmp_path / "report.json") == "35 of 14 267 image points are left out."


def test_the_end_names_once_what_bears_on_the_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither warnings of stages on the way, nor what the judgement or the error of a gate says."""
    record = {"stage": "start", "plugin": "x", "seconds": 1.0, "metrics": {}, "inputs": {}, "warnings": ["on the way"]}
    problems = [
        {"text": f"{CONTRADICTION}: x", "stage": "bundle"},
        {"text": "GCP27 is left out.", "stage": "bundle"},
        {"text": "sigma0: too large", "stage": ""},
        {"text": "Two fit exchanged", "stage": "bundle"},
    ]
    page = {"judgement": "Good but one. GCP27 is left out.", "problems": problems}
    (tmp_path / "report.json").write_text(json.dumps(page))
    for passed, told in ((True, [f"{CONTRADICTION}: x", "Two fit exchanged"]), (False, ["Two fit exchanged"])):
        say_end(tmp_path, [record], tmp_path / "report.html", [SimpleNamespace(passed=passed)])
        lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("warning")]
        assert lines == [f"warning: bundle: {text}" for text in told]
    say_end(tmp_path, [record], tmp_path / "report.html", [], [("bundle", "two fit exchanged"), ("start", "far")])
    out = capsys.readouterr().out
    assert "Two fit exchanged" not in out
    assert "2 warnings above" in out


def test_a_list_of_which_the_judgement_names_the_worst_is_not_told_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The judgement names three of four rejected control points, the list of problems ten."""
    head, names = "4 control points are left out: ", ["p00, 4 m", "p03, 3 m", "p40, 2 m", "p43, 1 m"]
    problems = [{"text": f"{head}{'; '.join(names)}.", "stage": "bundle"}, {"text": "p1: far", "stage": "bundle"}]
    page = {"judgement": f"{head}{'; '.join(names[:3])}; and 1 more.", "problems": problems}
    (tmp_path / "report.json").write_text(json.dumps(page))
    say_end(tmp_path, [], tmp_path / "report.html", [])
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("warning")]
    assert lines == ["warning: bundle: p1: far"]


@pytest.mark.parametrize(("plugin", "text"), [("block/photos", "water"), ("block/photos", "`mask` of images.csv"),
                                              ("block/tables", "`mask` of images.csv")])  # fmt: skip
def test_tables_that_a_warning_names_are_to_be_had_of_any_block(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], plugin: str, text: str
) -> None:
    record = {"stage": "photos", "plugin": plugin, "seconds": 1.0, "metrics": {}, "inputs": {}}
    page = {"judgement": "", "problems": [{"text": text, "stage": "bundle"}]}
    (tmp_path / "report.json").write_text(json.dumps(page))
    say_end(Path("runs/b"), [record], tmp_path / "report.html", [])
    told = "aatri export runs/b:photos tables FOLDER" in capsys.readouterr().out
    assert told == (plugin == "block/photos" and "images.csv" in text)


def test_lengths_of_a_block_without_a_scale_are_units_of_the_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lengths = {f"theory_rmse_{axis}_m": size for axis, size in zip("xyz", (0.000764, 0.5, 20.0))}
    record = {"stage": "accuracy", "plugin": "x", "seconds": 1.0, "metrics": lengths, "inputs": {}}
    (tmp_path / "report.json").write_text(json.dumps({"judgement": "", "facts": {METRES_OF_MODEL: "no scale"}}))
    say_end(tmp_path, [record], tmp_path / "report.html", [])
    out = capsys.readouterr().out
    line = next(line for line in out.splitlines() if line.startswith("RMS"))
    assert line.split()[-7:] == ["units", "of", "the", "model", "0.000764", "0.5", "20"]
    assert out.endswith("m and mm in warnings are no scale.\n")


def test_reading_that_takes_long_tells_how_far_it_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("aatri.cli.terminal.console.PROGRESS_S", 1e9)
    NARRATED.progress(1, 3, "photographs")
    monkeypatch.setattr("aatri.cli.terminal.console.PROGRESS_S", -1.0)
    NARRATED.progress(2, 3, "photographs")
    NARRATED.progress(5, 10)
    NARRATED.progress(0, 0, "pairs")
    assert capsys.readouterr().err == "photographs 2 of 3\n5 of 10\npairs\n"
