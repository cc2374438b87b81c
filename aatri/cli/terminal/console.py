"""What the verbs print: data on stdout, narration and errors on stderr; errors become exit codes here and nowhere else.

Nothing heavy is imported at the top of any file of this folder, so that `aatri --help` answers at once.
"""

import errno
import functools
import json
import os
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import typer

from aatri.errors import DISK, AatriError, Errors, ResourceError, SpecError, lacks_memory
from aatri.ids import clipped

P = ParamSpec("P")
T = TypeVar("T")

INTERRUPTED, PIPE_CLOSED = 130, 141

PROGRESS_S = 3.0
"""Seconds between two lines that say how far something is."""


def reports_errors(verb: Callable[P, T]) -> Callable[P, T]:
    """Let a verb end with a message and the exit code of its error; with `debug=True` also a traceback."""

    @functools.wraps(verb)
    def guarded(*args: P.args, **kwargs: P.kwargs) -> T:
        try:
            return verb(*args, **kwargs)
        except typer.Exit:
            raise
        except BrokenPipeError:  # a closed pipe, as by `| head`, is the caller's wish
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(PIPE_CLOSED) from None
        except KeyboardInterrupt:
            narrate("interrupted")
            raise typer.Exit(INTERRUPTED) from None
        except AatriError as error:
            if kwargs.get("debug"):
                narrate(traceback.format_exc())
            report_error(error)
            raise typer.Exit(error.exit_code) from None
        except Exception as error:
            if kwargs.get("debug"):
                narrate(traceback.format_exc())
            if lacks_memory(error):
                report_error(ResourceError("out of memory", remedy="a machine with more memory, or a smaller block"))
                raise typer.Exit(ResourceError.exit_code) from None
            if isinstance(error, OSError) and error.errno in (errno.ENAMETOOLONG, errno.EINVAL):
                report_error(
                    SpecError(f"no file can have this name: {error.strerror}", where=clipped(str(error.filename or "")))
                )
                raise typer.Exit(SpecError.exit_code) from None
            if isinstance(error, OSError) and error.errno in DISK:
                report_error(ResourceError(str(error.strerror), where=str(error.filename or "")))
                raise typer.Exit(ResourceError.exit_code) from None
            narrate(f"error: internal error (a bug): {type(error).__name__}: {error}")
            raise typer.Exit(1) from None

    return guarded


def report_error(error: AatriError) -> None:
    """Print an error, or each of several."""
    for single in error.errors if isinstance(error, Errors) else (error,):
        narrate(f"error: {single}")


def say(text: str = "") -> None:
    """Print data."""
    typer.echo(_escaped(text))


def narrate(text: str) -> None:
    """Print what is not data; where it has no place to go, as after `2>&1 | head` or on a full disk, work goes on."""
    try:
        typer.echo(_escaped(text), err=not in_notebook())  # what goes to stderr is red in a notebook
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())


class Narrated:
    """A reporter whose lines are narrated."""

    def __init__(self) -> None:
        self._last_s = time.monotonic()

    def log(self, message: str) -> None:
        """Tell a line."""
        narrate(message)

    def warn(self, message: str) -> None:
        """Tell a line that the user must see."""
        narrate(f"warning: {message}")

    def progress(self, done: int, total: int, what: str = "") -> None:
        """Tell how far it is, now and then."""
        if time.monotonic() - self._last_s > PROGRESS_S:
            self._last_s = time.monotonic()
            narrate(f"{what} {done} of {total}".strip() if total else what)


NARRATED = Narrated()


def say_json(value: Any) -> None:
    """Print data as JSON."""
    text = json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False)
    # what drives a terminal is escaped as JSON does it: the value stays the same
    typer.echo("".join(sign if sign.isprintable() or sign == "\n" else json.dumps(sign)[1:-1] for sign in text))


def say_table(head: Sequence[str], rows: Sequence[Sequence[str]], numbers: Sequence[str] = ()) -> None:
    """Print a table with aligned columns; those named in `numbers` to the right."""
    cells = [[_escaped(cell).replace("\n", " ") for cell in row] for row in (head, *rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(head))]
    for row in cells:
        aligned = [c.rjust(w) if name in numbers else c.ljust(w) for c, w, name in zip(row, widths, head)]
        typer.echo("  ".join(aligned).rstrip())


def show_in_browser(page: Path) -> None:
    """Open a page; where there is no browser, say so and where the page lies."""
    import webbrowser

    if not webbrowser.open(page.resolve().as_uri()):
        narrate(f"no browser to open; the report is {page}")


def in_notebook() -> bool:
    """Whether this process computes the cells of a notebook."""
    shell = sys.modules.get("IPython")
    return "ipykernel" in sys.modules and shell is not None and shell.get_ipython() is not None


def is_terminal() -> bool:
    """Whether narration goes to a terminal."""
    return sys.stderr.isatty()


def _escaped(text: str) -> str:
    if text.isascii() and text.replace("\n", "").isprintable():
        return text
    from aatri.ids import printable

    return "\n".join(printable(line) for line in text.split("\n"))
