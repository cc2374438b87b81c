"""How many kernels are compiled: their files in the cache folder, of those that the sources declare.

Kernels are compiled where a method first needs them: most while the pipeline is planned, which imports its methods, the
others within a stage. `Compiling` looks, `shown` tells while a pipeline is planned, and the narrator while stages run.
"""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

INDEX = ".nbi"
"""Ending of the index file that Numba writes for each compiled function."""

_LOOK_S, _LINE_S = 0.5, 10.0


class Compiling:
    """Looks at the folder of compiled kernels and tells while their number grows."""

    def __init__(self) -> None:
        self.ready = found()
        self._total = 0

    def told(self) -> str:
        """`compiling, once: 34 kernels ready of 88 ...` if there are more than at the last look; else empty.

        Those for pairs of sizes are made as sizes come, so that there may be more than are declared.
        """
        before, self.ready = self.ready, found()
        if self.ready <= before:
            return ""
        self._total = self._total or declared()
        of = f" of {self._total} that methods may need" if self.ready <= self._total else ""
        return f"compiling, once: {self.ready} kernels ready{of}"


def found() -> int:
    """Kernels in the cache folder."""
    folder = os.environ.get("NUMBA_CACHE_DIR")
    return sum(1 for _ in Path(folder).rglob(f"*{INDEX}")) if folder else 0


def declared() -> int:
    """Functions that the sources of aatri have compiled."""
    import aatri

    package = Path(aatri.__file__).parent
    sources = [path.read_text(encoding="utf-8") for path in package.glob("**/kernels/*.py")]
    return sum(line.startswith("@njit") for text in sources for line in text.splitlines())


@contextlib.contextmanager
def shown(narrate: Callable[[str], None], *, terminal: bool) -> Iterator[None]:
    """Tell, for as long as it is entered, how many kernels are ready: a line that changes, or one now and then."""
    ended = threading.Event()
    clock = threading.Thread(target=_on_terminal if terminal else _in_lines, args=(ended, narrate), daemon=True)
    clock.start()
    try:
        yield
    finally:
        ended.set()
        clock.join()


def _in_lines(ended: threading.Event, narrate: Callable[[str], None]) -> None:
    compiling = Compiling()
    while not ended.wait(_LINE_S):
        if text := compiling.told():
            narrate(text)


def _on_terminal(ended: threading.Event, narrate: Callable[[str], None]) -> None:  # noqa: ARG001
    compiling, status = Compiling(), None
    with contextlib.ExitStack() as screen:
        while not ended.wait(_LOOK_S):
            if text := compiling.told():
                if status is None:
                    from rich.console import Console

                    status = screen.enter_context(Console(stderr=True, highlight=False).status(text))
                status.update(text)
