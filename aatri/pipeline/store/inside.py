"""The files of a run, reached without following links, and only by names that stay within the run.

A run folder may come from anyone. A link in the place of one of its files or folders would let aatri overwrite, append
to, remove or show files elsewhere; a name like `../x` in a record or a variant would do the same; a pipe would keep its
reader waiting for ever. So every file of a run is opened, made, replaced and removed by these functions and by no
others. Each takes the run and the names below it, one per level:

- no level of the way may be a link, nor anything but a folder: else ArtifactError;
- what is read is a regular file, and of limited size;
- what is written appears under a temporary name, is brought to the disk (fsync) and takes the place of whatever had
  the name, link or not: a crash at any moment leaves the old state or the new one, never a half. Temporary names carry
  the process that writes, so that those of dead processes can be swept;
- what is appended to or locked is a regular file with one name only;
- what is removed is the name itself, never what it leads to.

The folder of the run itself may be a link: it is the user who names it. The run of a variant lies in the run that it
belongs to, and so is reached from there. Links put there while aatri runs are not guarded against.
"""

import contextlib
import json
import os
import re
import secrets
import shutil
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO, TextIO

from aatri.errors import ArtifactError, ResourceError
from aatri.regular_file import not_regular, open_regular

VARIANTS = "variants"
MAX_TEXT_BYTES = 1 << 26
"""Largest record, pointer or log that is read."""

_NAME = re.compile(r"[A-Za-z0-9._][A-Za-z0-9._-]*")
_NO_FOLLOW = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
_TEMPORARY = ".tmp-"


def path_of(run: Path, *names: str) -> Path:
    """Path of something in a run.

    Raises
    ------
    ArtifactError
        If a name could lead out of its folder, or a level above the last is a link or no folder.
    """
    at, names = (run.parent.parent, (VARIANTS, run.name, *names)) if run.parent.name == VARIANTS else (run, names)
    for level, name in enumerate(names):
        if not _NAME.fullmatch(name) or name in (".", "..") or len(name) > 255:
            raise ArtifactError(f"{name[:40]!r} is no name of a file of a run", where=str(run))
        if level and (what := _not_a_folder(at)):
            raise _foreign(at, what)
        at = at / name
    return at


def kind(run: Path, *names: str) -> str:
    """What has a name: `file`, `folder`, `link`, something else in words, or empty for nothing."""
    try:
        mode = path_of(run, *names).lstat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return ""
    return "folder" if stat.S_ISDIR(mode) else not_regular(mode).removeprefix("a ") or "file"


def file_path(run: Path, *names: str) -> Path:
    """Path of a regular file, for libraries that open files themselves.

    Raises
    ------
    FileNotFoundError
        If there is none.
    ArtifactError
        If it is a link or no file.
    """
    path = path_of(run, *names)
    if what := not_regular(path.lstat().st_mode):
        raise _foreign(path, what)
    return path


def read(run: Path, *names: str) -> bytes:
    """Content of a file.

    Raises
    ------
    FileNotFoundError
        If there is none.
    ArtifactError
        If it is a link, no file, or larger than a text of a run can be.
    """
    path = file_path(run, *names)
    with open_regular(path, _NO_FOLLOW) as file:
        data = file.read(MAX_TEXT_BYTES + 1)
    if len(data) > MAX_TEXT_BYTES:
        raise ArtifactError(
            f"larger than {MAX_TEXT_BYTES} bytes: not a file of a run", where=str(path), remedy="remove it"
        )
    return data


def names_in(run: Path, *names: str) -> list[str]:
    """Sorted names in a folder; none if there is no such folder.

    Raises
    ------
    ArtifactError
        If it is a link.
    """
    what = kind(run, *names)
    if what not in ("", "folder"):
        raise _foreign(path_of(run, *names), what)
    return sorted(entry.name for entry in path_of(run, *names).iterdir()) if what else []


def make_folder(run: Path, *names: str) -> Path:
    """Make a folder and those above it."""
    for level in range(len(names) + 1):
        path = path_of(run, *names[:level])
        path.mkdir(parents=not level, exist_ok=True)
        if level and (what := _not_a_folder(path)):
            raise _foreign(path, what)
    return path


def write(data: bytes, run: Path, *names: str) -> Path:
    """Write a file whole or not at all, see `write_by`."""
    return write_by(lambda file: file.write(data), run, *names)


def write_by(put: Callable[[BinaryIO], object], run: Path, *names: str) -> Path:
    """Have a file written whole or not at all: temporary name, to the disk, rename, the folder to the disk."""
    path = path_of(run, *names)
    temporary = temporary_name(path)
    try:
        with temporary.open("xb") as file:
            put(file)
        sync(temporary)
        temporary.replace(path)
        sync(path.parent)
    finally:
        temporary.unlink(missing_ok=True)
    return path


def write_json(value: Any, run: Path, *names: str) -> None:
    """Write a JSON file whole or not at all."""
    write((json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode("utf-8"), run, *names)


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


def create(run: Path, *names: str) -> TextIO:
    """A new text file in place of whatever has its name."""
    path = path_of(run, *names)
    remove(run, *names)
    return path.open("x", encoding="utf-8")


def open_kept(run: Path, *names: str, flags: int = 0) -> int:
    """A handle of a file that keeps its content, to read and write; made if it is not there.

    Raises
    ------
    ArtifactError
        If it is a link, no file, or has another name elsewhere.
    """
    path = path_of(run, *names)
    if kind(run, *names) not in ("", "file"):
        raise _foreign(path, kind(run, *names))
    handle = os.open(path, os.O_RDWR | os.O_CREAT | _NO_FOLLOW | flags, 0o666)
    status = os.fstat(handle)
    if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
        os.close(handle)
        raise _foreign(path, not_regular(status.st_mode) or "a second name of a file elsewhere")
    return handle


def move(run: Path, source: tuple[str, ...], target: tuple[str, ...]) -> None:
    """Rename, over whatever has the new name."""
    path_of(run, *source).replace(path_of(run, *target))


def remove(run: Path, *names: str) -> None:
    """Remove a name that is not a folder's, if it is there."""
    with contextlib.suppress(NotADirectoryError):
        path_of(run, *names).unlink(missing_ok=True)


def remove_folder(run: Path, *names: str) -> None:
    """Remove a folder with all that is in it, and no folder that a link leads to."""
    if kind(run, *names) == "folder":
        shutil.rmtree(path_of(run, *names))
    else:
        remove(run, *names)


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


def temporary_name(path: Path) -> Path:
    """A new name beside a path, which says which process writes there."""
    return path.with_name(f"{_TEMPORARY}{path.stem[:100]}-{os.getpid()}-{secrets.token_hex(4)}{path.suffix}")


def sweep(run: Path) -> None:
    """Remove what dead processes left half-written below a run."""
    for folder, _, files in os.walk(run):  # follows no links
        for name in files:
            owner = Path(name).stem.split("-")[-2:-1]
            if name.startswith(_TEMPORARY) and owner and owner[0].isdecimal() and not is_alive(int(owner[0])):
                (Path(folder) / name).unlink(missing_ok=True)


def is_alive(pid: int) -> bool:
    """Whether a process of this machine runs; this one does not count as a rival of itself."""
    if pid == os.getpid():
        return True
    if os.name == "nt":  # pragma: no cover - signal 0 would end the process there
        return True
    try:
        os.kill(pid, 0)
    except PermissionError:
        return True
    except (ProcessLookupError, OverflowError):
        return False
    return True


def _not_a_folder(path: Path) -> str:
    """What lies there, if it is neither a folder nor nothing."""
    try:
        mode = path.lstat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return ""
    return "" if stat.S_ISDIR(mode) else not_regular(mode) or "a file"


def _foreign(path: Path, what: str) -> ArtifactError:
    shown = what if what.startswith("a ") else f"a {what}"
    return ArtifactError(
        f"is {shown}, which aatri never puts there and does not follow", where=str(path), remedy="remove it"
    )
