"""The text of an XML file, or of the one in a zip archive (`.xmlz`), decoded as it declares: expat itself knows four
encodings only.

Entities that a file defines, or leaves to a DTD, are refused: where the DTD is not read, expat drops them in silence.
"""

import codecs
import re
from pathlib import Path

from aatri.errors import InputError
from aatri.formats.text.archive import ZIP, Archive, only_document
from aatri.formats.text.text_file import read_bytes, refuse_page

_DECLARED = re.compile(rb"""\s*<\?xml[^>]{0,200}?\sencoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
_BYTE_ORDER_MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
_PREDEFINED = r"&(?!(?:amp|lt|gt|quot|apos|#[0-9]{1,9}|#x[0-9A-Fa-f]{1,8});)"
_ENTITY = re.compile(f"<!ENTITY|{_PREDEFINED}")
_NO_CONTENT = re.compile(r"<!--.*?-->|<!\[CDATA\[.*?\]\]>", re.DOTALL)


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
