"""The live part of the narration on a terminal: a bar for the run, one for each stage under way.

    run       ━━━━━━━━━━━╸━━━━━━━━  34 %  4/11 stages  21 s, about 40 s left
    models    ━━━━━━━━━━━━━━━━━╸━━  86 %  9 s of about 12 s  211/244 models

rich draws it: colours as `NO_COLOR` and `FORCE_COLOR` say, as wide as the terminal.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import TaskID

UNKNOWN_S = 1.0
"""What a stage counts for in the bar of the run if nobody knows how long it takes."""

MOST_SHARE = 0.99
"""What is under way is not done."""

BAR = "cyan"
"""Colour of the bars: red is for what failed."""


class Live:
    """Bars at the foot of the terminal, and lines above them.

    Parameters
    ----------
    console : Console, optional
        Where to draw; stderr unless given.
    """

    def __init__(self, console: Console | None = None) -> None:
        from rich.progress import BarColumn, Progress, TextColumn

        self.console = console or self._screen()
        self._progress = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=24, complete_style=BAR, finished_style=BAR, pulse_style=BAR),
            TextColumn("{task.fields[status]}", markup=False),
            console=self.console,
            transient=True,
            refresh_per_second=5,
            expand=False,
        )
        self._run = self._progress.add_task("run", total=None, status="")
        self._stages: dict[str, tuple[TaskID, float, float]] = {}
        self._steps: dict[str, str] = {}
        self._weights: dict[str, float] = {}
        self._done_weight, self._done, self._count, self._began = 0.0, 0, 0, time.monotonic()
        self._known = False

    def _screen(self) -> Console:
        from rich.console import Console

        return Console(stderr=True, highlight=False, soft_wrap=True)

    def __enter__(self) -> Live:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def planned(self, fresh: int, stale: list[str], expected: Mapping[str, float]) -> None:
        """Take what there is to do, and how long it took before."""
        self._weights = {stage: expected.get(stage) or UNKNOWN_S for stage in stale}
        self._done, self._count = fresh, fresh + len(stale)
        self._known = all(stage in expected for stage in stale)
        self._progress.update(self._run, total=max(sum(self._weights.values()), 1e-9))
        self.tick()

    def started(self, stage: str, head: str, expected_s: float) -> None:
        """Take that a stage begins."""
        task = self._progress.add_task(head, total=None, status="")
        self._stages[stage] = (task, time.monotonic(), expected_s)
        self.tick()

    def advanced(self, stage: str, done: int, total: int, what: str) -> None:
        """Take how far a stage is; a total of 0 is not known."""
        if stage in self._stages:
            self._steps[stage] = f"{done}/{total} {what}".strip() if total else what
            self._progress.update(self._stages[stage][0], total=total or None, completed=done if total else 0)

    def ended(self, stage: str) -> None:
        """Take that a stage is over, made or not."""
        if stage in self._stages:
            self._progress.remove_task(self._stages.pop(stage)[0])
            self._steps.pop(stage, None)
            self._done += 1
            self._done_weight += self._weights.get(stage, UNKNOWN_S)
        self.tick()

    def line(self, text: str, style: str = "") -> None:
        """A line above the bars."""
        from rich.text import Text

        self.console.print(Text(text, style=style), soft_wrap=True)

    def tick(self, note: str = "") -> None:
        """Bring times and bars up to now; a note stands beside the bar of the run."""
        now = time.monotonic()
        under_way = 0.0
        for stage, (task, began, expected) in self._stages.items():
            about = f" of about {expected:.0f} s" if expected >= 1 else ""
            step = self._steps.get(stage, "")
            at = self._progress.tasks[self._progress.task_ids.index(task)]
            share = at.completed / at.total if at.total else (now - began) / expected if expected >= 1 else None
            status = f"{_percent(share)}{now - began:.0f} s{about}  {step}"
            self._progress.update(task, status=status.rstrip())
            under_way += min(now - began, MOST_SHARE * self._weights.get(stage, UNKNOWN_S))
        left = sum(self._weights.values()) - self._done_weight - under_way
        about = f", about {left:.0f} s left" if self._known and left >= 1 else ""
        share = (self._done_weight + under_way) / max(sum(self._weights.values()), 1e-9)
        head = f"{_percent(share if self._known else None)}{self._done}/{self._count} stages"
        status = f"{head}  {now - self._began:.0f} s{about}  {note}".rstrip()
        self._progress.update(self._run, completed=self._done_weight + under_way, status=status)


def _percent(share: float | None) -> str:
    """How much is done; nothing where that is not known, and never all before the end."""
    return f"{min(share, MOST_SHARE):3.0%}  " if share is not None else ""
