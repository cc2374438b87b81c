"""Notes of methods: what is told, and how."""

from __future__ import annotations

from aatri.ids import several
from aatri.notes import Note, tell


class Kept:
    def __init__(self) -> None:
        self.lines: list[tuple[str, str]] = []

    def log(self, message: str) -> None:
        self.lines.append(("log", message))

    def warn(self, message: str) -> None:
        self.lines.append(("warn", message))

    def progress(self, done: int, total: int, what: str = "") -> None:
        self.lines.append(("progress", what))


def test_notes_are_told_in_order_each_at_its_level_with_its_ids() -> None:
    kept = Kept()
    tell([Note("note", "all well"), Note("warning", "left out", ("a", "b\x1b"))], kept)
    assert kept.lines == [("log", "all well"), ("warn", "left out: a, b\\x1b")]


def test_many_ids_are_told_in_part_and_all_kept() -> None:
    note = Note("warning", "left out", tuple(str(k) for k in range(100)))
    assert str(note).endswith("19 and 80 more")
    assert len(note.ids) == 100


def test_one_of_something_is_told_in_the_singular() -> None:
    assert several(1, "point") == "1 point"
    assert several(3, "point", "lies", "lie") == "3 points lie"
    assert several(1, "point", "lies", "lie") == "1 point lies"
