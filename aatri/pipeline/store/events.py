"""RUN/events.jsonl: what happened, one JSON line each, only ever appended to.

A line goes out in one write; a crash can leave the last one unfinished, which reading passes over and the next writer
ends with a new line.
"""

import json
import os
from pathlib import Path
from typing import Any

from aatri.pipeline.store import inside
from aatri.pipeline.store.inside import on_disk
from aatri.pipeline.store.provenance import now


class Events:
    """The events of a run, open for appending."""

    def __init__(self, run: Path) -> None:
        self._path = run / "events.jsonl"
        with on_disk(self._path):
            self._handle = inside.open_kept(run, "events.jsonl", flags=os.O_APPEND)
            size = os.fstat(self._handle).st_size
            if size and _last_byte(self._handle, size) != b"\n":
                os.write(self._handle, b"\n")

    def add(self, event: str, **about: Any) -> None:
        """Append an event."""
        line = json.dumps({"time": now(), "event": event, **about}, ensure_ascii=False, allow_nan=False)
        with on_disk(self._path):
            os.write(self._handle, f"{line}\n".encode("utf-8", "backslashreplace"))

    def close(self) -> None:
        """Bring the lines to the disk."""
        try:
            with on_disk(self._path):
                os.fsync(self._handle)
        finally:
            with on_disk(self._path):
                os.close(self._handle)


def _last_byte(handle: int, size: int) -> bytes:
    os.lseek(handle, size - 1, os.SEEK_SET)
    return os.read(handle, 1)
