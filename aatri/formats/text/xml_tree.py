"""The elements of an XML file, each with its line, so that every message can say where.

Names are without their namespace. A file that is no XML, or another one than its reader wants, is refused by its root.

The text, or that of the one file in a zip archive (`.xmlz`), is decoded as it declares: expat itself knows four
encodings only. Entities that a file defines, or leaves to a DTD, are refused: where the DTD is not read, expat drops
them in silence.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.formats.text.archive import ZIP, Archive, only_document
from aatri.formats.text.number_text import number_of, whole_number_of
from aatri.formats.text.text_file import read_bytes, refuse_page
from aatri.formats.text.text_line import blank_separated, error_at, where_of
from aatri.ids import clipped

_DECLARED = re.compile(rb"""\s*<\?xml[^>]{0,200}?\sencoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
_BYTE_ORDER_MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
_PREDEFINED = r"&(?!(?:amp|lt|gt|quot|apos|#[0-9]{1,9}|#x[0-9A-Fa-f]{1,8});)"
_ENTITY = re.compile(f"<!ENTITY|{_PREDEFINED}")
_NO_CONTENT = re.compile(r"<!--.*?-->|<!\[CDATA\[.*?\]\]>", re.DOTALL)

LIKE = "write it like -1234.5"

MOST_LEVELS = 100
"""Deepest nesting: no format comes near it."""


@dataclass(eq=False)
class XmlElement:
    """An element: name, attributes, the text directly in it, the elements in it, and where it stands."""

    tag: str
    attributes: dict[str, str]
    path: Path
    line: int
    children: list[XmlElement] = field(default_factory=list, repr=False)
    pieces: list[str] = field(default_factory=list, repr=False)

    where = property(where_of)
    error = error_at

    @property
    def text(self) -> str:
        """The text in it, blanks at its ends left out."""
        return "".join(self.pieces).strip(" \t\r\n")

    def get(self, name: str, default: str = "") -> str:
        """An attribute."""
        return self.attributes.get(name, default)

    def all(self, *path: str) -> list[XmlElement]:
        """The elements reached by these names, one step each."""
        reached = [self]
        for tag in path:
            reached = [child for element in reached for child in element.children if child.tag == tag]
        return reached

    def within(self, tag: str) -> Iterator[XmlElement]:
        """The elements of a name at any depth, in the order of the file."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            if element.tag == tag:
                yield element
            waiting += reversed(element.children)

    def optional(self, *path: str) -> XmlElement | None:
        """The one element reached by these names, or None.

        Raises
        ------
        InputError
            If there are two.
        """
        reached = self.all(*path)
        if len(reached) > 1:
            raise reached[1].error(f"{path[-1]} twice in {self.tag}", "remove one")
        return reached[0] if reached else None

    def one(self, *path: str) -> XmlElement:
        """The one element reached by these names.

        Raises
        ------
        InputError
            If there is none, or two.
        """
        element = self.optional(*path)
        if element is None:
            raise self.error(f"{self.tag} has no {'/'.join(path)}", "the file is incomplete: export it again")
        return element

    def number(self, *path: str, default: float | None = None) -> float:
        """The number in an element; of this one without a path."""
        element = self.optional(*path) if path else self
        if element is None and default is not None:
            return default
        return (element or self.one(*path)).parsed(self.one(*path).text if path else self.text)

    def numbers(self, count: int, *path: str) -> Float:
        """So many numbers in an element, between blanks."""
        element = self.one(*path) if path else self
        words = blank_separated(element.text)
        if len(words) != count:
            raise element.error(f"{element.tag} has {len(words)} numbers, not {count}", "export it again")
        return np.array([element.parsed(word) for word in words])

    def parsed(self, text: str, name: str = "") -> float:
        """A text of this element as a number."""
        try:
            return number_of(text)
        except ValueError as error:
            raise self.error(f"{name or self.tag} is {clipped(text)!r}: {error}", LIKE) from error

    def integer(self, text: str, name: str = "") -> int:
        """A text of this element as a whole number."""
        try:
            return whole_number_of(text)
        except ValueError as error:
            raise self.error(f"{name or self.tag} is {clipped(text)!r}, {error}", "write digits only") from error


def read_xml(path: Path, roots: Collection[str], what: str, text: str | None = None) -> XmlElement:
    """The root of an XML file.

    Parameters
    ----------
    roots : collection of str
        Names that the root may have.
    what : str
        What the file should be, for messages.
    text : str, optional
        Its text, if it was read already: of a member of an archive.

    Raises
    ------
    InputError
        If it is no XML, uses entities of its own, or has another root.
    """
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    document = XmlElement("", {}, path, 0)
    within = [document]

    def start(name: str, attributes: dict[str, str]) -> None:
        element = XmlElement(name.rpartition(":")[2], attributes, path, parser.CurrentLineNumber)
        if len(within) > MOST_LEVELS:
            raise element.error(f"more than {MOST_LEVELS} levels", f"give {what}")
        within[-1].children.append(element)
        within.append(element)

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: within.pop()
    parser.CharacterDataHandler = lambda text: within[-1].pieces.append(text)
    try:
        parser.Parse((xml_text(path) if text is None else text).encode(), True)
    except expat.ExpatError as error:
        where = f"{path}:{error.lineno}:{error.offset + 1}"
        raise InputError(f"no XML: {expat.ErrorString(error.code)}", where=where, remedy=f"give {what}") from error
    root = document.children[0]
    if root.tag not in roots:
        raise root.error(f"the root element is {clipped(root.tag)!r}", f"{what} is wanted")
    return root


def xml_text(path: Path) -> str:
    """The text of an XML file.

    Raises
    ------
    InputError
        If it cannot be read, is not in the encoding it declares, or uses entities of its own.
    """
    data = read_bytes(path)
    archive = Archive(path) if data.startswith(ZIP) else None
    document = only_document(archive.names) if archive else None
    if archive is None or document is None:
        return decoded_xml(data, path)
    return decoded_xml(archive.bytes_of(document), archive.at(document))


def decoded_xml(data: bytes, path: Path) -> str:
    """The text of the content of an XML file, or of a member of an archive.

    Raises
    ------
    InputError
        As `xml_text`.
    """
    refuse_page(data, path)
    if data.startswith(b"PK"):
        raise InputError("this is a zip archive without one XML file", where=str(path), remedy="unpack it")
    declared = _DECLARED.match(data)
    marked = next((name for mark, name in _BYTE_ORDER_MARKS.items() if data.startswith(mark)), None)
    encoding = marked or (declared.group(1).decode() if declared else "utf-8")
    try:
        if not codecs.lookup(encoding)._is_text_encoding:  # of base64, zip and the like
            raise LookupError(encoding)
        text = data.decode(encoding)
    except LookupError as error:
        raise InputError(f"the encoding {encoding} is not known", where=f"{path}:1", remedy="save as UTF-8") from error
    except UnicodeError as error:
        line = 1 + data.count(b"\n", 0, getattr(error, "start", 0))
        raise InputError(f"not {encoding}, as it declares", where=f"{path}:{line}", remedy="save as UTF-8") from error
    bare = _NO_CONTENT.sub(lambda comment: "\n" * comment.group().count("\n"), text)
    if entity := _ENTITY.search(bare):
        line = 1 + bare.count("\n", 0, entity.start())
        raise InputError("an entity of its own", where=f"{path}:{line}", remedy="write its text out; & itself is &amp;")
    return text.encode("utf-8", "replace").decode()
