"""What a stage under way talks to: its log, the listener of the run, and its checkpoint.

    RUN/checkpoints/STAGE/KEY/NAME.npz      SHA-256 of what follows, then the arrays

A checkpoint belongs to the key of the stage: whatever changes the result also parts it from older checkpoints. It is
written atomically, trusted only if whole, and removed once the result is there. One that cannot be written is warned
of and left out: the stage itself may still come to its end.
"""

import contextlib
import hashlib
import io
import re
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import numpy.typing as npt

from aatri.ids import utf8
from aatri.pipeline.run.items import ItemStore, KeptItem
from aatri.pipeline.store import inside
from aatri.pipeline.store.objects import base_of
from aatri.progress import Item, Workers

_NAME = re.compile(r"[A-Za-z0-9_-]+")
_DIGEST_BYTES = 32

Tell = Callable[..., None]
"""Takes an event of a stage: `logged` and `warned` with the message, `advanced` with done, total, what."""


class LoggedContext:
    """Everything goes to the log, warnings also to the record and the listener."""

    def __init__(
        self, log: TextIO, tell: Tell, run: Path, stage: str, key: str, cluster: Callable[..., Workers] | None = None
    ) -> None:
        self._file, self._tell, self._clock = log, tell, time.perf_counter()
        self.warnings: list[str] = []
        self.checkpoint = FileCheckpoint(self, base_of(run), "checkpoints", stage, key)
        self.workers = None if cluster is None else cluster(base_of(run), "checkpoints", stage, key)
        self._items = ItemStore(base_of(run), stage)

    def log(self, message: str) -> None:
        """Write a line to the log, with the seconds since the start."""
        self._write(message)
        self._tell("logged", utf8(message))

    def _write(self, message: str) -> None:
        self._file.write(f"{time.perf_counter() - self._clock:9.3f}  {utf8(message)}\n")
        self._file.flush()

    def warn(self, message: str) -> None:
        """Keep a warning."""
        message = utf8(message)
        self.warnings.append(message)
        self._write(f"warning: {message}")
        self._tell("warned", message)

    def progress(self, done: int, total: int, what: str = "") -> None:
        """Pass on how far the stage is."""
        self._tell("advanced", int(done), int(total), what)

    def mapped(self, function: Callable[..., Any], items: Sequence[Item], kind: type[Any], what: str) -> list[KeptItem]:
        """The results of many items of work, kept one by one."""
        return self._items.results(function, items, kind, what, self)


class FileCheckpoint:
    """Arrays in files of one folder of a run."""

    every_s = 60.0

    def __init__(self, context: LoggedContext, base: Path, *names: str) -> None:
        self._context, self._base, self._names, self._numbers = context, base, names, Counter[str]()

    def numbered(self, name: str) -> str:
        """The name with how often it was asked for."""
        self._numbers[name] += 1
        return f"{name}-{self._numbers[name]}"

    def save(self, name: str, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
        """Keep arrays under a name, in place of those kept before; whole or not at all."""
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, **{key: np.asarray(value) for key, value in arrays.items()})
        data = buffer.getvalue()
        at = self._at(name)
        try:
            inside.make_folder(self._base, *self._names)
            inside.write(hashlib.sha256(data).digest() + data, self._base, *at)
        except OSError as error:
            self._context.log(f"no checkpoint {name}: {error.strerror or error}")

    def load(self, name: str) -> dict[str, npt.NDArray[Any]] | None:
        """The arrays kept by an earlier attempt at the same result; None if there are none that are whole."""
        at = self._at(name)
        try:
            content = inside.file_path(self._base, *at).read_bytes()
        except OSError:
            return None
        digest, data = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
        if hashlib.sha256(data).digest() != digest:
            self._context.log(f"checkpoint {name} is damaged and not used")
            return None
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            self._context.log(f"going on from checkpoint {name}")
            return dict(arrays)

    def _at(self, name: str) -> tuple[str, ...]:
        if not _NAME.fullmatch(name):
            raise ValueError(f"name of a checkpoint: {name!r}")
        return (*self._names, f"{name}.npz")


def drop_checkpoints(run: Path, stage: str) -> None:
    """Remove the checkpoints of a stage whose result is there."""
    with contextlib.suppress(OSError):
        inside.remove_folder(base_of(run), "checkpoints", stage)
