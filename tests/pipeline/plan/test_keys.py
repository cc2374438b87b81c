"""What of the files that options name enters a key."""

import os
from pathlib import Path
from typing import Any

from aatri.pipeline.plan.keys import file_digests
from aatri.pipeline.plan.reasons import Reason, Why, differences


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
