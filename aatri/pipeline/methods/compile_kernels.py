"""Compile kernel modules side by side, while the pipeline is planned and its first stages run.

A module is compiled when it is imported. It waits for the kernel modules that it imports itself, so that nothing is
compiled twice; the longest come first. Whatever goes wrong is left to the process that imports the module in the end:
its error is the one to tell.
"""

import contextlib
import importlib
import os
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TypeVar

from aatri.machine import processors
from aatri.pipeline.methods.code_digest import PACKAGE, Code
from aatri.pipeline.methods.helper_process import HelperProcess
from aatri.pipeline.methods.kernel_cache import (
    FEATURES,
    GENERIC,
    PROCESSOR,
    code_of,
    copy_compiled,
    is_compiled,
    use_kernel_cache,
)

PROCESSES = 4
"""More do not help: the chain of modules that wait for each other is a quarter of the work."""

R = TypeVar("R")


def kernels_of(codes: Iterable[Code], *, at_once: bool = False) -> dict[str, Path]:
    """Kernel modules that some stages reach, or that are imported `at_once` with them, with their files."""
    reached = {name: code.files[name] for code in codes for name in (code.at_once if at_once else code.files)}
    return {name: Path(file) for name, file in reached.items() if name.split(".")[-2:-1] == ["kernels"]}


def missing(kernels: Mapping[str, Path]) -> dict[str, Path]:
    """Those that are not compiled yet."""
    return {name: file for name, file in kernels.items() if not is_compiled(name, file)}


def compile_all(folder: Path) -> None:
    """Every kernel module of aatri, compiled for the processor `GENERIC`, into a folder, for a wheel to carry.

    What the cache of this machine has is copied, the rest is compiled into it before.

    Raises
    ------
    Exception
        What stands in the way of a module.
    """
    os.environ |= {PROCESSOR: GENERIC, FEATURES: ""}
    cache = use_kernel_cache()
    kernels = _all_kernels()
    Compilation(missing(kernels)).wait()
    for module in missing(kernels):
        importlib.import_module(module)
    assert cache is not None, "without Numba no module can be imported"
    copy_compiled(kernels, cache, folder)


def _all_kernels() -> dict[str, Path]:
    files = [file for file in PACKAGE.glob("**/kernels/*.py") if file.stem != "__init__"]
    return {".".join(("aatri", *file.relative_to(PACKAGE).with_suffix("").parts)): file for file in files}


def without_compiler(function: Callable[..., R], *arguments: object) -> R:
    """The result of a function in a process of its own that compiles nothing, so that it imports stages at once.

    Raises
    ------
    Exception
        What the function raises.
    """
    with HelperProcess(NUMBA_DISABLE_JIT="1") as helper:
        return helper.call(function, *arguments)


class Compilation:
    """Kernel modules that are being compiled, given with their files; ends with this process at the latest."""

    def __init__(self, kernels: Mapping[str, Path]) -> None:
        self._count, self._under_way, self._changed = len(kernels), set(kernels), threading.Condition()
        self._needs = {name: set(code_of(name, file).files) & set(kernels) - {name} for name, file in kernels.items()}
        self._waiting = sorted(kernels, key=lambda name: -kernels[name].stat().st_size)
        for _ in range(min(PROCESSES, processors(), len(kernels))):
            threading.Thread(target=self._work, daemon=True).start()

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

    def _work(self) -> None:
        """Compile one module after the other in a process, until there are no more."""
        try:
            with HelperProcess() as helper:
                while (name := self._next()) is not None:
                    with contextlib.suppress(Exception):
                        helper.call(_compile, name)
                    self._end({name})
        except OSError:  # no process can be started
            self._waiting.clear()
            self._end(set(self._under_way))

    def _end(self, modules: set[str]) -> None:
        with self._changed:
            self._under_way -= modules
            self._changed.notify_all()

    def _next(self) -> str | None:
        """The longest module that waits for no other, as soon as there is one; None if all have been taken."""

        def ready() -> list[str]:
            return [name for name in self._waiting if not self._needs[name] & self._under_way]

        with self._changed:
            self._changed.wait_for(lambda: ready() or not self._waiting)
            if not self._waiting:
                return None
            self._waiting.remove(name := ready()[0])
            return name


def _compile(module: str) -> None:
    """Import a module; what runs meanwhile, and who types, come first."""
    with contextlib.suppress(AttributeError, OSError):
        os.nice(5 - os.nice(0))
    importlib.import_module(module)
