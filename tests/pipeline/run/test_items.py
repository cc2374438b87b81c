"""Items of a stage: each made once, kept by its content, made again where it is damaged; errors name the item."""

from __future__ import annotations

import datetime
import os
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from aatri.artifacts.features import MatchedKeypoints, Matches
from aatri.errors import InputError, ResourceError
from aatri.pipeline.run import items
from aatri.pipeline.run.items import ItemStore
from aatri.pipeline.store.gc import garbage, remove
from aatri.progress import SILENT, Item
from tests.made_up_stages import write_pipeline
from tests.pipeline.made_runs import run

MADE = "made.txt"


def squares(log: str, number: int) -> Matches:
    """An artifact of one row; it says in a file that it was made."""
    with Path(log).open("a") as file:
        file.write(f"{number}\n")
    if number < 0:
        raise InputError("below zero", where="")
    return Matches(pairs=MatchedKeypoints(left=np.array([number]), right=np.array([number**2])))


def total(log: str, left: Matches, right: Matches) -> Matches:
    """Of the results of two other items."""
    return squares(log, int(left.pairs.right[0] + right.pairs.right[0]))


def _items(log: Path, numbers: list[int]) -> list[Item]:
    return [Item(f"number {n}", (str(log),), (n,)) for n in numbers]


@pytest.mark.slow
@pytest.mark.parametrize("processes", ["1", "2"])
def test_items_are_made_once_and_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, processes: str) -> None:
    monkeypatch.setenv("NUMBA_NUM_THREADS", processes)
    log, store = tmp_path / MADE, ItemStore(tmp_path / "run", "block")
    kept = store.results(squares, _items(log, [3, 4]), Matches, "numbers", SILENT)
    assert [k.load().pairs.right[0] for k in kept] == [9, 16]
    more = store.results(squares, _items(log, [5, 3, 4]), Matches, "numbers", SILENT)
    assert [k.load().pairs.right[0] for k in more] == [25, 9, 16]
    assert sorted(log.read_text().split()) == ["3", "4", "5"]
    pair = store.results(total, [Item("3 and 5", (str(log),), (more[1], more[0]))], Matches, "pairs", SILENT)
    assert pair[0].load().pairs.left[0] == 34


@pytest.mark.slow
def test_a_damaged_item_is_made_again_and_an_error_names_its_item(tmp_path: Path) -> None:
    log, store = tmp_path / MADE, ItemStore(tmp_path / "run", "block")
    kept = store.results(squares, _items(log, [3]), Matches, "numbers", SILENT)[0]
    path = tmp_path / "run" / Path(*kept.names)
    path.write_bytes(path.read_bytes()[:100])
    assert store.results(squares, _items(log, [3]), Matches, "numbers", SILENT)[0].load().pairs.right[0] == 9
    with pytest.raises(InputError, match="below zero") as caught:
        store.results(squares, _items(log, [-1]), Matches, "numbers", SILENT)
    assert "number -1" in str(caught.value)


def test_where_processes_end_at_once_the_guard_of_a_script_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def submit(*_: object) -> None:
        raise BrokenProcessPool

    executor = SimpleNamespace(submit=submit, shutdown=lambda **_: None)
    monkeypatch.setattr(items, "ProcessPoolExecutor", lambda *_: executor)
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    store = ItemStore(tmp_path / "run", "block")
    with pytest.raises(ResourceError, match="a process of block was ended") as caught:
        store.results(squares, _items(tmp_path / MADE, [3, 4]), Matches, "numbers", SILENT)
    assert 'if __name__ == "__main__":' in caught.value.remedy


@pytest.mark.slow
def test_items_that_no_kept_result_has_used_are_garbage(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_pipeline(tmp_path, "  r: {use: source/random}\n")
    log, store = tmp_path / MADE, ItemStore(out, "r")
    run(tmp_path / "pipeline.yaml")
    old, used = store.results(squares, _items(log, [3, 4]), Matches, "numbers", SILENT)
    for one in (old, used):
        os.utime(out / Path(*one.names), (1e9, 1e9))  # made for a result that is gone
    store.results(squares, _items(log, [4]), Matches, "numbers", SILENT)
    now = datetime.datetime.now(datetime.UTC)
    (one,) = garbage(out, 2, None, now)
    assert one.folder == out / Path(*old.names)
    assert garbage(out, 2, 1e5, now) == []
    remove(out, [one])
    assert [p.name for p in (out / "items" / "r").iterdir()] == [used.names[-1]]


def test_items_of_a_stage_without_a_result_stay_until_they_are_old(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_pipeline(tmp_path, "  r: {use: source/random}\n")
    run(tmp_path / "pipeline.yaml")
    (kept,) = ItemStore(out, "killed").results(squares, _items(tmp_path / MADE, [3]), Matches, "numbers", SILENT)
    os.utime(out / Path(*kept.names), (1e9, 1e9))
    now = datetime.datetime.now(datetime.UTC)
    assert garbage(out, 0, None, now) == []
    assert [one.stage for one in garbage(out, 0, 30, now)] == ["killed"]
