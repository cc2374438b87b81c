"""One writer per run: a lock of the kernel's on RUN/.lock, which dies with the process that holds it.

The file is opened without being emptied, its owner written only once the lock is held, and it is never removed: else
two processes could hold locks on two files of one name. `aatri run` locks the run for itself; `aatri exec` shares it
with others and locks its stage. Readers take no lock. The package filelock would not do: it empties the file while it
asks for the lock, and so the name of who holds it, and it has no lock that can be shared.
"""

import contextlib
import errno
import json
import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from aatri.errors import ResourceError
from aatri.pipeline.store import inside
from aatri.pipeline.store.inside import on_disk
from aatri.pipeline.store.objects import base_of
from aatri.pipeline.store.provenance import now
from aatri.pipeline.store.records import read_json

_BUSY = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)
_NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.ENOTSUP)


@contextlib.contextmanager
def locked(run: Path, command: str, *, stage: str = "", enabled: bool = True) -> Iterator[None]:
    """Hold the lock of a run, or share it and hold that of one of its stages.

    Raises
    ------
    ResourceError
        If another process holds it, or the file system has no locks.
    """
    if not enabled:
        yield
        return
    base = base_of(run)
    with contextlib.ExitStack() as locks:
        with on_disk(base):
            inside.make_folder(base)
        locks.enter_context(_held(base, ".lock", command=command, shared=bool(stage)))
        if stage:
            with on_disk(base):
                inside.make_folder(base, "running")
            locks.enter_context(_held(base, "running", f".{stage}.lock", command=command, shared=False))
        yield


@contextlib.contextmanager
def _held(base: Path, *names: str, command: str, shared: bool) -> Iterator[None]:
    with on_disk(base):
        path, handle = inside.path_of(base, *names), inside.open_kept(base, *names)
    try:
        try:
            _lock(handle, shared=shared)
        except OSError as error:
            if error.errno in _BUSY:
                raise ResourceError(
                    _busy(base, *names), where=str(path.parent), remedy="wait until it ends, or use --into DIR"
                ) from error
            if error.errno in _NO_LOCKS:
                raise ResourceError(
                    f"this file system has no locks ({error.strerror})",
                    where=str(path),
                    remedy="--no-lock, if surely nothing else writes there",
                ) from error
            raise ResourceError(f"cannot be locked: {error.strerror}", where=str(path)) from error
        if not shared:
            owner = {"pid": os.getpid(), "host": platform.node(), "command": command, "since": now()}
            with contextlib.suppress(OSError):  # the text is for the message only: a full disk must not matter
                os.ftruncate(handle, 0)
                os.pwrite(handle, json.dumps(owner).encode(), 0) if hasattr(os, "pwrite") else None
        yield
    finally:
        with contextlib.suppress(OSError):
            os.close(handle)  # this frees the lock


def _busy(base: Path, *names: str) -> str:
    owner: dict[str, Any] = {}
    with contextlib.suppress(OSError):
        owner = read_json(base, *names) or {}
    if not {"command", "pid", "host", "since"} <= owner.keys():
        return "another process writes there"
    return f"busy: {owner['command']}, process {owner['pid']} on {owner['host']}, writes there since {owner['since']}"


if sys.platform == "win32":  # pragma: no cover - tried on Windows only
    import msvcrt

    def _lock(handle: int, *, shared: bool) -> None:
        if shared:
            return  # there is no shared lock: stages are kept apart by their own
        os.lseek(handle, 1 << 30, os.SEEK_SET)  # beyond the text, which others must be able to read
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(handle: int, *, shared: bool) -> None:
        fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
