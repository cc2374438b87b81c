"""Members of a zip archive, read with care: they go to memory alone, never to the disk.

Refused are names that lead out of the archive, links, members under a lock, two of one name, archives within the
archive, and members that grow beyond what data do: deflate makes zeros a thousandth, text and tables at most some
hundredth of their size.
"""

import re
import stat
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path

from aatri.errors import InputError
from aatri.formats.text.text_file import check_memory, missing
from aatri.ids import clipped
from aatri.regular_file import open_regular

MOST_MEMBERS = 100_000
"""Entries of an archive: a project of photographs has some per image."""

MOST_GROWTH = 200
"""Size of a member by its size in the archive. XML and tables grow tenfold to fiftyfold, a bomb thousandfold."""

SMALL_BYTES = 1 << 20
"""Members up to this size may grow as they like."""

_OUTSIDE = re.compile(r"^(?:[/\\]|[A-Za-z]:)|(?:^|[/\\])\.\.(?:[/\\]|$)")
ZIP = b"PK\x03\x04"
"""What a zip archive begins with."""
_ARCHIVES = (ZIP, b"\x1f\x8b", b"7z\xbc\xaf\x27\x1c", b"Rar!")
_EXPORT = "save it again in the program that wrote it"


def only_document(names: Iterable[str]) -> str | None:
    """The one XML document among the members of an archive, as `.xmlz` are; None of none or several."""
    documents = [name for name in names if name.lower().endswith(".xml") and not name.startswith("__MACOSX/")]
    return documents[0] if len(documents) == 1 else None


class Archive:
    """A zip archive.

    Raises
    ------
    InputError
        If it is missing, no zip archive, or one of its names leads out of it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with open_regular(path) as file, zipfile.ZipFile(file) as archive:
                members = archive.infolist()
        except (FileNotFoundError, NotADirectoryError) as error:
            raise missing(path) from error
        except (OSError, zipfile.BadZipFile, NotImplementedError, ValueError) as error:
            raise self._error("", f"no zip archive, or one that is cut off: {clipped(str(error))}") from error
        if len(members) > MOST_MEMBERS:
            raise self._error("", f"{len(members)} members, more than {MOST_MEMBERS}")
        self._members: dict[str, zipfile.ZipInfo] = {}
        for member in members:
            name = member.filename
            if _OUTSIDE.search(member.orig_filename) or stat.S_ISLNK(member.external_attr >> 16):
                raise self._error("", f"its member {clipped(name)!r} leads out of the archive")
            if name in self._members:
                raise self._error(name, "two members of this name")
            self._members[name] = member

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all members."""
        return tuple(self._members)

    def at(self, name: str) -> Path:
        """The place of a member, for messages."""
        return self.path / name

    def bytes_of(self, name: str) -> bytes:
        """The content of a member.

        Raises
        ------
        InputError
            If there is no such member, or it is broken, locked, an archive again, or grows beyond measure.
        """
        member = self._members.get(name)
        if member is None:
            raise self._error("", f"no member {clipped(name)!r}")
        if member.flag_bits & 1:
            raise self._error(name, "locked by a password", "save it without one")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise self._error(name, f"packed by method {member.compress_type}", "pack it with deflate, as zip does")
        self._check_growth(name, member.file_size, member.compress_size)
        check_memory(member.file_size, self.at(name))
        try:
            with open_regular(self.path) as file, zipfile.ZipFile(file) as archive, archive.open(member) as opened:
                data = opened.read(member.file_size + 1)
        except (OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
            raise self._error(name, f"cannot be unpacked: {clipped(str(error))}") from error
        if len(data) != member.file_size:
            raise self._error(name, f"{len(data)} bytes, where the archive says {member.file_size}")
        if data.startswith(_ARCHIVES):
            raise self._error(name, "an archive within the archive", "unpack the inner one and give it alone")
        return data

    def _check_growth(self, name: str, size: int, packed: int) -> None:
        if size > SMALL_BYTES and size > MOST_GROWTH * packed:
            what = f"grows from {packed} to {size} bytes, more than {MOST_GROWTH}-fold: no data do"
            raise self._error(name, what, "get the file from a source that you trust")

    def _error(self, name: str, what: str, remedy: str = _EXPORT) -> InputError:
        return InputError(what, where=str(self.at(name) if name else self.path), remedy=remedy)
