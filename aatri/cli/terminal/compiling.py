"""Tells how many kernel modules are compiled while a verb waits for them; while stages run the narrator tells it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from aatri.pipeline.methods.compile_kernels import Compilation

_LOOK_S, _LINE_S = 0.5, 10.0


def wait_for(compilation: Compilation, narrate: Callable[[str], None], *, terminal: bool) -> None:
    """Wait until all is compiled, and tell how far it is: a line that changes, or one now and then."""
    if not terminal:
        while not compilation.wait(timeout_s=_LINE_S):
            narrate(compilation.progress())
        return
    from rich.console import Console

    with Console(stderr=True, highlight=False).status(compilation.progress()) as status:
        while not compilation.wait(timeout_s=_LOOK_S):
            status.update(compilation.progress())
