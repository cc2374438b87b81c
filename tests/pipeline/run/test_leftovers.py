"""What a run that was broken off leaves behind, and a stage in memory."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from aatri.pipeline.run import worker, workers
from aatri.pipeline.run.context import FileCheckpoint
from aatri.pipeline.run.task import Task
from aatri.pipeline.store.events import Events
from tests.made_up_stages import write_pipeline
from tests.pipeline.made_runs import read_events, run

LINES = "  a: {use: source/fixed, with: {file: data.txt}}\n  s: {use: sum/add, from: {numbers: a}}\n"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "data.txt").write_text("1 2 3\n")
    return write_pipeline(tmp_path, LINES)


def test_events_survive_a_line_that_was_not_finished(tmp_path: Path) -> None:
    for k in range(2):
        events = Events(tmp_path)
        events.add("told", number=k)
        events.close()
        with (tmp_path / "events.jsonl").open("a") as file:
            file.write('{"event": "cut o')
    assert [event["number"] for event in read_events(tmp_path)] == [0, 1]


def test_what_dead_processes_left_is_swept(path: Path) -> None:
    run(path)
    out = path.parent / "out"
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    dead, living = out / "current" / f".tmp-x-{child.pid}-ab.json", out / "current" / f".tmp-x-{os.getppid()}-ab.json"
    dead.touch()
    living.touch()
    run(path, sets=("s.offset=1",))
    assert (dead.exists(), living.exists()) == (False, True)


def test_a_checkpoint_is_whole_or_not_there(tmp_path: Path) -> None:
    class Log:
        lines: list[str]

        def log(self, message: str) -> None:
            self.lines.append(message)

    log = Log()
    log.lines = []
    kept = FileCheckpoint(log, tmp_path, "c")  # type: ignore[arg-type]
    assert kept.load("state") is None
    kept.save("state", {"x": np.arange(3.0), "n": np.int64(2)})
    found = kept.load("state")
    assert found is not None
    np.testing.assert_array_equal(found["x"], [0.0, 1.0, 2.0])
    assert int(found["n"]) == 2
    file = tmp_path / "c" / "state.npz"
    file.write_bytes(file.read_bytes()[:-1])
    assert kept.load("state") is None
    assert "damaged" in log.lines[-1]
    with pytest.raises(ValueError, match="name of a checkpoint"):
        kept.save("../x", {})


def _freed_bytes(input_bytes: int) -> int:
    """What goes back to the system of twenty arrays of 8 MiB, in a stage with inputs of a size; 30 MiB went before."""
    code = (
        "import pathlib, types, numpy as np; from aatri.pipeline.run import workers\n"
        "resident = lambda: 4096 * int(pathlib.Path('/proc/self/statm').read_text().split()[1])\n"
        f"record = {{'output': {{'size': {input_bytes}}}}}\n"
        "workers._prepare_memory(types.SimpleNamespace(inputs={'block': record})); np.ones(30 << 17)\n"
        "arrays, between = zip(*((np.ones(1 << 20), bytes(100_000)) for _ in range(20)))\n"
        "before = resident(); del arrays; print(before - resident())"
    )
    return int(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the C library of Linux keeps what is freed")
def test_arrays_of_a_stage_go_back_to_the_system_where_its_inputs_are_large_only() -> None:
    """Without a limit of its own the C library keeps all below the largest one that was freed, here 30 MB."""
    assert _freed_bytes(10**13) > 19 * 8 * 2**20
    assert _freed_bytes(1) < 10 * 2**20


def test_a_stage_in_a_process_of_its_own_begins_with_its_memory_prepared(monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[str] = []
    monkeypatch.setattr(workers, "_prepare_memory", lambda *_: order.append("memory"))
    monkeypatch.setattr(worker, "perform", lambda *_: order.append("stage"))
    workers._perform(cast("Task", None), 2)
    assert order == ["memory", "stage"]
