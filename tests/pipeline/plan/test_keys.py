"""Keys, and the comparison of what they stand for."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.pipeline.plan.compare import Compared, axes, changed_settings, largest_difference, relative_spread
from aatri.pipeline.plan.keys import file_digests
from aatri.pipeline.plan.reasons import Reason, Why, differences

# What of the files that options name enters a key.


def test_a_changed_file_of_a_folder_is_named_and_not_its_digest(tmp_path: Path) -> None:
    (tmp_path / "ground_points.csv").write_text("a")
    (tmp_path / "images.csv").write_text("b")

    def digests() -> dict[str, str]:
        return file_digests("path", tmp_path, lambda p: p.read_text())

    before = digests()
    (tmp_path / "ground_points.csv").write_text("c")
    (tmp_path / "images.csv").unlink()
    (tmp_path / "new.csv").write_text("d")
    parts: dict[str, Any] = {
        "key_schema": 2,
        "plugin": "a/b",
        "version": 1,
        "options": {},
        "inputs": {},
        "code": "x",
        "schemas": {},
        "seed": None,
    }
    told = [str(r) for r in differences({**parts, "files": before}, {**parts, "files": digests()})]
    assert told == ["ground_points.csv changed", "images.csv is gone", "new.csv is new"]
    assert str(Reason(Why.input, "image_points", "0123", "4567")) == "input image_points changed"


def test_a_link_to_nothing_and_a_pipe_in_a_folder_are_changes_and_not_opened(tmp_path: Path) -> None:
    """A result made without them is none of the folder as it is now."""
    (tmp_path / "images.csv").write_text("b")

    def digests() -> dict[str, str]:
        return file_digests("path", tmp_path, lambda p: p.read_text())

    before = digests()
    (tmp_path / "geodetic.csv").symlink_to(tmp_path / "gone.csv")
    os.mkfifo(tmp_path / "exterior.csv")
    (tmp_path / "empty").mkdir()
    after = digests()
    assert set(after) - set(before) == {"path/geodetic.csv", "path/exterior.csv"}
    assert after["path/images.csv"] == before["path/images.csv"]


# How far two artifacts of the same stage are apart, and what changed most stands first.


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ((1.0, 1.0), 0.0),
        ((1.0, 2.0), 0.5),
        ((-1.0, 1.0), 2.0),
        ((0, 0), 0.0),
        ((None, 1.0), float("inf")),
        ((10, 11, 8), 3 / 11),
    ],
)
def test_the_spread_of_a_figure_is_relative(values, expected) -> None:
    assert relative_spread(values) == pytest.approx(expected)


def _run(name: str, use: str, options: dict[str, Any], source: str) -> Compared:
    record = {"plugin": use, "options": options, "inputs": {"initial": {"stage": source}}}
    return Compared(name, Path(name), ("bundle",), {"bundle": record})


def test_another_port_is_a_change_and_runs_of_another_method_are_told_apart_by_its_options() -> None:
    first = _run("first", "role/plain", {"limit": 4}, "strips")
    other = _run("other", "role/plain", {"limit": 4}, "models")
    two, three = (_run(name, "role/curved", {"limit": 4, "degree": n}, "strips") for name, n in (("2", 2), ("3", 3)))
    (axis,) = axes([first, other, two, three])
    assert axis.stages == ("bundle",)
    assert changed_settings(first, other, axis.runs) == ["bundle.from initial: strips -> models"]
    assert changed_settings(first, three, axis.runs) == ["bundle: role/plain -> role/curved (degree: 3)"]
    assert changed_settings(first, three, [three]) == ["bundle: role/plain -> role/curved"]


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ([1.0, -4.0, np.nan], [1.0, -4.2, np.nan], 0.05),
        ([np.nan, np.nan], [np.nan, np.nan], 0.0),
        ([], [], 0.0),
        ([0.0, 0.0], [0.0, 1e-9], np.inf),
        ([1.0, np.nan], [1.0, 2.0], np.inf),
        ([np.inf, 2.0], [np.inf, 2.0], 0.0),
        ([np.inf, 2.0], [-np.inf, 2.0], np.inf),
        ([np.inf, 2.0], [np.nan, 2.0], np.inf),
    ],
)
def test_a_column_is_measured_by_its_own_largest_magnitude(
    a: list[float], b: list[float], expected: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {Path("a"): {"t/x": np.array(a)}, Path("b"): {"t/x": np.array(b)}}
    monkeypatch.setattr("aatri.tables.hdf5.read_plain", files.__getitem__)
    assert largest_difference(Path("a"), Path("b")) == pytest.approx(expected)
