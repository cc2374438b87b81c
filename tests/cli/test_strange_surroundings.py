"""Disks that may only be read, folders of strangers, files of others, little memory: a message, and nothing is lost."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from aatri.cli.main import app
from aatri.errors import ArtifactError, lacks_memory
from aatri.formats.text.text_file import read_bytes
from aatri.pipeline.store import inside
from aatri.pipeline.store.cache import MOST_FILES, Cache, cache_folder
from aatri.report.page import write_report
from tests.made_up_stages import made_up_registry, write_pipeline

LINES = "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: a}}\n"


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("aatri.pipeline.methods.registry.find_stages", made_up_registry)


def aatri(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture
def done(tmp_path: Path) -> Path:
    path = write_pipeline(tmp_path, LINES)
    assert aatri("run").exit_code == 0
    return path


@pytest.mark.parametrize("number", [errno.EROFS, errno.EACCES])
def test_a_finished_run_on_a_disk_that_may_only_be_read_has_nothing_to_do(
    done: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def read_only(*_: object, **__: object) -> int:
        raise OSError(number, os.strerror(number), "out/.lock")

    for name in ("open_kept", "make_folder", "write", "create", "move"):
        monkeypatch.setattr(inside, name, read_only)
    result = aatri("run")
    assert result.exit_code == 0, result.stderr
    assert "nothing to do" in result.stderr
    assert aatri("run", "--force", "s").exit_code == 8


def test_status_of_a_strangers_run_opens_no_file_that_it_names(tmp_path: Path, done: Path) -> None:
    secret = tmp_path / "elsewhere" / "secret.yaml"
    secret.parent.mkdir()
    secret.write_text("password: hunter2\n")
    run = next(p.parent for p in tmp_path.rglob("run.json"))
    overview = json.loads((run / "run.json").read_text())
    for named in (str(secret), "/etc/passwd", str(done.with_name("notes.txt"))):
        done.with_name("notes.txt").write_text("password: hunter2\n")
        overview["request"]["pipeline"] = named
        (run / "run.json").write_text(json.dumps(overview))
        for verb in (("status", str(run)), ("run", str(run))):
            result = aatri(*verb)
            assert result.exit_code == 7, result.output
            assert "hunter2" not in result.output + result.stderr
            assert "not opened" in result.stderr


def test_status_of_an_own_run_in_another_place_works(tmp_path: Path, done: Path) -> None:
    other = tmp_path / "there" / "run"
    other.parent.mkdir()
    assert aatri("run", str(done), "--into", str(other)).exit_code == 0
    assert aatri("status", str(other)).exit_code == 0


def test_a_report_of_others_is_not_overwritten(tmp_path: Path, done: Path) -> None:
    run = next(p.parent for p in tmp_path.rglob("run.json"))
    write_report(run)
    (run / "report.html").write_text("<title>my own</title>")
    with pytest.raises(ArtifactError, match="not overwritten"):
        write_report(run)
    result = aatri("run", "--force", "s")
    assert result.exit_code == 0
    assert "not overwritten" in result.stderr
    assert (run / "report.html").read_text() == "<title>my own</title>"


def test_gc_leaves_what_no_record_names(tmp_path: Path, done: Path) -> None:
    run = next(p.parent for p in tmp_path.rglob("run.json"))
    mine = [run / "objects" / "s" / "notes", run / "objects" / "s" / "0123456789ab", run / "objects" / "letters" / "a"]
    for folder in mine:
        folder.mkdir(parents=True)
        (folder / "diary.txt").write_text("dear diary")
    half = run / "objects" / "s" / "ba9876543210"
    half.mkdir()
    (half / "artifact.h5").write_bytes(b"half")
    assert aatri("gc", "--keep", "0").exit_code == 0
    assert all((folder / "diary.txt").read_text() == "dear diary" for folder in mine)
    assert not half.exists()


def test_the_cache_is_bounded_in_number_and_age() -> None:
    folder = cache_folder()
    folder.mkdir(parents=True)
    for k in range(MOST_FILES + 30):
        (folder / f"files-{k:016x}.json").write_text("{}")
    old = folder / "code-0.json"
    old.write_text("{}")
    os.utime(old, (time.time() - 1e7, time.time() - 1e7))
    cache = Cache(folder / "new.json")
    cache.put("a", 1)
    cache.save()
    assert len(list(folder.glob("*.json"))) <= MOST_FILES + 1
    assert not old.exists()
    assert (folder / "new.json").exists()


def test_a_disk_that_fails_while_it_is_read_is_no_fault_of_the_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def failing(path: Path) -> bytes:
        raise OSError(errno.EIO, "Input/output error", str(path))

    monkeypatch.setattr("aatri.formats.text.text_file.read_regular", failing)
    with pytest.raises(OSError, match="cannot be read") as caught:
        read_bytes(tmp_path / "images.csv")
    assert caught.value.exit_code == 8  # type: ignore[attr-defined]


def test_no_thread_is_no_memory() -> None:
    assert lacks_memory(RuntimeError("can't start new thread"))
    assert not lacks_memory(RuntimeError("another"))


@pytest.mark.slow(after=1)
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="address space is limited on Linux")
@pytest.mark.parametrize("verb", ["run", "check"])
@pytest.mark.parametrize("mebibytes", [450, 520, 600])
def test_little_memory_ends_with_a_message(tmp_path: Path, mebibytes: int, verb: str) -> None:
    pipeline = tmp_path / "p" / "pipeline.yaml"
    pipeline.parent.mkdir()
    pipeline.write_text("run: out\nseed: 1\nstages:\n  block: {use: block/simulate, with: {preset: sample}}\n")
    program = "from aatri.cli.main import main; main()"
    command = f"ulimit -v {1024 * mebibytes}; exec {sys.executable} -c '{program}' {verb} {pipeline}"
    ended = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=120, check=False)
    assert ended.returncode == 8, ended.stderr
    assert "memory" in ended.stderr
