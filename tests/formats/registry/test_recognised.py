"""A file is recognised by what it holds, whatever its name; what is not recognised is told with what was looked for."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from aatri.errors import AatriError
from aatri.formats.parts.format import Format
from aatri.formats.registry.catalogue import FORMATS
from aatri.formats.registry.recognised import format_named, recognised
from tests.campaigns.fuzz_seeds import READERS
from tests.formats.opensfm.made_project import write_project

FILES = {"gama": "n.gkf", "bal": "p.txt", "dbat": "export.txt"}


@pytest.mark.parametrize("name", FILES)
def test_files_of_own_stages_are_recognised_under_another_name(tmp_path: Path, name: str) -> None:
    READERS[name].write(tmp_path)
    path = (tmp_path / FILES[name]).rename(tmp_path / "anything.bin")
    (found,) = recognised(path)
    assert found.format.name == name
    assert found.seen


@pytest.mark.parametrize("name", ["tables", "wucaps"])
def test_folders_are_recognised_whole(tmp_path: Path, name: str) -> None:
    READERS[name].write(tmp_path)
    assert [found.format.name for found in recognised(tmp_path)] == [name]


def test_a_folder_of_several_files_is_several_sources(tmp_path: Path) -> None:
    write_project(tmp_path / "opensfm")
    (tmp_path / "gcp.txt").write_text("EPSG:32632\n1 2 3 4 5 a.jpg\n")
    (tmp_path / "notes.txt").write_text("nothing of a block\n")
    found = {r.format.name: r.path.name for r in recognised(tmp_path)}
    assert found == {"odm_gcp": "gcp.txt", "opensfm": "reconstruction.json", "opensfm_tracks": "tracks.csv"}


def test_files_of_no_format_and_deep_folders_are_listed_and_photographs_are_not(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("point,X,Y,Z\nA,1,2,3\n")
    for name in ("readme.md", "a.jpg"):
        (tmp_path / name).write_text("something else\n")
    for deep in ("a/b/c", "a/empty"):
        (tmp_path / deep).mkdir(parents=True)
    unread: list[Path] = []
    assert [r.format.name for r in recognised(tmp_path, unread)] == ["table"]
    assert unread == [tmp_path / "a" / "b", tmp_path / "readme.md"]


def test_a_list_of_numbers_below_a_remark_is_no_list_of_control(tmp_path: Path) -> None:
    (tmp_path / "eo.txt").write_text("# gon\n1 500000.0 5000000.0 1000.0 0.5 399.5 100.0\n2 1.0 2.0 3.0 4.0 5.0 6.0\n")
    with pytest.raises(AatriError, match="any list by its columns: --set"):
        recognised(tmp_path / "eo.txt")
    (tmp_path / "gcp.txt").write_text("# by hand\nEPSG:32632\n1 2 3 4 5 a.jpg\n")
    assert recognised(tmp_path / "gcp.txt")[0].format.name == "odm_gcp"


@pytest.mark.parametrize(
    "row", ["1" * 16_000 + "x", "1.5 " * 4_000 + "x.jpg", "1,5," * 4_000 + ";", " " * 16_000 + "x"]
)
def test_a_long_line_of_any_file_does_not_hold_up_recognition(tmp_path: Path, row: str) -> None:
    """A pattern tried all ways to part digits into numbers: no end for images.txt of COLMAP without its points."""
    for name in ("images.txt", "images.dat"):
        (tmp_path / name).write_text(f"{row}\n" * 8)
    with pytest.raises(AatriError, match="of no known format"):
        recognised(tmp_path)


def test_what_is_of_no_format_is_told_with_its_beginning_and_what_was_looked_for(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("Dear colleague\n")
    with pytest.raises(AatriError, match=r"notes.txt begins with 'Dear colleague'") as caught:
        recognised(tmp_path)
    assert "table: a header with the columns of a list" in str(caught.value)
    assert "block.yaml" in str(caught.value)
    (tmp_path / "tree.xml").write_text('<?xml version="1.0"?><tree/>')
    (tmp_path / "photos.ori").write_text("no rotation\n")
    (tmp_path / "several.zip").write_bytes(b"PK\x03\x04...")
    with pytest.raises(AatriError, match=r"several.zip is a zip archive without one XML file, or a broken one"):
        recognised(tmp_path / "several.zip")
    for name, near in (("tree.xml", "gama: XML with <gama-local>"), ("photos.ori", "patb: three records")):
        with pytest.raises(AatriError, match=f"nearest are {near}") as caught:
            recognised(tmp_path / name)
        assert str(caught.value).endswith("all formats: aatri formats")


def test_names_are_distinct_and_every_format_says_what_it_carries() -> None:
    assert len({f.name for f in FORMATS}) == len(FORMATS)
    assert all(f.carries and f.looked_for and not {*f.carries} & {*f.drops} for f in FORMATS)
    assert all(f.read or f.stage or f.write for f in FORMATS)
    with pytest.raises(AatriError, match="did you mean 'colmap'"):
        format_named("colmpa")


@pytest.mark.parametrize("declared", FORMATS, ids=lambda f: f.name)
def test_the_page_of_a_format_has_its_section(declared: Format) -> None:
    page, _, anchor = declared.page.partition("#")
    heads = re.findall(r"^##+ (.*)$", (Path(__file__).parents[3] / page).read_text(encoding="utf-8"), re.M)
    assert anchor in {re.sub(r"[^a-z0-9 -]", "", head.lower()).replace(" ", "-") for head in heads}


def test_results_that_were_exported_are_no_block_and_the_message_says_how_to_get_it(tmp_path: Path) -> None:
    for name in ("residuals.csv", "points.csv", "exterior.csv", "cameras.csv"):
        (tmp_path / name).write_text("id\n1\n")
    with pytest.raises(AatriError, match="aatri export RUN:block tables DIR"):
        recognised(tmp_path)
