"""What can be computed again but costs time: kept in the user's cache folder, never in a run.

A cache is one JSON file that is read whole and replaced whole; of two writers at once the later wins, and what the
other had found is found again. A damaged or unwritable cache is as good as an empty one.

A file's digest is trusted as long as its size, times and inode are those seen when it was computed, and it was not
changed so shortly before that a second change within the clock's grain could have gone unseen. That of a file just
written is known without reading it again; it is trusted where file times are finer than seconds.
"""

import contextlib
import functools
import hashlib
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from aatri.pipeline.store.inside import temporary_name
from aatri.regular_file import open_regular, read_regular

KEPT_DAYS, MOST_FILES = 60, 200
"""Age and number of the caches that are kept; one is at most 1 MB or so."""

_GRAIN_NS = 2_000_000_000
"""File times may be this coarse, as on FAT and some network file systems."""


def cache_folder() -> Path:
    """The user's cache folder of aatri: `$XDG_CACHE_HOME/aatri`, else `~/.cache/aatri`, or the system's counterpart."""
    if folder := os.environ.get("XDG_CACHE_HOME"):
        return Path(folder) / "aatri"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home()) / "aatri" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "aatri"
    return Path.home() / ".cache" / "aatri"


def cache_name(kind: str, of: Path) -> Path:
    """File of the cache of a kind that belongs to a folder."""
    where = hashlib.sha256(os.fsencode(of.absolute())).hexdigest()[:16]
    return cache_folder() / f"{kind}-{where}.json"


class Cache:
    """Values by key, in one JSON file; `None` as the file keeps them in memory only."""

    def __init__(self, path: Path | None) -> None:
        self._path, self._changed = path, False
        self._values: dict[str, Any] = {}
        if path is not None:
            with contextlib.suppress(OSError, ValueError, RecursionError):
                self._values = dict(_values_of(path, *stat_of(path)))

    def get(self, key: str) -> Any:
        """The value, or None."""
        return self._values.get(key)

    def put(self, key: str, value: Any) -> None:
        """Keep a value."""
        self._values[key] = value
        self._changed = True

    def save(self, most: int = 5000) -> None:
        """Write what is new, the latest `most` values; a cache that cannot be written is let be."""
        if self._path is None or not self._changed:
            return
        kept = dict(list(self._values.items())[-most:])
        _remove_old(self._path.parent)
        with contextlib.suppress(OSError):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            temporary = temporary_name(self._path)
            try:
                temporary.write_text(json.dumps(kept, separators=(",", ":")), encoding="utf-8")
                temporary.replace(self._path)
            finally:
                temporary.unlink(missing_ok=True)
        self._changed = False


@functools.lru_cache(maxsize=8)
def _values_of(path: Path, *_state: int) -> dict[str, Any]:
    """What a cache file holds, read once a process for each state of it: writers replace it."""
    loaded = json.loads(read_regular(path).decode("utf-8"))
    return loaded if isinstance(loaded, dict) else {}


def _remove_old(folder: Path) -> None:
    """Remove the caches that nobody has written for long, and the oldest of many: there is one for every run."""
    with contextlib.suppress(OSError):
        written = sorted(((one.stat().st_mtime, one) for one in folder.glob("*.json")), reverse=True)
        for k, (when, one) in enumerate(written):
            if k >= MOST_FILES or time.time() - when > KEPT_DAYS * 86_400:
                one.unlink(missing_ok=True)


def of_file(path: Path, cache: Cache, compute: Callable[[Path], Any]) -> Any:
    """What `compute` finds in a file, from the cache as long as the file is the same.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    key = str(path)
    state = stat_of(path)
    entry = cache.get(key)
    if not (isinstance(entry, dict) and isinstance(entry.get("seen"), int) and {"stat", "value"} <= entry.keys()):
        entry = None
    if entry is not None and entry["stat"] == state and max(state[1:3]) + _GRAIN_NS < entry["seen"]:
        return entry["value"]
    seen = time.time_ns()
    value = compute(path)
    if stat_of(path) == state and (
        entry is None or entry["stat"] != state or entry["value"] != value or max(state[1:3]) + _GRAIN_NS < seen
    ):
        cache.put(key, {"stat": state, "seen": seen, "value": value})
    return value


def put_file(path: Path, cache: Cache, value: Any) -> None:
    """Keep what is known of a file that this process or its worker has just written.

    Raises
    ------
    OSError
        If the file is gone.
    """
    state = stat_of(path)
    if state[1] % 1_000_000_000:
        cache.put(str(path), {"stat": state, "seen": max(state[1:3]) + _GRAIN_NS + 1, "value": value})


def stat_of(path: Path) -> list[int]:
    """Size, times and inode of a file."""
    status = path.stat()
    return [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]


def file_sha256(path: Path) -> str:
    """Hex SHA-256 of a file."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
