from __future__ import annotations

import errno
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.adjustment.openness.open_directions import OpenError
from aatri.errors import (
    AatriError,
    ArtifactError,
    ConvergenceError,
    Errors,
    GeometryError,
    InputError,
    PluginError,
    ResourceError,
    SpecError,
)
from aatri.pipeline.methods.catalogue import Catalogue
from aatri.pipeline.plan.decisions import Plan
from aatri.pipeline.plan.graph import wire
from aatri.pipeline.run.runner import RunSettings, run_pipeline
from aatri.pipeline.run.task import StageSource, failed
from aatri.pipeline.spec.overrides import with_set, with_use
from aatri.pipeline.spec.pipeline_file import load_spec
from aatri.pipeline.store import inside, objects
from aatri.pipeline.store import run_folder as store
from aatri.pipeline.store.cache import file_sha256
from aatri.tables import hdf5
from tests.made_up_stages import Numbers, Total, Values, made_up_registry, write_pipeline
from tests.pipeline.made_runs import bare_record, commit


class Quiet:
    def __init__(self) -> None:
        self.events: list[str] = []

    def planned(self, plan: Plan, expected: Mapping[str, float]) -> None:
        pass

    def started(self, stage: str, use: str, number: int, total: int) -> None:
        self.events.append(f"started {stage} {number}/{total}")

    def logged(self, stage: str, message: str) -> None:
        pass

    def warned(self, stage: str, message: str) -> None:
        self.events.append(f"warned {stage}")

    def advanced(self, stage: str, done: int, total: int, what: str) -> None:
        self.events.append(f"advanced {stage} {done}/{total}")

    def finished(self, record: Mapping[str, Any]) -> None:
        self.events.append(f"finished {record['stage']}")

    def failed(self, stage: str, folder: Path) -> None:
        self.events.append(f"failed {stage}")


HOW = RunSettings(source=StageSource("tests.made_up_stages:made_up_registry"))
LINES = "  a: {use: source/fixed}\n  r: {use: source/random}\n  s: {use: sum/add, from: {numbers: a, more: r}}\n"


def run(
    path: Path, *, sets: list[str] | None = None, uses: list[str] | None = None
) -> tuple[Path, list[dict[str, Any]], Quiet]:
    catalogue, listener = Catalogue(registry=made_up_registry()), Quiet()
    spec, _ = with_use(load_spec(path), uses or [], catalogue)
    spec = with_set(spec, sets or [])
    return spec.run, run_pipeline(spec, wire(spec, catalogue), listener, HOW), listener


def test_a_run_leaves_artifacts_records_logs_and_pointers(tmp_path: Path) -> None:
    folder, records, listener = run(write_pipeline(tmp_path, LINES), sets=["a.count=7"])
    assert [record["stage"] for record in records] == ["a", "r", "s"]
    assert listener.events[:4] == ["started a 1/3", "advanced a 1/2", "warned a", "finished a"]
    place = folder / "objects" / "a" / records[0]["key"]
    assert sorted(p.name for p in place.iterdir()) == ["artifact.h5", "record.json", "stage.log"]
    assert "count is 7" in (place / "stage.log").read_text()
    assert json.loads((place / "record.json").read_text()) == store.current_record(folder, "a")
    assert (folder / "current" / "a.h5").resolve() == (place / "artifact.h5").resolve()
    assert json.loads((folder / "run.json").read_text())["status"] == "done"
    record = records[2]
    assert record["metrics"] == {
        "total": pytest.approx(28 + store.load(folder, "r", Numbers).values.value.sum()),
        "sigma0": 1.5,
    }
    assert records[0]["metrics"]["sigma0"] is None  # NaN is not determined
    assert record["inputs"]["numbers"] == {
        "stage": "a",
        "key": records[0]["key"],
        "content_digest": records[0]["output"]["content_digest"],
    }
    assert record["output"]["sha256"] == file_sha256(folder / "current" / "s.h5")
    assert records[0]["seed"] is None
    assert records[1]["seed"] == 1
    assert list(folder.rglob(".tmp-*")) == []
    assert list((folder / "running").iterdir()) == []


@pytest.mark.slow
def test_two_runs_give_the_same_keys_and_digests_and_the_seed_counts_only_where_asked_for(tmp_path: Path) -> None:
    path = write_pipeline(tmp_path, LINES)
    _, first, _ = run(path)
    _, again, _ = run(path)
    path.write_text(path.read_text().replace("seed: 1", "seed: 2"))
    _, other, _ = run(path)
    assert [r["key"] for r in first] == [r["key"] for r in again]
    assert [r["output"] for r in first] == [r["output"] for r in again]
    assert [a["key"] == b["key"] for a, b in zip(first, other)] == [True, False, False]


def test_the_random_numbers_of_a_stage_depend_on_its_name_and_the_seed_only(tmp_path: Path) -> None:
    folder, _, _ = run(write_pipeline(tmp_path, LINES))
    import zlib

    expected = np.random.default_rng(np.random.SeedSequence(1, spawn_key=(zlib.crc32(b"r"),))).normal(size=3)
    np.testing.assert_array_equal(store.load(folder, "r", Numbers).values.value, expected)


def test_a_failed_stage_leaves_no_artifact_and_nothing_stale_is_current(tmp_path: Path) -> None:
    path = write_pipeline(tmp_path, LINES)
    folder, _, _ = run(path)
    listener = Quiet()
    catalogue = Catalogue(registry=made_up_registry())
    spec, _ = with_use(load_spec(path), ["s=sum/stubborn"], catalogue)
    with pytest.raises(ConvergenceError, match="no convergence"):
        run_pipeline(spec, wire(spec, catalogue), listener, HOW)
    assert listener.events[-1] == "failed s"
    assert store.current_record(folder, "a") is not None
    assert store.current_record(folder, "s") is None
    assert sorted(p.name for p in (folder / "current").iterdir()) == ["a.h5", "a.json", "r.h5", "r.json"]
    told = store.failure(folder, "s")
    assert told is not None
    assert (told["error"], told["exit_code"], told["where"]) == ("ConvergenceError", 5, "point 12")
    log = (folder / "failed" / "s" / "stage.log").read_text()
    assert "trying" in log
    assert "Traceback" not in log
    assert json.loads((folder / "run.json").read_text())["status"] == "failed"
    run(path)
    assert store.failure(folder, "s") is None


def test_a_bug_is_told_as_one_with_the_traceback_in_the_log(tmp_path: Path) -> None:
    path = write_pipeline(tmp_path, "  a: {use: source/fixed}\n  s: {use: sum/buggy, from: {numbers: a}}\n")
    with pytest.raises(AatriError, match=r"internal error in s \(a bug\): ZeroDivisionError: oh") as caught:
        run(path)
    assert caught.value.exit_code == 1
    log = tmp_path / "out" / "failed" / "s" / "stage.log"
    assert str(log) in caught.value.remedy
    assert "ZeroDivisionError" in log.read_text()


def test_a_stage_that_returns_another_kind_breaks_its_contract(tmp_path: Path) -> None:
    path = write_pipeline(tmp_path, "  a: {use: source/fixed}\n  s: {use: sum/liar, from: {numbers: a}}\n")
    with pytest.raises(PluginError, match="returned a Numbers, not a Total"):
        run(path)


def test_an_interrupt_leaves_no_artifact_and_is_recorded(tmp_path: Path) -> None:
    path = write_pipeline(tmp_path, "  a: {use: source/fixed}\n  s: {use: sum/interrupted, from: {numbers: a}}\n")
    with pytest.raises(KeyboardInterrupt):
        run(path)
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "interrupted"
    assert not (tmp_path / "out" / "objects" / "s").exists()


@pytest.mark.parametrize("step", ["write", "replace", "record"])
def test_a_full_disk_leaves_no_artifact(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str) -> None:
    full = OSError(errno.ENOSPC, "No space left on device")

    def fails(*_: object, **__: object) -> None:
        raise full

    if step == "write":
        monkeypatch.setattr(hdf5, "put", fails)
    elif step == "replace":
        monkeypatch.setattr(inside, "sync", lambda path: fails() if path.suffix == ".h5" else None)
    else:
        original = objects.write_json
        monkeypatch.setattr(
            objects, "write_json", lambda v, *at: fails() if at[-1] == "record.json" else original(v, *at)
        )
    with pytest.raises(ResourceError, match="No space left") as caught:
        run(write_pipeline(tmp_path, LINES))
    assert caught.value.exit_code == 8
    assert store.current_record(tmp_path / "out", "a") is None
    assert not list((tmp_path / "out").rglob("record.json"))
    assert not list((tmp_path / "out").rglob(".tmp-*"))
    assert store.failure(tmp_path / "out", "a") is not None


def test_an_altered_artifact_is_not_trusted(tmp_path: Path) -> None:
    folder, _, _ = run(write_pipeline(tmp_path, LINES))
    assert store.load(folder, "s", Total).kind == "Total"
    path = store.artifact_path(folder, "s")
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    with pytest.raises(ArtifactError, match="altered"):
        store.load(folder, "s", Total)
    path.unlink()
    with pytest.raises(ArtifactError, match="gone"):
        store.load(folder, "s", Total)
    with pytest.raises(ArtifactError, match="no result"):
        store.load(folder, "x", Total)


def test_where_links_are_impossible_a_copy_serves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EPERM, "no links")

    monkeypatch.setattr(Path, "symlink_to", refuse)
    monkeypatch.setattr("os.link", refuse)
    folder, records, _ = run(write_pipeline(tmp_path, LINES))
    assert not (folder / "current" / "s.h5").is_symlink()
    assert file_sha256(folder / "current" / "s.h5") == records[2]["output"]["sha256"]


def test_a_folder_that_is_not_of_a_run_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "out" / "current").mkdir(parents=True)
    (tmp_path / "out" / "current" / "precious.txt").write_text("mine")
    with pytest.raises(SpecError, match="not the folder of a run"):
        run(write_pipeline(tmp_path, LINES))
    assert (tmp_path / "out" / "current" / "precious.txt").exists()


def test_damaged_records_are_told_as_such(tmp_path: Path) -> None:
    folder, _, _ = run(write_pipeline(tmp_path, LINES))
    (folder / "current" / "s.json").write_text('{"a": ')
    with pytest.raises(ArtifactError, match="not readable"):
        store.current_record(folder, "s")


def test_writing_twice_under_one_key_keeps_the_record_last(tmp_path: Path) -> None:
    store.begin(tmp_path / "out", {})
    artifact = Numbers(values=Values(value=np.ones(2)))
    for _ in range(2):
        record = commit(tmp_path / "out", "a", "k", artifact, bare_record())
    assert store.load(tmp_path / "out", "a", Numbers).values.value.tolist() == [1.0, 1.0]
    assert record["output"]["size"] == store.artifact_path(tmp_path / "out", "a").stat().st_size


# -- what a failed task hands back --


def test_a_narrower_error_of_a_room_comes_back_as_the_class_of_the_tree_that_it_is_of() -> None:
    with pytest.raises(GeometryError, match="leave 1 unknown") as caught:
        failed(OpenError("the observations leave 1 unknown open", remedy="hold it", combinations=())).raise_error()
    assert type(caught.value) is GeometryError
    assert caught.value.remedy == "hold it"


def test_several_errors_come_back_together() -> None:
    both = Errors([InputError("one", where="a.csv:1"), OpenError("two", remedy="", combinations=())])
    with pytest.raises(Errors) as caught:
        failed(both).raise_error()
    assert [type(e) for e in caught.value.errors] == [InputError, GeometryError]
