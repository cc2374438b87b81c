"""Says that a stage compiles a kernel: one that few blocks need is compiled when the first of them comes to it.

Numba announces what it compiles as events `numba:compile`; what it takes from the cache is none.
"""

import time
from collections.abc import Callable
from typing import Any

from numba.core import event


class CompileListener(event.Listener):
    """Tells a sentence for each module of which something is compiled, and s of clock and processor that it took."""

    def __init__(self, tell: Callable[[str], None], took: Callable[[float, float], None]) -> None:
        self._tell, self._took = tell, took
        self._modules: set[str] = set()
        self._under_way = 0  # a function is compiled within that which calls it
        self._began_s, self._began_processor_s = 0.0, 0.0

    def on_start(self, event: Any) -> None:
        """A function is compiled."""
        if not self._under_way:
            self._began_s, self._began_processor_s = time.perf_counter(), time.process_time()
        self._under_way += 1
        module = event.data["dispatcher"].py_func.__module__
        if module not in self._modules:
            self._modules.add(module)
            self._tell(f"compiling {module.rpartition('.')[2]}, once: this block is the first to need it")

    def on_end(self, _event: Any) -> None:
        """It is compiled."""
        self._under_way -= 1
        if not self._under_way:
            self._took(time.perf_counter() - self._began_s, time.process_time() - self._began_processor_s)
