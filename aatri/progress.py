"""What a method may tell the outside while it works: a message, a warning, how far it is.

Methods take a `Reporter` and never print. `SILENT` is the default everywhere.
"""

from __future__ import annotations

from typing import Protocol


class Reporter(Protocol):
    """Receives messages of a running method."""

    def log(self, message: str) -> None:
        """Take a line for the log."""

    def warn(self, message: str) -> None:
        """Take a line for the log that the user must see."""

    def progress(self, done: int, total: int, what: str = "") -> None:
        """Take how many of `total` steps are done."""


class Silent:
    """A reporter that keeps nothing."""

    def log(self, message: str) -> None:
        """Drop the line."""

    def warn(self, message: str) -> None:
        """Drop the line."""

    def progress(self, done: int, total: int, what: str = "") -> None:
        """Drop the figure."""


SILENT = Silent()
