"""Zip archives: members are read, and what is hostile or broken is refused by name."""

from __future__ import annotations

import io
import stat
import zipfile
from pathlib import Path

import pytest

from aatri.errors import InputError
from aatri.formats.text.archive import SMALL_BYTES, Archive


def packed(path: Path, members: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return path


def test_members_come_out_as_they_went_in(tmp_path: Path) -> None:
    archive = Archive(packed(tmp_path / "p.psz", {"doc.xml": b"<a/>\n", "0/points.ply": bytes(range(256)) * 9}))
    assert archive.names == ("doc.xml", "0/points.ply")
    assert archive.bytes_of("doc.xml") == b"<a/>\n"
    assert archive.bytes_of("0/points.ply") == bytes(range(256)) * 9
    assert archive.at("doc.xml") == tmp_path / "p.psz" / "doc.xml"


@pytest.mark.parametrize("name", ["../doc.xml", "a/../../b", "/etc/passwd", "C:\\doc.xml", "a\\..\\..\\b", ".."])
def test_names_that_lead_out_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match="leads out of the archive") as refused:
        Archive(packed(tmp_path / "p.zip", {"doc.xml": b"<a/>", name: b"x"}))
    assert "p.zip" in str(refused.value)


def test_names_with_dots_within_stay(tmp_path: Path) -> None:
    assert Archive(packed(tmp_path / "p.zip", {"a..b/..c/d..": b"x"})).bytes_of("a..b/..c/d..") == b"x"


def test_a_link_is_refused(tmp_path: Path) -> None:
    link = zipfile.ZipInfo("doc.xml")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(tmp_path / "p.zip", "w") as archive:
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(InputError, match="leads out of the archive"):
        Archive(tmp_path / "p.zip")


def test_a_bomb_is_refused_before_it_is_unpacked_and_small_zeros_are_not(tmp_path: Path) -> None:
    archive = Archive(packed(tmp_path / "p.zip", {"doc.xml": bytes(50 << 20), "small": bytes(SMALL_BYTES)}))
    with pytest.raises(InputError, match=r"p.zip/doc.xml.*grows from .* to 52428800 bytes"):
        archive.bytes_of("doc.xml")
    assert archive.bytes_of("small") == bytes(SMALL_BYTES)


def test_an_archive_within_is_refused(tmp_path: Path) -> None:
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w") as archive:
        archive.writestr("a", b"b")
    with pytest.raises(InputError, match=r"p.zip/doc.xml.*an archive within the archive"):
        Archive(packed(tmp_path / "p.zip", {"doc.xml": inner.getvalue()})).bytes_of("doc.xml")


def test_what_is_broken_is_told(tmp_path: Path) -> None:
    path = packed(tmp_path / "p.zip", {"doc.xml": b"<a>" * 1000}, zipfile.ZIP_STORED)
    data = path.read_bytes()
    for content, message in (
        (data[:-30], "no zip archive, or one that is cut off"),
        (b"", "no zip archive"),
        (data.replace(b"<a><a>", b"<a><b>", 1), "cannot be unpacked: Bad CRC-32"),
    ):
        path.write_bytes(content)
        with pytest.raises(InputError, match=message):
            Archive(path).bytes_of("doc.xml")
    with pytest.raises(InputError, match="does not exist"):
        Archive(tmp_path / "q.zip")
    with pytest.raises(InputError, match="no member 'other'"):
        Archive(packed(path, {"doc.xml": b""})).bytes_of("other")
    with pytest.raises(InputError, match="packed by method 12"):
        Archive(packed(path, {"doc.xml": b"x"}, zipfile.ZIP_BZIP2)).bytes_of("doc.xml")


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_two_members_of_a_name_and_a_lock_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "p.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("doc.xml", b"1")
        archive.writestr("doc.xml", b"2")
    with pytest.raises(InputError, match=r"doc.xml.*two members of this name"):
        Archive(path)
    data = bytearray(packed(path, {"doc.xml": b"1"}).read_bytes())
    data[data.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(data)
    with pytest.raises(InputError, match="locked by a password"):
        Archive(path).bytes_of("doc.xml")
