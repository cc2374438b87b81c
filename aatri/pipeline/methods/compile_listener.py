"""Says that a stage compiles a kernel: one that few blocks need is compiled when the first of them comes to it.

Numba announces what it compiles as events `numba:compile`; what it takes from the cache is none.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core import event


class CompileListener(event.Listener):
    """Tells a sentence for each module of which something is compiled."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._modules: set[str] = set()

    def on_start(self, event: Any) -> None:
        """A function is compiled."""
        module = event.data["dispatcher"].py_func.__module__
        if module not in self._modules:
            self._modules.add(module)
            self._tell(f"compiling {module.rpartition('.')[2]}, once: this block is the first to need it")

    def on_end(self, event: Any) -> None:
        """It is compiled."""
