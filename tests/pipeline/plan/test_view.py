"""What the planner reads of a run to know that nothing is to be done."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from aatri.pipeline.plan import view
from aatri.pipeline.plan.decisions import State, plan
from aatri.pipeline.store import run_folder as store
from tests.made_up_stages import write_pipeline
from tests.pipeline.made_runs import opened, run


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return write_pipeline(tmp_path, "  r: {use: source/random}\n  t: {use: sum/add, from: {numbers: r}}\n")


def states(path: Path) -> dict[str, State]:
    spec, nodes = opened(path)
    planned = plan(nodes, view.StoreView(spec.run), spec.seed)
    return {decision.stage: decision.state for decision in planned.decisions}


def test_after_a_run_no_artifact_is_read_to_know_that_it_is_whole(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(path)
    monkeypatch.setattr(view, "file_sha256", None)
    assert states(path) == {"r": State.fresh, "t": State.fresh}


def test_an_artifact_altered_right_after_the_run_is_seen_though_its_size_and_time_stay(path: Path) -> None:
    run(path)
    artifact = store.artifact_path(path.parent / "out", "r").resolve()
    before, content = artifact.stat(), bytearray(artifact.read_bytes())
    content[-1] ^= 1
    artifact.write_bytes(content)
    os.utime(artifact, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert states(path)["r"] is State.run


def test_where_file_times_are_whole_seconds_artifacts_are_read_again(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second change within the same second would leave them as they are."""
    from aatri.pipeline.store import cache

    of_file, read = cache.stat_of, list[Path]()
    digest = cache.file_sha256
    monkeypatch.setattr(cache, "stat_of", lambda p: [t // 10**9 * 10**9 if t > 10**12 else t for t in of_file(p)])
    monkeypatch.setattr(view, "file_sha256", lambda p: read.append(p) or digest(p))
    run(path)
    read.clear()
    assert states(path) == {"r": State.fresh, "t": State.fresh}
    assert len(read) == 2
