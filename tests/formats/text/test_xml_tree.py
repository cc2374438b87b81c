"""Elements of XML with their lines; what is no XML of the wanted kind is refused with its place."""

from pathlib import Path

import pytest

from aatri.errors import InputError
from aatri.formats.text.xml_tree import read_xml

TEXT = """<?xml version="1.0"?>
<n:root xmlns:n="urn:x">
  <a k="1">2.5</a>
  <b><c>1 2 <!-- between --> 3</c></b>
  <b/>
</n:root>
"""


def written(tmp_path: Path, text: str | bytes) -> Path:
    path = tmp_path / "file.xml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def test_blanks_beyond_ascii_part_no_numbers(tmp_path: Path) -> None:
    root = read_xml(written(tmp_path, TEXT.replace("1 2 <", "1\u20092 <")), ("root",), "a test file")
    with pytest.raises(InputError, match=r":4: c has 2 numbers, not 3"):
        root.numbers(3, "b", "c")


def test_elements_by_name_with_their_lines(tmp_path: Path) -> None:
    root = read_xml(written(tmp_path, TEXT), ("root",), "a test file")
    assert root.number("a") == 2.5
    assert (root.one("a").line, root.one("a").get("k")) == (3, "1")
    assert root.numbers(3, "b", "c").tolist() == [1.0, 2.0, 3.0]
    assert [b.line for b in root.all("b")] == [4, 5]
    assert [c.line for c in root.within("c")] == [4]
    assert root.number("absent", default=7.0) == 7.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TEXT.replace("2.5", "2,5"), r"file.xml:3: a is '2,5': a decimal comma"),
        (TEXT.replace("2.5", "nan"), r"file.xml:3: a is 'nan': not a finite number"),
        (TEXT.replace("<a ", "<x ").replace("</a>", "</x>"), r"file.xml:2: root has no a"),
        (TEXT.replace("  <b/>", "  <a>3</a>"), r"file.xml:5: a twice in root"),
        (TEXT[:60], r"file.xml:3:\d+: no XML: (no element found|unclosed token)"),
        (TEXT.replace("root", "other"), r"file.xml:2: the root element is 'other'"),
        ("<!DOCTYPE html><html></html>", r"file.xml:1: this is a web page \(HTML\), not data"),
        ('<!DOCTYPE r [<!ENTITY e "x">]><root>&e;</root>', r"file.xml:1: an entity of its own"),
        (b"PK\x03\x04rest", r"no zip archive, or one that is cut off"),
        (TEXT.encode("utf-16"), None),
        (TEXT.replace("2.5", "\u00e9").encode("latin-1"), r"file.xml:3: not utf-8, as it declares"),
    ],
)
def test_damaged_files_are_refused_with_their_place(tmp_path: Path, text: str | bytes, message: str | None) -> None:
    path = written(tmp_path, text)
    if message is None:
        assert read_xml(path, ("root",), "a test file").number("a") == 2.5
        return
    with pytest.raises(InputError, match=message):
        read_xml(path, ("root",), "a test file").number("a")
