"""A Python process beside this one that calls functions for it.

Processes of `multiprocessing` first import the script that runs here, and so run it again where it is not guarded by
`if __name__ == "__main__"`; this one imports nothing but what the function needs. Functions, arguments, results and
exceptions are pickled; errors of classes of plugins, which the other process may not know, as errors that it does.
What the function prints goes to stderr.
"""

from __future__ import annotations

import atexit
import gc
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from aatri.errors import AatriError, ResourceError

R = TypeVar("R")

_SERVE = "from aatri.pipeline.methods.helper_process import serve; serve()"


class HelperProcess:
    """A process that answers one call after the other; used as a context, it ends with it, at the latest with this one.

    Parameters
    ----------
    environment : {name: value}
        Set in the process beside what is set here.
    """

    def __init__(self, **environment: str) -> None:
        path = os.pathsep.join(entry or str(Path.cwd()) for entry in sys.path)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", _SERVE],  # -P: nothing is imported from the folder where it happens to run
            env={**os.environ, "PYTHONPATH": path, **environment},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        atexit.register(self._process.kill)

    def __enter__(self) -> HelperProcess:
        return self

    def __exit__(self, *_: object) -> None:
        atexit.unregister(self._process.kill)
        self._process.kill()
        self._process.communicate()

    def call(self, function: Callable[..., R], *arguments: object) -> R:
        """The result of a function of a module.

        Raises
        ------
        ResourceError
            If the process has ended.
        Exception
            What the function raises.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            pickle.dump((function, arguments), self._process.stdin)
            self._process.stdin.flush()
            raised, answer = pickle.load(self._process.stdout)
        except (EOFError, BrokenPipeError) as error:
            raise ResourceError(
                "a process that helps this one was ended from outside, perhaps for lack of memory",
                remedy="a machine with more memory",
            ) from error
        if raised:
            raise answer
        result: R = answer
        return result


def serve() -> None:
    """Answer calls from stdin on stdout until it is closed; interrupts are the business of who calls.

    What imports and compiles makes millions of objects and no garbage worth collecting: without the collector importing
    takes a tenth less, compiling a sixth.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.disable()
    with os.fdopen(os.dup(0), "rb") as calls, os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)
        while True:
            try:
                function, arguments = pickle.load(calls)
            except EOFError:
                return
            _Answers(answers).dump(_answer(function, arguments))
            answers.flush()


class _Answers(pickle.Pickler):
    """Pickles answers; errors in them, wherever they stand, as classes of aatri or Python."""

    def reducer_override(self, part: object) -> Any:
        """How an error of another class is made again: a module or parameters of its own may be missing there."""
        if not isinstance(part, Exception) or _is_known(type(part)):
            return NotImplemented
        if not isinstance(part, AatriError):
            return RuntimeError, (f"{type(part).__name__}: {part}",)
        base_class = next(c for c in type(part).__mro__ if _is_known(c))
        return _again, (base_class, part.what, part.where, part.remedy, part.exit_code)


def _is_known(of: type) -> bool:
    return of.__module__ == "builtins" or of.__module__.split(".")[0] == "aatri"


def _again(of: type[AatriError], what: str, where: str, remedy: str, exit_code: int) -> AatriError:
    error = of(what, where=where, remedy=remedy)
    error.exit_code = exit_code
    return error


def _answer(function: Callable[..., Any], arguments: tuple[Any, ...]) -> tuple[bool, Any]:
    try:
        return False, function(*arguments)
    except Exception as error:
        return True, error
