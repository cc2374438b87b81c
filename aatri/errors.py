"""The one error tree of aatri. Every error a user can cause has a class here, and every class an exit code.

A message says what is wrong, where (file:line:column or object id), the value, why, and what to do:
`what` carries the first and the value, `where` the place, `remedy` what to do.

Exit codes
----------
0 ok, 1 internal error, 2 command line or pipeline.yaml, 3 input data, 4 geometry or datum insufficient,
5 not converged, 6 quality gate, 7 artifact integrity, 8 resources (disk, lock, permission), 9 plugin.
"""

from __future__ import annotations

import errno
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

LONGEST = 10_000
"""Longest part of a message, in characters."""


class AatriError(Exception):
    """Base of all errors that are reported without a traceback.

    Parameters
    ----------
    what : str
        What is wrong, with the value.
    where : str, optional
        `file:line:column`, or the id of the object.
    remedy : str, optional
        What the user can do about it.
    """

    exit_code = 1

    def __init__(self, what: str, *, where: str = "", remedy: str = "") -> None:
        self.what, self.where, self.remedy = map(_bounded, (what, where, remedy))
        super().__init__(self.what)

    def __str__(self) -> str:
        text = f"{self.where}: {self.what}" if self.where else self.what
        return f"{text}\n    fix: {self.remedy}" if self.remedy else text


def _bounded(text: str) -> str:
    """The text as UTF-8 has it, and not longer than anybody reads: what is echoed of a file may have any size."""
    if len(text) > LONGEST:
        text = f"{text[: LONGEST // 2]} ... ({len(text) - LONGEST} characters left out) ... {text[-LONGEST // 2 :]}"
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


class SpecError(AatriError, ValueError):
    """The command line or pipeline.yaml is wrong."""

    exit_code = 2


class InputError(AatriError, ValueError):
    """The input data are wrong."""

    exit_code = 3


class GeometryError(AatriError):
    """Geometry or datum do not determine what was asked for; the message names what is open."""

    exit_code = 4


class ConvergenceError(AatriError):
    """An iteration did not converge; no solution is written."""

    exit_code = 5


class GateError(AatriError):
    """The run finished, but a quality gate failed, or a result contradicts its own tests."""

    exit_code = 6


class ArtifactError(AatriError, OSError):
    """An artifact is missing, altered, of the wrong kind or not of its schema."""

    exit_code = 7


class ResourceError(AatriError, OSError):
    """Disk, memory, lock or permission: trying again later makes sense."""

    exit_code = 8


DISK = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO)
"""What the system says where a disk is full, fails or may not be written."""


def lacks_memory(error: BaseException) -> bool:
    """Whether an error says that there is no memory: Python says it of threads in words only."""
    return isinstance(error, MemoryError) or (isinstance(error, RuntimeError) and "start new thread" in str(error))


class PluginError(AatriError):
    """A stage is missing, defined twice or breaks its contract."""

    exit_code = 9


class Errors(AatriError):
    """Several errors found together, reported at once.

    Raises nothing itself; `raise_all` is the way to use it. The exit code is that of the first error.
    """

    def __init__(self, errors: Sequence[AatriError]) -> None:
        self.errors = tuple(errors)
        super().__init__("\n".join(str(error) for error in self.errors))
        self.exit_code = self.errors[0].exit_code

    def __reduce__(self) -> tuple[type[Errors], tuple[Sequence[AatriError]]]:
        return Errors, (self.errors,)


class Faults(list[AatriError]):
    """Errors that are gathered, to be raised together by `raise_all`; most are of one class."""

    def __init__(self, of: type[AatriError] = InputError) -> None:
        super().__init__()
        self._of = of

    def add(self, what: str, where: str = "", remedy: str = "") -> None:
        """Add an error of the class."""
        self.append(self._of(what, where=where, remedy=remedy))

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Keep an error of the class that is raised within, or several at once, in place of going on with it."""
        try:
            yield
        except Errors as several:
            self.extend(several.errors)
        except self._of as error:
            self.append(error)


MOST_SHOWN = 50
"""At most this many errors are shown at once; the rest is counted."""


def raise_all(errors: Sequence[AatriError]) -> None:
    """Raise the error, or all of them as one, if there are any; what was found twice is told once."""
    errors = list({str(error): error for error in errors}.values())
    if len(errors) == 1:
        raise errors[0]
    if errors:
        shown = list(errors[:MOST_SHOWN])
        if len(errors) > MOST_SHOWN:
            shown.append(type(errors[0])(f"... and {len(errors) - MOST_SHOWN} more"))
        raise Errors(shown)
