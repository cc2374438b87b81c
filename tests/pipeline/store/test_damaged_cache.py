"""A damaged cache is as good as an empty one, whatever is in it."""

from __future__ import annotations

import itertools
import json
import os
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from aatri.cli.main import app
from aatri.pipeline.store.cache import Cache, of_file
from tests.formats.tables.block_folder import write_folder

ODD: list[Any] = [
    None,
    1,
    "x",
    [],
    {},
    {"stat": 1},
    {"stat": [], "seen": "x", "value": 1},
    {"method": {}},
    [[1]],
    {"stat": None, "seen": 10**30, "value": None},
    {"method": {"ports": 1}, "options": 1, "files": []},
]


@pytest.mark.parametrize("text", [b"", b"\0", b"[]", b'{"a":', b"[" * 100_000, b'{"a": NaN}', b'{"a": "\\ud800"}'])
def test_a_cache_that_is_no_mapping_is_empty(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "c.json").write_bytes(text)
    cache = Cache(tmp_path / "c.json")
    assert cache.get("b") is None
    cache.put("b", 1)
    cache.save()
    assert Cache(tmp_path / "c.json").get("b") == 1


@pytest.mark.parametrize("value", ODD)
def test_an_odd_entry_on_a_file_is_not_believed(tmp_path: Path, value: Any) -> None:
    (tmp_path / "f").write_text("x")
    cache = Cache(None)
    cache.put(str(tmp_path / "f"), value)
    assert of_file(tmp_path / "f", cache, lambda p: p.read_text()) == "x"


@pytest.mark.slow
def test_a_run_with_every_entry_of_every_cache_damaged_ends_as_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    write_folder(tmp_path / "block")
    (tmp_path / "pipeline.yaml").write_text("run: out\nstages:\n  block: {use: block/tables, with: {path: block}}\n")
    assert CliRunner().invoke(app, ["run", "-q"]).exit_code == 0
    caches = list((tmp_path / "cache" / "aatri").glob("*.json"))
    assert len(caches) >= 3
    entries = {path: json.loads(path.read_bytes()) for path in caches}
    # In a cache of at least as many entries as values (100 of the code of modules) each entry meets one value, not all:
    # `of_file` reads them all, and the test above gives it every value. In smaller caches each entry meets all.
    for first in range(len(ODD)):
        for path, keys in entries.items():
            if first == 0 or len(keys) < len(ODD):
                path.write_text(json.dumps(dict(zip(keys, itertools.cycle(ODD[first:] + ODD[:first])))))
        done = CliRunner().invoke(app, ["status"])
        assert done.exit_code == 0, (first, done.stderr)
        assert "done" in done.stdout
    for path in caches:
        path.unlink()
        os.mkfifo(path)
    assert CliRunner().invoke(app, ["status"]).exit_code == 0
