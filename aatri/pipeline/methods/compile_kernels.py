"""Compile kernel modules side by side, before any is needed: a module is compiled when it is imported.

A module waits for the kernel modules that it imports, so that nothing is compiled twice; the longest come first.
The compiler makes millions of objects and no garbage worth collecting: without the collector it takes a sixth less.
Whatever goes wrong is left to the process that imports the module in the end: its error is the one to tell.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import multiprocessing
import os
from collections.abc import Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from pathlib import Path

from aatri.pipeline.methods.code_digest import Code
from aatri.pipeline.methods.kernel_cache import code_of, is_compiled

PROCESSES = 4
"""More do not help: the chain of modules that wait for each other is a quarter of the work."""


def kernels_of(codes: Iterable[Code]) -> dict[str, Path]:
    """Kernel modules that some stages reach, with their files."""
    reached = {name: Path(file) for code in codes for name, file in code.files.items()}
    return {name: file for name, file in reached.items() if file.parent.name == "kernels"}


def missing(kernels: Mapping[str, Path]) -> dict[str, Path]:
    """Those that are not compiled yet."""
    return {name: file for name, file in kernels.items() if not is_compiled(name, file)}


def compile_side_by_side(kernels: Mapping[str, Path]) -> None:
    """Compile kernel modules, given with their files."""
    needs = {name: set(code_of(name, file).files) & set(kernels) - {name} for name, file in kernels.items()}
    waiting = sorted(kernels, key=lambda name: -kernels[name].stat().st_size)
    under_way: dict[Future[None], str] = {}
    processes = min(PROCESSES, os.cpu_count() or 1, len(waiting))
    with ProcessPoolExecutor(
        processes, mp_context=multiprocessing.get_context("spawn"), initializer=gc.disable
    ) as pool:
        while waiting or under_way:
            unfinished = {*waiting, *under_way.values()}
            ready = [name for name in waiting if not needs[name] & unfinished]
            for name in ready[: processes - len(under_way)]:
                waiting.remove(name)
                under_way[pool.submit(_compile, name)] = name
            for done in wait(under_way, return_when=FIRST_COMPLETED).done:
                del under_way[done]


def _compile(module: str) -> None:
    with contextlib.suppress(Exception):
        importlib.import_module(module)
