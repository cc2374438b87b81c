"""Compile kernel modules side by side, while the pipeline is planned and its first stages run.

A module is compiled when it is imported. It waits for the kernel modules that it imports itself, so that nothing is
compiled twice; the longest come first. The compiler makes millions of objects and no garbage worth collecting: without
the collector it takes a sixth less. Whatever goes wrong is left to the process that imports the module in the end: its
error is the one to tell.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import multiprocessing
import os
import threading
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.pool import AsyncResult
from pathlib import Path
from typing import TypeVar

from aatri.pipeline.methods.code_digest import PACKAGE, Code
from aatri.pipeline.methods.kernel_cache import (
    FEATURES,
    GENERIC,
    PROCESSOR,
    VARIABLE,
    code_of,
    is_compiled,
    use_kernel_cache,
)

PROCESSES = 4
"""More do not help: the chain of modules that wait for each other is a quarter of the work."""

_LOOK_S = 0.02

R = TypeVar("R")


def kernels_of(codes: Iterable[Code]) -> dict[str, Path]:
    """Kernel modules that some stages reach, with their files."""
    reached = {name: Path(file) for code in codes for name, file in code.files.items()}
    return {name: file for name, file in reached.items() if file.parent.name == "kernels"}


def missing(kernels: Mapping[str, Path]) -> dict[str, Path]:
    """Those that are not compiled yet."""
    return {name: file for name, file in kernels.items() if not is_compiled(name, file)}


def compile_all(folder: Path) -> None:
    """Compile every kernel module of aatri for the processor `GENERIC` into a folder, for a wheel to carry.

    Raises
    ------
    Exception
        What stands in the way of a module.
    """
    os.environ |= {VARIABLE: str(folder), PROCESSOR: GENERIC, FEATURES: ""}
    use_kernel_cache()
    files = [file for file in PACKAGE.glob("**/kernels/*.py") if file.stem != "__init__"]
    kernels = {".".join(("aatri", *file.relative_to(PACKAGE).with_suffix("").parts)): file for file in files}
    Compilation(kernels).wait()
    for module in missing(kernels):
        importlib.import_module(module)


def without_compiler(function: Callable[..., R], *arguments: object) -> R:
    """The result of a function in a process of its own that compiles nothing, so that it imports stages at once.

    Raises
    ------
    Exception
        What the function raises.
    """
    spawned = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawned, initializer=_disable_compiler) as pool:
        return pool.submit(function, *arguments).result()


def _disable_compiler() -> None:
    os.environ["NUMBA_DISABLE_JIT"] = "1"


class Compilation:
    """Kernel modules that are being compiled, given with their files; ends with this process at the latest."""

    def __init__(self, kernels: Mapping[str, Path]) -> None:
        self._count, self._under_way, self._changed = len(kernels), set(kernels), threading.Condition()
        threading.Thread(target=self._run, args=(kernels,), daemon=True).start()

    def wait(self, modules: Iterable[str] | None = None, timeout_s: float | None = None) -> bool:
        """Come back when some modules are compiled, by default all, or after some seconds; says whether they are."""
        needed = None if modules is None else set(modules)
        with self._changed:
            return self._changed.wait_for(
                lambda: not (self._under_way if needed is None else self._under_way & needed), timeout_s
            )

    def progress(self) -> str:
        """`compiling, once: 12 of 34 modules ready`; empty when all are."""
        left = len(self._under_way)
        return f"compiling, once: {self._count - left} of {self._count} modules ready" if left else ""

    def _run(self, kernels: Mapping[str, Path]) -> None:
        needs = {name: set(code_of(name, file).files) & set(kernels) - {name} for name, file in kernels.items()}
        waiting = sorted(kernels, key=lambda name: -kernels[name].stat().st_size)
        processes = min(PROCESSES, os.cpu_count() or 1, len(waiting))
        begun: dict[str, AsyncResult[None]] = {}
        with contextlib.ExitStack() as ending:
            ending.callback(self._end, set(kernels))
            pool = ending.enter_context(multiprocessing.get_context("spawn").Pool(processes, initializer=_as_compiler))
            while waiting or begun:
                for name in [name for name in waiting if not needs[name] & self._under_way][: processes - len(begun)]:
                    waiting.remove(name)
                    begun[name] = pool.apply_async(_compile, (name,))
                ended = {name for name, result in begun.items() if result.ready()}
                begun = {name: result for name, result in begun.items() if name not in ended}
                self._end(ended)
                threading.Event().wait(0.0 if ended else _LOOK_S)

    def _end(self, modules: set[str]) -> None:
        with self._changed:
            self._under_way -= modules
            self._changed.notify_all()


def _as_compiler() -> None:
    """What runs meanwhile, and who types, come first."""
    gc.disable()
    with contextlib.suppress(AttributeError, OSError):
        os.nice(5)


def _compile(module: str) -> None:
    with contextlib.suppress(Exception):
        importlib.import_module(module)
