"""Tells what happens during a run, on stderr: a live line on a terminal, else a line now and then.

The live line shows the stages under way with the time since they began and the time they took before.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from aatri.cli.console import is_terminal, narrate
from aatri.cli.figures import highlights

if TYPE_CHECKING:
    from aatri.pipeline.plan.plan import Plan

_LIVE_S, _HEARTBEAT_S = 0.2, 10.0


@dataclass
class _UnderWay:
    """A stage under way."""

    head: str
    use: str
    began: float
    step: str = ""


class Narrator:
    """The listener of `aatri run`; used as a context, so that its clock stops with the run."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet
        self._live = is_terminal() and not quiet
        self._under_way: dict[str, _UnderWay] = {}
        self._heads: dict[str, str] = {}
        self._expected: Mapping[str, float] = {}
        self._turn = threading.RLock()
        self._ended = threading.Event()
        self._clock = threading.Thread(target=self._tick, daemon=True)

    def __enter__(self) -> Narrator:
        if not self._quiet:
            self._clock.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        if self._clock.is_alive():
            self._clock.join()
        self._overwrite("")

    def planned(self, plan: Plan, expected: Mapping[str, float]) -> None:
        """Say how much there is to do."""
        self._expected = expected
        fresh = sum(d.record is not None for d in plan.decisions)
        if fresh and not self._quiet:
            known = sum(expected.get(d.stage, 0.0) for d in plan.stale)
            about = f", up to {known:.0f} s as before" if known >= 1 else ""
            narrate(f"{fresh} of {len(plan.decisions)} stages are up to date; {len(plan.stale)} to do{about}")

    def started(self, stage: str, use: str, number: int, total: int) -> None:
        """Remember how the line of the stage begins."""
        with self._turn:
            self._heads[stage] = f"[{number:{len(str(total))}}/{total}] {stage}"
            self._under_way[stage] = _UnderWay(self._heads[stage], use, time.monotonic())
            self._show()

    def warned(self, stage: str, message: str) -> None:
        """Warnings are shown even when quiet."""
        self._say(f"warning: {stage}: {message}")

    def advanced(self, stage: str, done: int, total: int, what: str) -> None:
        """Remember the progress; the clock shows it."""
        with self._turn:
            if stage in self._under_way:
                self._under_way[stage].step = f"{what} {done}/{total}".strip()

    def finished(self, record: Mapping[str, Any]) -> None:
        """One line per stage."""
        with self._turn:
            self._under_way.pop(record["stage"], None)
            if not self._quiet:
                self._say(f"{self._heads[record['stage']]}  {record['seconds']:.2f} s  {highlights(record['metrics'])}")

    def failed(self, stage: str, folder: Path) -> None:
        """Say where the log is; the error itself follows at the end."""
        with self._turn:
            self._under_way.pop(stage, None)
            self._say(f"{self._heads[stage]}  failed; log: {folder / 'stage.log'}")

    def _say(self, text: str) -> None:
        with self._turn:
            self._overwrite("")
            narrate(text)
            self._show()

    def _tick(self) -> None:
        while not self._ended.wait(_LIVE_S if self._live else _HEARTBEAT_S):
            with self._turn:
                if self._live:
                    self._show()
                else:
                    for stage in self._under_way:
                        narrate(self._line(stage))

    def _show(self) -> None:
        self._overwrite("; ".join(map(self._line, self._under_way)))

    def _line(self, stage: str) -> str:
        at = self._under_way[stage]
        expected = f" of about {self._expected[stage]:.0f} s" if self._expected.get(stage, 0) >= 1 else ""
        return f"{at.head}: {at.use}  {time.monotonic() - at.began:.0f} s{expected}  {at.step}".rstrip()

    def _overwrite(self, text: str) -> None:
        if self._live:
            typer.echo(f"\r\x1b[K{text[:110]}", nl=False, err=True)
