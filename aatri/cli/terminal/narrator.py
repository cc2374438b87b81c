"""Tells what happens during a run, on stderr: bars on a terminal (`live`), else a line now and then.

A line per stage that is done and per iteration of a long adjustment; warnings always. While code is compiled, how many
kernels are ready, and at the end of the stage how many there were: its seconds are theirs too.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aatri.cli.terminal.compiling import Compiling, found
from aatri.cli.terminal.console import is_terminal, narrate
from aatri.cli.terminal.figures import highlights

if TYPE_CHECKING:
    from aatri.cli.terminal.live import Live
    from aatri.pipeline.plan.plan import Plan

_LOOK_S, _HEARTBEAT_S = 0.25, 10.0
_COMPILING_S = 6.0
"""So long after the last one compiled a count of kernels is shown; the largest take as long."""
LONG_S = 1.0
"""Iterations of a stage under way for longer are told one by one."""


@dataclass
class _UnderWay:
    """A stage under way."""

    head: str
    use: str
    began: float
    step: str = ""
    ready: int = 0  # kernels compiled when it began


class Narrator:
    """The listener of `aatri run`; used as a context, so that its clock stops with the run."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet
        self._live: Live | None = None
        self._under_way: dict[str, _UnderWay] = {}
        self._heads: dict[str, str] = {}
        self._expected: Mapping[str, float] = {}
        self._turn = threading.RLock()
        self._ended = threading.Event()
        self._compiling = Compiling()
        self._clock = threading.Thread(target=self._tick, daemon=True)

    def __enter__(self) -> Narrator:
        if not self._quiet:
            if is_terminal() and os.environ.get("TERM") != "dumb":
                from aatri.cli.terminal.live import Live

                self._live = Live().__enter__()
            self._clock.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        if self._clock.is_alive():
            self._clock.join()
        if self._live is not None:
            self._live.__exit__()

    def planned(self, plan: Plan, expected: Mapping[str, float]) -> None:
        """Say how much there is to do."""
        self._expected = expected
        fresh = sum(d.record is not None for d in plan.decisions)
        if self._live is not None:
            self._live.planned(fresh, [d.stage for d in plan.stale], expected)
        if fresh and not self._quiet:
            known = sum(expected.get(d.stage, 0.0) for d in plan.stale)
            about = f", up to {known:.0f} s as before" if known >= 1 else ""
            self._say(f"{fresh} of {len(plan.decisions)} stages are up to date; {len(plan.stale)} to do{about}")

    def started(self, stage: str, use: str, number: int, total: int) -> None:
        """Remember how the line of the stage begins."""
        with self._turn:
            self._heads[stage] = f"[{number:{len(str(total))}}/{total}] {stage}"
            self._under_way[stage] = _UnderWay(self._heads[stage], use, time.monotonic(), ready=found())
            if self._live is not None:
                self._live.started(stage, self._heads[stage], self._expected.get(stage, 0.0))

    def warned(self, stage: str, message: str) -> None:
        """Warnings are shown even when quiet."""
        self._say(f"warning: {stage}: {message}", "yellow")

    def advanced(self, stage: str, done: int, total: int, what: str) -> None:
        """Remember the progress; the clock shows it. An iteration of a long adjustment gets a line."""
        with self._turn:
            at = self._under_way.get(stage)
            if at is None:
                return
            at.step = f"{what} {done}/{total}".strip() if total else what
            if self._live is not None:
                self._live.advanced(stage, done, total, what)
            if not total and self._live is not None and time.monotonic() - at.began > LONG_S:
                self._say(f"{at.head}  {what}", "dim")

    def finished(self, record: Mapping[str, Any]) -> None:
        """One line per stage."""
        with self._turn:
            at = self._end(record["stage"])
            if not self._quiet:
                compiled = found() - at.ready if at else 0
                once = f" ({compiled} kernels compiled meanwhile, once)" if compiled > 0 else ""
                head = f"{self._heads[record['stage']]}  {record['seconds']:.2f} s{once}"
                self._say(f"{head}  {highlights(record['metrics'])}")

    def failed(self, stage: str, folder: Path) -> None:
        """Say where the log is; the error itself follows at the end."""
        with self._turn:
            self._end(stage)
            self._say(f"{self._heads[stage]}  failed; log: {folder / 'stage.log'}", "red")

    def _end(self, stage: str) -> _UnderWay | None:
        if self._live is not None:
            self._live.ended(stage)
        return self._under_way.pop(stage, None)

    def _say(self, text: str, style: str = "") -> None:
        with self._turn:
            if self._live is None:
                narrate(text)
            else:
                from aatri.ids import printable

                self._live.line(printable(text), style)

    def _tick(self) -> None:
        line_at, noted, noted_until = time.monotonic() + _HEARTBEAT_S, "", 0.0
        while not self._ended.wait(_LOOK_S):
            now, told = time.monotonic(), self._compiling.told()
            begins = bool(told) and not noted
            if told:
                noted, noted_until = told, now + _COMPILING_S
            elif now >= noted_until:
                noted = ""
            with self._turn:
                if self._live is not None:
                    self._live.tick(noted)
                elif begins or now >= line_at:
                    line_at = now + _HEARTBEAT_S
                    for stage in self._under_way:
                        narrate(self._line(stage, noted))

    def _line(self, stage: str, compiling: str) -> str:
        at = self._under_way[stage]
        expected = f" of about {self._expected[stage]:.0f} s" if self._expected.get(stage, 0) >= 1 else ""
        return f"{at.head}: {at.use}  {time.monotonic() - at.began:.0f} s{expected}  {compiling or at.step}".rstrip()
