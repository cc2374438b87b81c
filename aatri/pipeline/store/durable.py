"""Writing that a crash at any moment survives: the old state or the new one, never a half.

A file appears under a temporary name in its folder, is closed, brought to the disk (fsync), renamed, and its folder
brought to the disk. Temporary names carry the process that writes, so that those of dead processes can be swept.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from aatri.errors import ArtifactError, ResourceError

_PREFIX = ".tmp-"


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file atomically."""
    write_bytes(path, (json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode("utf-8"))


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file atomically."""
    temporary = temporary_name(path)
    try:
        temporary.write_bytes(data)
        sync(temporary)
        temporary.replace(path)
        sync(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def read_json(path: Path) -> dict[str, Any] | None:
    """A JSON file of the store; None if there is none.

    Raises
    ------
    ArtifactError
        If it is damaged.
    """
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        raise ArtifactError(f"not readable: {error}", where=str(path), remedy="aatri run writes it again") from error
    if not isinstance(value, dict):
        raise ArtifactError("not a record", where=str(path), remedy="aatri run writes it again")
    return value


def temporary_name(path: Path) -> Path:
    """A new name beside a path, which says which process writes there."""
    return path.with_name(f"{_PREFIX}{path.stem}-{os.getpid()}-{secrets.token_hex(4)}{path.suffix}")


def sync(path: Path) -> None:
    """Bring a file or folder to the disk; some systems cannot open a folder for that."""
    try:
        handle = os.open(path, os.O_RDONLY)
    except PermissionError:
        if path.is_dir():
            return
        raise
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def sweep(folder: Path) -> None:
    """Remove what dead processes left half-written below a folder."""
    for path in folder.rglob(f"{_PREFIX}*"):
        owner = path.stem.split("-")[-2:-1]
        if owner and owner[0].isdigit() and not is_alive(int(owner[0])):
            path.unlink(missing_ok=True)


def is_alive(pid: int) -> bool:
    """Whether a process of this machine runs; this one does not count as a rival of itself."""
    if pid == os.getpid():
        return True
    if os.name == "nt":  # pragma: no cover - signal 0 would end the process there
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


@contextlib.contextmanager
def on_disk(where: Path) -> Iterator[None]:
    """Turn the operating system's errors into ours."""
    try:
        yield
    except (ArtifactError, ResourceError):
        raise
    except OSError as error:
        raise ResourceError(f"cannot write: {error.strerror or error}", where=str(error.filename or where),
                            remedy="free space, check the permission, or use --into DIR") from error  # fmt: skip
