"""Text files of unknown origin: encoding, byte order marks and line ends.

UTF-8 with or without byte order mark; UTF-16 with its mark; else GB18030, if all it gives is ASCII and Chinese. Never
an 8-bit encoding that accepts any byte: it would turn ids into something else without a word. Line ends LF, CRLF, CR.
"""

import codecs
import re
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path

from aatri.errors import InputError, ResourceError
from aatri.ids import did_you_mean
from aatri.machine import memory_bytes
from aatri.progress import SILENT, Reporter
from aatri.regular_file import is_of_the_machine, leads_nowhere, read_regular

_BINARY = {
    b"PK\x03\x04": "an Excel workbook or zip archive, not text",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook, not text",
    b"\x89HDF": "an HDF5 file, not text",
    b"\x1f\x8b": "a gzip file, not text",
    b"%PDF": "a PDF, not text",
    codecs.BOM_UTF32_LE: "text of 32 bits a sign (UTF-32)",
    codecs.BOM_UTF32_BE: "text of 32 bits a sign (UTF-32)",
}
MEMORY_PER_BYTE = 13
"""Memory that a byte of a table takes while it is read: measured on image points (2026)."""
MOST_NAMES = 10
"""Most names of a folder listed in a message."""

_PAGE = re.compile(rb"\s*(<!doctype html|<html[\s>])", re.IGNORECASE)

_COMMON = {
    sign
    for high in (*range(0xA1, 0xAA), *range(0xB0, 0xD8))
    for low in range(0xA1, 0xFF)
    for sign in bytes([high, low]).decode("gb2312", errors="ignore")
}
"""Signs and the 3755 common characters of GB 2312."""
_WITHIN_A_WORD = re.compile("[a-zA-Z][\u3400-\u9fff]{1,2}[a-z]")
_CHINESE_OR_ASCII = re.compile("[\t\n\r\x20-\x7e\u2000-\u206f\u3000-\u303f\u3400-\u9fff\uff00-\uffef]*")


def read_lines(path: Path, reporter: Reporter = SILENT) -> list[str]:
    """The lines of a text file, without line ends; a last empty line is left out.

    Raises
    ------
    InputError
        If the file is missing, empty, binary or of no known encoding.
    """
    size = 0
    with suppress(OSError, ValueError):  # told when it is read
        size = path.stat().st_size
    check_memory(size, path)
    text = _decoded(read_bytes(path), path, reporter)
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    if lines[-1] == "":
        lines.pop()
    if not lines:
        raise InputError("the file is empty", where=str(path), remedy="put the data in, or remove the file")
    return lines


def check_memory(size: int, path: Path) -> None:
    """Refuse a file of so many bytes whose rows need more memory than there is, before it is read."""
    if (needed := MEMORY_PER_BYTE * size) > (available := memory_bytes()):
        what = f"takes some {needed / 1e9:.2g} GB of memory to read, and there are {available / 1e9:.2g} GB here"
        raise ResourceError(what, where=str(path), remedy="divide the block, or thin it out")


def missing(path: Path, others: Collection[str] = ()) -> InputError:
    """The error for a file or folder that is not there, with the nearest name that is; `others` are names in their own
    right, which nobody writes for this one."""
    folder = path.parent
    if target := leads_nowhere(path):
        return InputError(f"is a link to {target}, which is not there", where=str(path), remedy="mend the link")
    if not folder.is_dir():
        return InputError(
            "does not exist, nor does its folder", where=str(path), remedy=f"create {folder} or mend path"
        )
    names = sorted(entry.name for entry in folder.iterdir())
    near = did_you_mean(path.name, set(names) - set(others)).removeprefix(" - ")
    more = ", ..." if len(names) > MOST_NAMES else ""
    beside = f"beside it are {', '.join(names[:MOST_NAMES])}{more}" if names else f"{folder} is empty"
    return InputError("does not exist", where=str(path), remedy=near or f"put it there or mend the path; {beside}")


def read_bytes(path: Path) -> bytes:
    """The content of a file of input.

    Raises
    ------
    InputError
        If it is missing, no file, or cannot be read.
    """
    try:
        return read_regular(path)
    except (FileNotFoundError, NotADirectoryError) as error:
        raise missing(path) from error
    except OSError as error:
        if is_of_the_machine(error):
            raise ResourceError(
                f"cannot be read: {error.strerror}", where=str(path), remedy="check the disk"
            ) from error
        remedy = "name the file in it" if path.is_dir() else "check what it is, and its permissions"
        raise InputError(f"cannot be read: {error.strerror}", where=str(path), remedy=remedy) from error


def refuse_page(data: bytes, path: Path) -> None:
    """A fault if a file is a page of the web, as servers send it in place of a file that they do not have."""
    if _PAGE.match(data.removeprefix(codecs.BOM_UTF8)):
        raise InputError("this is a web page (HTML), not data", where=f"{path}:1", remedy="get the file itself")


def _decoded(data: bytes, path: Path, reporter: Reporter) -> str:
    refuse_page(data, path)
    for magic, what in _BINARY.items():
        if data.startswith(magic):
            raise InputError(f"this is {what}", where=str(path), remedy="export it as CSV, encoding UTF-8")
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        reporter.warn(f"{path}: UTF-16 text; read as such")
        try:
            return data.decode("utf-16")
        except UnicodeDecodeError as error:
            raise InputError("broken UTF-16", where=str(path), remedy="save the file as UTF-8") from error
    if b"\0" in data:
        place = f"{path}:{1 + data.count(bytes([10]), 0, data.index(0))}"
        raise InputError("a zero byte: this is not text", where=place, remedy="export the data as CSV, encoding UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        return _chinese(data, error.start, path, reporter)


def _chinese(data: bytes, first_bad: int, path: Path, reporter: Reporter) -> str:
    try:
        text = data.decode("gb18030")
    except UnicodeDecodeError:
        text = "\x00"
    if not _CHINESE_OR_ASCII.fullmatch(text) or not _is_likely(text):
        line = 1 + data.count(b"\n", 0, first_bad)
        remedy = "save the file as UTF-8; it may be Windows-1252 (Western) or another code page of 8 bits"
        raise InputError("neither UTF-8 nor GB18030 (Chinese)", where=f"{path}:{line}", remedy=remedy)
    reporter.warn(f"{path}: not UTF-8; read as GB18030 (Chinese)")
    return text


def _is_likely(text: str) -> bool:
    """Whether Chinese characters are common ones, and not letters with accents within Western words.

    A letter with an accent and the letter after it make up one rare character of GB18030.
    """
    foreign = [sign for sign in text if not sign.isascii()]
    common = sum(sign in _COMMON for sign in foreign)
    return 2 * common > len(foreign) and not _WITHIN_A_WORD.search(text)
