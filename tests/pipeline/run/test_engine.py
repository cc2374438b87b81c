from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

from aatri.errors import AatriError, ArtifactError, ConvergenceError, Errors, ResourceError, SpecError
from aatri.pipeline.plan.decisions import State
from aatri.pipeline.plan.reasons import Why
from aatri.pipeline.run import worker, workers
from aatri.pipeline.run.runner import RunSettings
from aatri.pipeline.run.single import make_stage
from aatri.pipeline.store import run_folder as store
from aatri.pipeline.store.accept import accept
from aatri.pipeline.store.gc import garbage, remove
from aatri.pipeline.store.lock import locked
from tests.made_up_stages import write_pipeline
from tests.pipeline.made_runs import SOURCE, Quiet, digests, opened, planned, read_events, run

LINES = (
    "  a: {use: source/fixed, with: {file: data.txt}}\n"
    "  r: {use: source/random}\n"
    "  s: {use: sum/add, from: {numbers: a, more: r}}\n"
    "  t: {use: sum/add, from: {numbers: r}}\n"
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "data.txt").write_text("1 2 3\n")
    return write_pipeline(tmp_path, LINES + "variants:\n  far: {s: {with: {offset: 9.0}}}\n")


@pytest.mark.slow
def test_a_second_run_does_nothing_and_writes_nothing(path: Path) -> None:
    assert run(path)[0] == ["a", "r", "s", "t"]
    folder = path.parent / "out"
    before = {p: p.stat().st_mtime_ns for p in folder.rglob("*") if p.name != ".lock"}
    made, records = run(path)
    assert made == []
    assert list(records) == ["a", "r", "s", "t"]
    assert {p: p.stat().st_mtime_ns for p in folder.rglob("*") if p.name != ".lock"} == before


def test_where_artifacts_are_large_only_those_of_the_next_stage_stay_in_memory(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[str] = []
    load = worker.load_object

    def counted(folder: Path, record: dict[str, str], kind: str) -> object:
        read.append(record["stage"])
        return load(folder, record, kind)

    monkeypatch.setattr(worker, "load_object", counted)
    kept = digests(run(path)[1])
    assert read == []
    other = tmp_path / "other"
    other.mkdir()
    (other / "data.txt").write_text("1 2 3\n")
    monkeypatch.setattr(workers, "MOST_KEPT_BYTES", 0)
    # `a` is made first and needed by `s` alone: it is dropped for `r`, which wants nothing.
    assert digests(run(write_pipeline(other, LINES))[1]) == kept
    assert read == ["a"]


def test_equal_content_ends_the_work_below(path: Path) -> None:
    run(path)
    assert run(path, sets=("a.shape=down",))[0] == ["a"]  # the option changes the key, not the numbers
    (path.parent / "data.txt").write_text("4 5 6\n")
    (reason,) = planned(path, sets=("a.shape=down",)).of("a").reasons
    assert (reason.why, reason.about) == (Why.file, "data.txt")
    assert run(path, sets=("a.shape=down",))[0] == ["a"]


@pytest.mark.slow
def test_going_back_is_a_change_of_pointer(path: Path) -> None:
    _, first = run(path)
    _, other = run(path, sets=("s.offset=2",))
    assert digests(first)["s"] != digests(other)["s"]
    made, back = run(path)
    assert made == []
    assert digests(back) == digests(first)
    assert store.current_record(path.parent / "out", "s") == first["s"]
    assert first["s"]["key"] in os.readlink(path.parent / "out" / "current" / "s.h5")


def test_after_a_failure_only_what_is_left_is_made_and_attempts_are_kept_apart(path: Path) -> None:
    for _ in range(5):
        with pytest.raises(ConvergenceError):
            run(path, uses=("s=sum/stubborn",))
    decision = planned(path, uses=("s=sum/stubborn",)).of("s")
    assert Why.failed_before in [reason.why for reason in decision.reasons]
    failed = path.parent / "out" / "failed" / "s"
    assert sorted(p.name for p in failed.iterdir()) == ["earlier", "error.json", "stage.log"]
    assert len(list((failed / "earlier").iterdir())) == 3
    assert run(path)[0] == ["s", "t"]
    assert store.failure(path.parent / "out", "s") is None


@pytest.mark.slow
def test_keep_going_makes_what_does_not_depend_on_the_failure(path: Path) -> None:
    lines = LINES + "  w: {use: loop/report_size, from: {total: s, numbers: r}}\n"
    path = write_pipeline(path.parent, lines)
    with pytest.raises(ConvergenceError):
        run(path, {"keep_going": True}, uses=("s=sum/stubborn",))
    made = {d.stage: d.state for d in planned(path, uses=("s=sum/stubborn",)).decisions}
    assert made == {"a": State.fresh, "r": State.fresh, "s": State.run, "t": State.fresh, "w": State.run}
    with pytest.raises(Errors) as caught:
        run(path, {"keep_going": True}, uses=("s=sum/stubborn", "t=sum/buggy"))
    assert len(caught.value.errors) == 2


def test_an_interrupt_is_remembered(path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(path, uses=("s=sum/interrupted",))
    reasons = planned(path, uses=("s=sum/interrupted",)).of("s").reasons
    assert [reason.why for reason in reasons] == [Why.interrupted]
    assert [e["event"] for e in read_events(path.parent / "out")][-1] == "ended"


def test_a_selection_touches_only_its_stages_and_needs_the_others(path: Path) -> None:
    with pytest.raises(Errors, match="s needs a, which is not selected and not up to date"):
        run(path, {"select": {"only": ["s"]}})
    assert run(path, {"select": {"until": "s"}})[0] == ["a", "r", "s"]
    assert run(path, {"select": {"start": "s"}}, sets=("s.offset=3", "t.offset=3"))[0] == ["s"]
    assert run(path, {"select": {"force": ["r"]}}, sets=("s.offset=3",))[0] == ["r", "t"]


@pytest.mark.slow
def test_two_workers_give_what_one_gives(path: Path) -> None:
    _, alone = run(path)
    spread = write_pipeline(path.parent, LINES, head="run: other\nseed: 1\n")
    made, together = run(spread, {"jobs": 2})
    assert set(made) == set(alone)
    assert digests(together) == digests(alone)
    assert {s: r["key"] for s, r in together.items()} == {s: r["key"] for s, r in alone.items()}
    with pytest.raises(AatriError, match="no convergence") as caught:
        run(spread, {"jobs": 2}, uses=("s=sum/stubborn",))
    assert (type(caught.value), caught.value.where) == (ConvergenceError, "point 12")


def damage(path: Path, chance: random.Random) -> str:
    """Damage a file in one of the ways that disks, copies and people do."""
    data = bytearray(path.read_bytes())
    way = chance.choice(["flip", "zero", "cut", "grow", "swap"])
    at = chance.randrange(len(data))
    if way == "flip":
        data[at] ^= 1 << chance.randrange(8)
    elif way == "zero":
        page = slice(at // 512 * 512, at // 512 * 512 + 512)
        data[page] = bytes(len(data[page])) if any(data[page]) else b"\1" * len(data[page])
    elif way == "cut":
        del data[at:]
    elif way == "grow":
        data += b"\0"
    else:
        others = [p for p in path.parents[2].rglob(path.name) if p.read_bytes() != bytes(data)]
        data = bytearray(chance.choice(others).read_bytes())
    path.write_bytes(data)
    return way


@pytest.mark.slow
def test_every_damage_is_found_and_mended(path: Path) -> None:
    _, first = run(path)
    chance = random.Random(5)
    for _ in range(40):
        stage = chance.choice(sorted(first))
        folder = store.artifact_path(path.parent / "out", stage).parent
        way = damage(folder / chance.choice(["artifact.h5", "record.json"]), chance)
        assert planned(path).of(stage).state is State.run, way
        made, records = run(path)
        assert made == [stage]
        assert digests(records) == digests(first)


def test_an_accepted_change_of_code_lets_results_stand(path: Path) -> None:
    from dataclasses import replace

    from aatri.pipeline.plan.decisions import plan
    from aatri.pipeline.plan.view import StoreView

    run(path)
    spec, nodes = opened(path)
    nodes = tuple(replace(n, code=replace(n.code, digest="other")) if n.name == "s" else n for n in nodes)
    view = StoreView(spec.run)
    decision = plan(nodes, view, 1).of("s")
    assert [reason.why for reason in decision.reasons] == [Why.code]
    assert decision.key is not None
    accept(spec.run, "s", view.last("s"), decision.parts, decision.key, "only a name")
    accepted = plan(nodes, view, 1).of("s")
    assert (accepted.state, accepted.accepted) == (State.fresh, True)
    assert json.loads((spec.run / "accepted" / "s" / f"{decision.key}.json").read_text())["why"] == "only a name"
    changed = planned(path, sets=("s.offset=1",)).of("s")
    with pytest.raises(SpecError, match="also options"):
        accept(spec.run, "s", view.last("s"), changed.parts, changed.key or "", "no")


def test_variants_share_results_and_have_their_own_pointers(path: Path) -> None:
    assert run(path, variant="far")[0] == ["a", "r", "s", "t"]
    assert run(path)[0] == ["s"]
    out = path.parent / "out"
    assert (out / "variants" / "far" / "current" / "s.h5").resolve().parent.parent == (out / "objects" / "s").resolve()
    far, near = (store.current_record(folder, "s") for folder in (out / "variants" / "far", out))
    assert far is not None
    assert near is not None
    assert far["metrics"]["total"] - near["metrics"]["total"] == pytest.approx(9.0)
    assert garbage_of(out, 0) == []
    with pytest.raises(SpecError, match="no variant 'fra' - did you mean 'far'"):
        run(path, variant="fra")


def garbage_of(folder: Path, keep: int, older: float | None = None) -> list[str]:
    import datetime

    found = garbage(folder, keep, older, datetime.datetime.now(datetime.UTC))
    return [one.stage for one in found]


@pytest.mark.slow
def test_gc_keeps_what_is_current_and_the_latest_others(path: Path) -> None:
    import datetime

    for offset in range(4):
        run(path, sets=(f"s.offset={offset}",))
    out = path.parent / "out"
    assert garbage_of(out, 0) == ["s", "s", "s"]
    assert garbage_of(out, 2) == ["s"]
    assert garbage_of(out, 0, older=1) == []
    remove(out, garbage(out, 0, None, datetime.datetime.now(datetime.UTC)))
    assert run(path, sets=("s.offset=3",))[0] == []
    assert run(path, sets=("s.offset=2",))[0] == ["s"]


HOLDER = """
import sys, time
from pathlib import Path
from aatri.pipeline.store.lock import locked
with locked(Path(sys.argv[1]), "aatri run here"):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_second_writer_leaves_at_once_and_a_killed_one_frees_the_lock(path: Path) -> None:
    run(path)
    out = path.parent / "out"
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, str(out)], stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(ResourceError, match=rf"busy: aatri run here, process {holder.pid} on ") as caught:
            run(path)
        assert caught.value.exit_code == 8
        assert planned(path).stale == ()  # readers take no lock
    finally:
        holder.kill()
        holder.wait()
        if holder.stdout is not None:
            holder.stdout.close()
    assert run(path)[0] == []


@pytest.mark.slow
def test_single_stages_run_side_by_side_but_not_beside_a_run(path: Path) -> None:
    spec, nodes = opened(path)
    how = RunSettings(source=SOURCE)
    for name in ("a", "r", "s"):
        assert make_stage(spec, nodes, name, Quiet(), how)[1]
    assert not make_stage(spec, nodes, "s", Quiet(), how)[1]
    with locked(spec.run, "exec", stage="x"):
        assert make_stage(spec, nodes, "t", Quiet(), how)[1]
        with pytest.raises(ResourceError, match="writes there"):
            run(path)
    assert run(path)[0] == []
    other, its_nodes = opened(path, sets=("a.count=2",))
    with pytest.raises(ArtifactError, match="s needs a"):
        make_stage(other, its_nodes, "s", Quiet(), how)


def test_a_read_only_folder_is_told(path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("root may write everywhere")
    (path.parent / "out").mkdir()
    (path.parent / "out").chmod(0o500)
    begin = time.monotonic()
    with pytest.raises(ResourceError, match="Permission denied"):
        run(path)
    assert time.monotonic() - begin < 60
