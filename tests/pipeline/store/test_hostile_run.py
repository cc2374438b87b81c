"""A run folder made to harm: links, pipes, names that lead out of it, JSON that is no record."""

from __future__ import annotations

import datetime
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from aatri.errors import AatriError, ArtifactError
from aatri.pipeline.store import inside
from aatri.pipeline.store import run_folder as store
from aatri.pipeline.store.events import Events
from aatri.pipeline.store.gc import garbage, remove
from aatri.pipeline.store.lock import locked
from aatri.pipeline.store.records import SCHEMA, read_record, seal
from aatri.report.view.run_view import view
from tests.made_up_stages import Total, write_pipeline
from tests.pipeline.made_runs import digests, run

LINES = "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: a}}\n"
MINE = b"mine, and no business of aatri's\n"

FOLDERS = ["current", "objects", "previous", "running", "failed", "objects/s"]
OF_STAGE = [f"{folder}/s.json" for folder in ("current", "running", "previous")]
FILES = ["run.json", "report.html", "report.json", "running/s.log", *OF_STAGE]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write_pipeline(tmp_path, LINES)


@pytest.fixture
def precious(tmp_path: Path) -> Path:
    """A folder of the user's outside the run, whose every file stays as it is."""
    folder = tmp_path / "precious"
    (folder / "s" / "0123456789ab").mkdir(parents=True)
    for place in (folder, folder / "s", folder / "s" / "0123456789ab"):
        (place / "file").write_bytes(MINE)
        (place / "s.json").write_bytes(MINE)
        (place / "record.json").write_bytes(MINE)
    return folder


def state(folder: Path) -> dict[str, Any]:
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in sorted(folder.rglob("*"))}


def assert_damage_or_nothing(read: Callable[[Path], Any], out: Path) -> None:
    """What `read` has to say of a run, if anything, is that it is damaged."""
    code = None
    try:
        read(out)
    except AatriError as error:
        code = error.exit_code
    assert code in (None, 7)


def replaced(place: Path, target: Path) -> None:
    """Put a link in the place of a file or folder."""
    if place.is_dir() and not place.is_symlink():
        shutil.rmtree(place)
    place.unlink(missing_ok=True)
    place.symlink_to(target)


@pytest.mark.parametrize("name", FOLDERS)
def test_a_link_in_the_place_of_a_folder_of_a_run_is_refused_and_harms_nothing(
    path: Path, precious: Path, name: str
) -> None:
    out = path.parent / "out"
    run(path)
    replaced(out / name, precious)
    before = state(precious)
    with pytest.raises(ArtifactError, match="link") as caught:
        run(path, sets=("s.offset=1",))
    assert caught.value.exit_code == 7
    assert state(precious) == before
    (out / name).unlink()
    assert run(path, sets=("s.offset=1",))[1].keys() == {"a", "s"}


@pytest.mark.parametrize("name", FOLDERS)
def test_gc_removes_nothing_through_links(path: Path, precious: Path, name: str) -> None:
    run(path)
    run(path, sets=("s.offset=1",))
    replaced(path.parent / "out" / name, precious)
    before = state(precious)
    now = datetime.datetime.now(datetime.UTC)
    assert_damage_or_nothing(lambda out: remove(out, garbage(out, 0, None, now)), path.parent / "out")
    assert state(precious) == before


@pytest.mark.parametrize("name", FILES)
def test_a_link_in_the_place_of_a_file_of_a_run_is_replaced_and_its_target_left(
    path: Path, precious: Path, name: str
) -> None:
    out = path.parent / "out"
    _, first = run(path)
    replaced(out / name, precious / "file")
    before = state(precious)
    _, again = run(path, {"select": {"force": ["s"]}})
    assert digests(again) == digests(first)
    assert state(precious) == before
    assert not (out / name).is_symlink() or name in ("report.html", "report.json")
    assert json.loads((out / "run.json").read_text())["status"] == "done"


@pytest.mark.parametrize("name", [".lock", "events.jsonl"])
@pytest.mark.parametrize("how", ["link", "second name", "pipe", "folder"])
def test_what_is_appended_to_or_locked_is_a_file_of_the_run_only(
    path: Path, precious: Path, name: str, how: str
) -> None:
    out = path.parent / "out"
    run(path)
    (out / name).unlink()
    if how == "link":
        (out / name).symlink_to(precious / "file")
    elif how == "second name":
        os.link(precious / "file", out / name)
    elif how == "pipe":
        os.mkfifo(out / name)
    else:
        (out / name).mkdir()
    before = state(precious)
    with pytest.raises(ArtifactError, match=r"aatri never puts there"):
        run(path, sets=("s.offset=1",))
    assert state(precious) == before


def test_an_artifact_that_is_a_link_or_a_pipe_is_made_again(path: Path, precious: Path) -> None:
    _, first = run(path)
    out = path.parent / "out"
    place = store.artifact_path(out, "s")
    shutil.copy(place, precious / "same.h5")
    for make in (lambda: place.symlink_to(precious / "same.h5"), lambda: os.mkfifo(place), lambda: place.mkdir()):
        place.unlink()
        make()
        with pytest.raises(ArtifactError):
            store.load(out, "s", Total)
        if place.is_dir():
            with pytest.raises(AatriError, match="directory") as caught:
                run(path)
            assert caught.value.exit_code == 8
            break
        made, again = run(path)
        assert made == ["s"]
        assert digests(again) == digests(first)


def test_the_log_of_a_failure_is_not_shown_through_a_link(path: Path, precious: Path) -> None:
    run(path)
    out = path.parent / "out"
    store.fail(out, "s", {"what": "w", "where": "", "remedy": "", "exit_code": 4, "ended": ""})
    replaced(out / "failed" / "s" / "stage.log", precious / "file")
    assert view(out).stages[1].log == ()
    shutil.rmtree(out / "failed" / "s")
    (out / "failed" / "s").symlink_to(precious)
    with pytest.raises(ArtifactError, match="link"):
        run(path, sets=("s.offset=1",))


@pytest.mark.parametrize("change", [
    {"stage": "../../precious/s"}, {"stage": "a/b"}, {"key": "../../../../precious"}, {"key": "/etc"}, {"key": ""},
    {"stage": "a"}, {"output": {"file": "/etc/passwd"}}, {"output": {"file": "../../../../precious/file"}},
    {"output": {"file": "other.h5"}}, {"output": None}, {"parts": {}}, {"parts": []}, {"inputs": {"x": 1}},
    {"inputs": {"x": {"stage": "../y", "key": "k", "content_digest": ""}}}, {"metrics": {"x": "many"}},
    {"metrics": 3}, {"warnings": [1]}, {"seconds": "1"}, {"ended": "yesterday"}, {"environment": {"numpy": {}}},
    {"options": []}, {"schema": 1}, {"schema": SCHEMA + 1}, {"plugin": None},
])  # fmt: skip
def test_a_sealed_record_of_another_shape_is_damage(path: Path, precious: Path, change: dict[str, Any]) -> None:
    _, first = run(path)
    out = path.parent / "out"
    for place in (out / "current" / "s.json", *out.glob("objects/s/*/record.json")):
        record = json.loads(place.read_bytes())
        for name, value in change.items():
            record[name] = {**record[name], **value} if name == "output" and value else value
        record["seal"] = seal(record)
        place.write_text(json.dumps(record))
    with pytest.raises(ArtifactError) as caught:
        store.load(out, "s", Total)
    assert caught.value.exit_code == 7
    assert store.last_record(out, "s") is None
    made, again = run(path)
    assert made == ["s"]
    assert digests(again) == digests(first)


NOT_JSON = {
    "NaN": b'{"schema": 2, "x": NaN}', "too large": b'{"schema": 2, "x": 1e999}', "half a sign": b'{"x": "\\ud800"}',
    "deep": b'{"x": ' + b"[" * 100_000 + b"]" * 100_000 + b"}", "many digits": b'{"x": ' + b"9" * 10_000 + b"}",
    "list": b"[]", "empty": b"", "zero": b"\0" * 100, "UTF-16": '{"schema": 2}'.encode("utf-16"), "cut": b'{"schema":',
}  # fmt: skip


@pytest.mark.slow(after=12)
@pytest.mark.parametrize(
    "name", ["run.json", "current/s.json", "running/s.json", "objects", "failed/s/error.json", "accepted"]
)
@pytest.mark.parametrize("what", NOT_JSON)
def test_json_that_is_no_record_is_mended_by_the_next_run(path: Path, name: str, what: str) -> None:
    _, first = run(path)
    out = path.parent / "out"
    if name == "objects":
        name = str(store.artifact_path(out, "s").parent.relative_to(out) / "record.json")
    elif name == "accepted":
        name = f"accepted/s/{first['s']['key']}.json"
    (out / name).parent.mkdir(parents=True, exist_ok=True)
    (out / name).write_bytes(NOT_JSON[what])
    for read in (view, store.read_overview, lambda r: store.current_record(r, "s"), lambda r: store.failure(r, "s")):
        assert_damage_or_nothing(read, out)
    _, again = run(path)
    assert digests(again) == digests(first)
    assert store.read_overview(out) is not None
    assert store.failure(out, "s") is None


def test_run_json_of_another_shape_is_damage(path: Path) -> None:
    run(path)
    out = path.parent / "out"
    whole = json.loads((out / "run.json").read_bytes())
    for change in ({"stages": {}}, {"stages": [1]}, {"stages": [{"stage": "../x"}]}, {"request": []}, {"status": 1},
                   {"request": {"pipeline": 1}}):  # fmt: skip
        (out / "run.json").write_text(json.dumps(whole | change))
        with pytest.raises(ArtifactError, match="damaged"):
            store.read_overview(out)
        run(path)
        assert store.read_overview(out) is not None


@pytest.mark.parametrize("name", ["..", "a/b", "/etc", "", ".", "a\0b", "x" * 300, "\x1b[2J"])
def test_names_that_lead_elsewhere_have_no_place_in_a_run(tmp_path: Path, name: str) -> None:
    with pytest.raises(ArtifactError, match="no name of a file of a run"):
        inside.path_of(tmp_path, "current", name)


def test_the_run_of_a_variant_that_is_a_link_is_refused(tmp_path: Path, precious: Path) -> None:
    path = write_pipeline(tmp_path, LINES + "variants:\n  more: {s: {with: {offset: 2}}}\n")
    run(path)
    (tmp_path / "out" / "variants").mkdir()
    (tmp_path / "out" / "variants" / "more").symlink_to(precious)
    before = state(precious)
    with pytest.raises(AatriError, match=r"link|not the folder of a run") as caught:
        run(path, variant="more")
    assert caught.value.exit_code in (2, 7)
    assert state(precious) == before


def test_a_name_of_a_variant_cannot_leave_the_run(tmp_path: Path) -> None:
    path = write_pipeline(tmp_path, LINES + 'variants:\n  "../../elsewhere": {s: {with: {offset: 2}}}\n')
    with pytest.raises(AatriError, match="name of a variant") as caught:
        run(path)
    assert caught.value.exit_code == 2


def test_the_text_of_a_hostile_lock_is_not_believed(tmp_path: Path) -> None:
    with locked(tmp_path, "first"):
        (tmp_path / ".lock").write_text('{"pid": 1}')
        with pytest.raises(AatriError, match="another process writes there"), locked(tmp_path, "second"):
            pass


def test_events_are_not_read_through_a_link(tmp_path: Path, precious: Path) -> None:
    (tmp_path / "events.jsonl").symlink_to(precious / "file")
    with pytest.raises(ArtifactError, match="link"):
        Events(tmp_path)
    assert (precious / "file").read_bytes() == MINE


def test_a_pointer_to_another_stage_is_damage(path: Path) -> None:
    run(path)
    out = path.parent / "out"
    shutil.copy(out / "current" / "a.json", out / "current" / "s.json")
    with pytest.raises(ArtifactError, match="another stage"):
        store.current_record(out, "s")
    assert run(path)[0] == []
    assert read_record(out, "current", "s.json")["stage"] == "s"  # type: ignore[index]


def test_a_run_that_lost_its_run_json_goes_on(path: Path) -> None:
    _, first = run(path)
    out = path.parent / "out"
    (out / "report.html").write_text("")
    (out / "accepted").mkdir()
    for harm in (lambda p: p.unlink(), lambda p: (p.unlink(), p.symlink_to("gone"))):
        harm(out / "run.json")
        made, again = run(path)
        assert made == []
        assert digests(again) == digests(first)
        assert not (out / "run.json").is_symlink()
