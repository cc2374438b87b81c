"""Files that are written: each whole, or as it was."""

import os
from collections.abc import Mapping
from pathlib import Path

from aatri.errors import ResourceError


def write_files(folder: Path, texts: Mapping[str, str | bytes]) -> None:
    """Write files into a folder, which is made if it is not there; each is there whole, or as it was.

    Parameters
    ----------
    texts : mapping of str to str or bytes
        Content by path within the folder.

    Raises
    ------
    ResourceError
        If one cannot be written.
    """
    path = folder
    try:
        for name, content in texts.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            part = path.with_name(f".{path.name}.part")
            with part.open("wb") as file:
                file.write(content if isinstance(content, bytes) else content.encode("utf-8"))
                file.flush()
                os.fsync(file.fileno())  # else a power cut after the renaming leaves an empty file
            part.replace(path)
    except OSError as error:
        raise ResourceError(f"cannot write: {error.strerror}", where=str(path), remedy="another place") from error
