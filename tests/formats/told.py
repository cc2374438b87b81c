"""A reporter that keeps what it is told."""

from __future__ import annotations


class Told:
    """Lines of the log and warnings, in their order."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def log(self, message: str) -> None:
        self.lines.append(message)

    def warn(self, message: str) -> None:
        self.lines.append(message)

    def progress(self, done: int, total: int, what: str = "") -> None:
        """Nothing."""
