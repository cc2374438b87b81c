"""Opening of a file to read: never a pipe that keeps its reader waiting, a device without end, or a folder."""

import errno
import hashlib
import os
import stat
from io import BufferedReader
from pathlib import Path

_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
_READ = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)


def open_regular(path: Path, flags: int = 0) -> BufferedReader:
    """A file opened to read.

    Parameters
    ----------
    flags : int
        More flags of `os.open`.

    Raises
    ------
    OSError
        If it cannot be opened, is not a regular file, or its name is none that a file can have.
    """
    try:
        handle = os.open(path, _READ | flags)
    except ValueError as error:  # a zero byte in the name
        raise OSError(errno.EINVAL, "a name that no file can have", str(path)) from error
    if what := not_regular(os.fstat(handle).st_mode):
        os.close(handle)
        raise OSError(errno.EINVAL, f"is {what}, not a file", str(path))
    return os.fdopen(handle, "rb")


def read_regular(path: Path) -> bytes:
    """The content of a file, as `open_regular` opens it."""
    with open_regular(path) as file:
        return file.read()


def content_of(*paths: str) -> str:
    """SHA-256 of the contents of files, one after the other; empty if there is none of them; `""` is no file."""
    digests = []
    for path in filter(None, paths):
        try:
            with open_regular(Path(path)) as file:
                digests.append(hashlib.file_digest(file, "sha256").hexdigest())
        except OSError:
            return ""
    return hashlib.sha256(" ".join(digests).encode()).hexdigest() if len(digests) > 1 else "".join(digests)


def is_of_the_machine(error: OSError) -> bool:
    """Whether the disk, the network or the system failed, and not what somebody wrote."""
    return error.errno in (errno.EIO, errno.ESTALE, errno.ENOMEM, errno.EMFILE, errno.ENFILE)


def not_regular(mode: int) -> str:
    """What a thing of this mode is, in words; empty if it is a regular file."""
    return "" if stat.S_ISREG(mode) else _KINDS.get(stat.S_IFMT(mode), "a link")


def leads_nowhere(path: Path) -> str:
    """Where a link leads that has no target; empty for anything else."""
    try:
        return str(path.readlink()) if path.is_symlink() and not path.exists() else ""
    except (OSError, ValueError):
        return ""


def wrong_path(path: Path) -> str:
    """Why no file system takes a path, in words; empty if there is no reason known."""
    text = str(path)
    try:
        size = len(text.encode("utf-8"))
        longest = max((len(part.encode("utf-8")) for part in path.parts), default=0)
    except UnicodeEncodeError:
        return "not UTF-8"
    if "\0" in text:
        return "a zero byte in a name"
    return f"a name of {longest} bytes" if longest > 255 else f"a path of {size} bytes" if size > 4000 else ""
