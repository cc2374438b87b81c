"""Tells what happens during a run, on stderr: bars on a terminal (`live`), else a line now and then.

A line per stage that is done and per iteration of a long adjustment; warnings always; while code is compiled, how far
that is.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aatri.cli.terminal.console import in_notebook, is_terminal, narrate
from aatri.cli.terminal.figures import highlights

if TYPE_CHECKING:
    from aatri.cli.terminal.live import Live
    from aatri.pipeline.methods.compile_kernels import Compilation
    from aatri.pipeline.plan.decisions import Plan

_LOOK_S, _HEARTBEAT_S = 0.25, 10.0
LONG_S = 1.0
"""Iterations of a stage under way for longer are told one by one."""


@dataclass
class _UnderWay:
    """A stage under way."""

    head: str
    use: str
    began: float
    step: str = ""


class Narrator:
    """The listener of `aatri run`; used as a context, so that its clock stops with the run.

    Parameters
    ----------
    quiet : bool
        Only warnings are told.
    verbose : bool
        What stages write to their logs is told too.
    compilation : Compilation, optional
        Told as long as it goes on.
    """

    def __init__(self, quiet: bool, compilation: Compilation | None = None, *, verbose: bool = False) -> None:
        self._quiet, self._compilation, self._verbose = quiet, compilation, verbose
        self.warnings: list[tuple[str, str]] = []
        self._live: Live | None = None
        self._under_way: dict[str, _UnderWay] = {}
        self._heads: dict[str, str] = {}
        self._expected: Mapping[str, float] = {}
        self._turn = threading.RLock()
        self._ended = threading.Event()
        self._clock = threading.Thread(target=self._tick, daemon=True)

    def __enter__(self) -> Narrator:
        if not self._quiet:
            if in_notebook():
                from aatri.cli.terminal.notebook import NotebookBars

                self._live = NotebookBars().__enter__()
            elif is_terminal() and os.environ.get("TERM") != "dumb":
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
            expected_s = sum(expected.get(d.stage, 0.0) for d in plan.stale)
            about = f", up to {expected_s:.0f} s as before" if expected_s >= 1 else ""
            self._say(f"{fresh} of {len(plan.decisions)} stages are up to date; {len(plan.stale)} to do{about}")

    def started(self, stage: str, use: str, number: int, total: int) -> None:
        """Remember how the line of the stage begins."""
        with self._turn:
            self._heads[stage] = f"[{number:{len(str(total))}}/{total}] {stage}"
            self._under_way[stage] = _UnderWay(self._heads[stage], use, time.monotonic())
            if self._live is not None:
                self._live.started(stage, self._heads[stage], self._expected.get(stage, 0.0))

    def logged(self, stage: str, message: str) -> None:
        """A line of a log, where they are asked for."""
        if self._verbose:
            self._say(f"{stage}: {message}", "dim")

    def warned(self, stage: str, message: str) -> None:
        """Warnings are shown even when quiet."""
        self.warnings.append((stage, message))
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
            self._end(record["stage"])
            if not self._quiet:
                head = f"{self._heads[record['stage']]}  {record['seconds']:.2f} s"
                self._say(f"{head}  {highlights(record['metrics'])}")

    def failed(self, stage: str, folder: Path) -> None:
        """Say where the log is; the error itself follows at the end."""
        with self._turn:
            self._end(stage)
            self._say(f"{self._heads[stage]}  failed; log: {folder / 'stage.log'}", "red")

    def _end(self, stage: str) -> None:
        if self._live is not None:
            self._live.ended(stage)
        self._under_way.pop(stage, None)

    def _say(self, text: str, style: str = "") -> None:
        with self._turn:
            if self._live is None:
                narrate(text)
            else:
                from aatri.ids import printable

                self._live.line(printable(text), style)

    def _tick(self) -> None:
        line_at = time.monotonic() + _HEARTBEAT_S
        while not self._ended.wait(_LOOK_S):
            with self._turn:
                if self._live is not None:
                    self._live.tick(self._compiling())
                elif time.monotonic() >= line_at:
                    line_at = time.monotonic() + _HEARTBEAT_S
                    for stage in self._under_way:
                        narrate(self._line(stage))

    def _compiling(self) -> str:
        return self._compilation.progress() if self._compilation else ""

    def _line(self, stage: str) -> str:
        at = self._under_way[stage]
        expected = f" of about {self._expected[stage]:.0f} s" if self._expected.get(stage, 0) >= 1 else ""
        step = self._compiling() or at.step
        return f"{at.head}: {at.use}  {time.monotonic() - at.began:.0f} s{expected}  {step}".rstrip()
