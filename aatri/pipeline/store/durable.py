"""Writing that a crash at any moment survives: the old state or the new one, never a half.

A file appears under a temporary name in its folder, is closed, brought to the disk (fsync), renamed, and its folder
brought to the disk. Temporary names carry the process that writes, so that those of dead processes can be swept
(`inside`).
"""

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from aatri.errors import ArtifactError, ResourceError
from aatri.pipeline.store import inside


def write_json(value: Any, run: Path, *names: str) -> None:
    """Write a JSON file of a run atomically."""
    inside.write((json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode("utf-8"), run, *names)


@contextlib.contextmanager
def on_disk(where: Path) -> Iterator[None]:
    """Turn the operating system's errors into ours."""
    try:
        yield
    except (ArtifactError, ResourceError):
        raise
    except OSError as error:
        raise ResourceError(
            f"cannot write: {error.strerror or error}",
            where=str(error.filename or where),
            remedy="free space, check the permission, or use --into DIR",
        ) from error
