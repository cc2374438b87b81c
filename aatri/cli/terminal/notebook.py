"""The narration below the cell of a notebook: a bar for the run, a line per stage under way, and the lines told."""

from __future__ import annotations

import importlib
import time
from collections.abc import Mapping
from html import escape
from typing import Any

from aatri.cli.terminal.live import MOST_SHARE, UNKNOWN_S, Live

COLOURS = {"red": "#c62828", "yellow": "#b26a00", "dim": "#777"}
"""Of lines: what failed, what is warned of, what is told beside."""


class NotebookBars(Live):
    """Bars as HTML that is replaced while the run goes on; it stays when the run has ended."""

    def __init__(self) -> None:  # nothing of the terminal is made
        self._lines: list[str] = []
        self._begun: dict[str, float] = {}
        self._heads: dict[str, str] = {}
        self._said: dict[str, str] = {}
        self._weight_of: Mapping[str, float] = {}
        self._made = self._of = 0
        self._weight_made = 0.0
        self._handle: Any = None

    def __enter__(self) -> NotebookBars:
        self._shown: Any = importlib.import_module("IPython.display")
        self._handle = self._shown.display(self._page(), display_id=True)
        return self

    def __exit__(self, *_: object) -> None:
        self._begun.clear()
        self.tick()

    def planned(self, fresh: int, stale: list[str], expected: Mapping[str, float]) -> None:
        """Take what there is to do, and how long it took before."""
        self._weight_of = {stage: expected.get(stage) or UNKNOWN_S for stage in stale}
        self._made, self._of = fresh, fresh + len(stale)
        self.tick()

    def started(self, stage: str, head: str, expected_s: float) -> None:  # noqa: ARG002
        """Take that a stage begins."""
        self._begun[stage], self._heads[stage], self._said[stage] = time.monotonic(), head, ""
        self.tick()

    def advanced(self, stage: str, done: int, total: int, what: str) -> None:
        """Take how far a stage is."""
        self._said[stage] = f"{done}/{total} {what}" if total else what

    def ended(self, stage: str) -> None:
        """Take that a stage is over."""
        if self._begun.pop(stage, None) is not None:
            self._made += 1
            self._weight_made += self._weight_of.get(stage, UNKNOWN_S)
        self.tick()

    def line(self, text: str, style: str = "") -> None:
        """A line above the bar."""
        self._lines.append(
            f'<span style="color:{COLOURS[style]}">{escape(text)}</span>' if style in COLOURS else escape(text)
        )
        self.tick()

    def tick(self, note: str = "") -> None:
        """Show times and bars as of now."""
        self._handle.update(self._page(note))

    def _page(self, note: str = "") -> Any:
        now = time.monotonic()
        under_way = sum(
            min(now - began, MOST_SHARE * self._weight_of.get(stage, UNKNOWN_S)) for stage, began in self._begun.items()
        )
        share = (self._weight_made + under_way) / max(sum(self._weight_of.values()), 1e-9) if self._weight_of else 1.0
        lines = [f"{self._heads[s]}  {now - began:.0f} s  {self._said[s]}" for s, began in self._begun.items()]
        text = "<br>".join([*self._lines, *map(escape, lines)])
        count = f"{share:.0%}, {self._made}/{self._of} stages {escape(note)}"
        bar = f'<progress max="1" value="{share:.3f}"></progress> {count}'
        return self._shown.HTML(f'<div style="font-family:monospace;white-space:pre-wrap">{text}<br>{bar}</div>')
