"""Rows of a table change one by one; all else in the file stays, and what others wrote is never overwritten."""

from __future__ import annotations

from pathlib import Path

import pytest

from aatri.errors import InputError
from aatri.measuring.measured_table import ChangedMeanwhile, MeasuredTable

TEXT = """\
# measured in spring
point,sx,x,image,y,x_who
# the quarry
P1,0.4,10.5,a,20.25,eva

P2,,11,"a",21,
P1,,12,b,22,
"""
NEW = ("image", "point", "x", "y")
CELLS = {"x": "1.5", "y": "2.5"}


def _table(folder: Path, text: str | bytes = TEXT) -> MeasuredTable:
    path = folder / "image_points.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return MeasuredTable(path, NEW)


def test_a_changed_row_keeps_its_other_cells_and_all_other_lines(tmp_path: Path) -> None:
    table = _table(tmp_path)
    table.measure("a", "P1", table.of_image("a")[0].line, CELLS)
    assert table.path.read_text() == TEXT.replace("P1,0.4,10.5,a,20.25,eva", "P1,0.4,1.5,a,2.5,eva")


def test_a_new_row_follows_the_order_of_the_columns(tmp_path: Path) -> None:
    table = _table(tmp_path)
    table.measure("c", "P9", "", CELLS)
    assert table.path.read_text() == TEXT + "P9,,1.5,c,2.5,\n"
    assert table.of_name("P9")[0].xy == (1.5, 2.5)


@pytest.mark.parametrize(("image", "name"), [('c,"d"', "=1+1"), ("ä 图", "P,1")])
def test_any_id_comes_back_as_it_was(tmp_path: Path, image: str, name: str) -> None:
    table = _table(tmp_path)
    table.measure(image, name, "", CELLS)
    again = MeasuredTable(table.path, NEW)
    assert [(row.image, row.name) for row in again.of_name(name)] == [(image, name)]


def test_what_is_taken_out_comes_back_by_undo(tmp_path: Path) -> None:
    table = _table(tmp_path)
    change = table.remove("a", "P2", 'P2,,11,"a",21,')
    assert table.path.read_text() == TEXT.replace('P2,,11,"a",21,\n', "")
    assert [row.xy for row in table.of_name("P1")] == [(10.5, 20.25), (12, 22)]
    table.undo("a", "P2", change)
    assert table.of_name("P2")[0].xy == (11, 21)


def test_line_ends_and_byte_order_mark_stay(tmp_path: Path) -> None:
    raw = b"\xef\xbb\xbfimage,point,x,y,,\r\n# note\r\na,P1,1,2,,\r\n"
    table = _table(tmp_path, raw)
    table.measure("b", "P1", "", CELLS)
    assert table.path.read_bytes() == raw + b"b,P1,1.5,2.5,,\r\n"


def test_a_link_stays_a_link(tmp_path: Path) -> None:
    kept = tmp_path / "kept.d" / "image_points.csv"
    kept.parent.mkdir()
    kept.write_text(TEXT)
    link = tmp_path / "image_points.csv"
    link.symlink_to(kept)
    MeasuredTable(link, NEW).measure("c", "P9", "", CELLS)
    assert link.is_symlink()
    assert kept.read_text().endswith("P9,,1.5,c,2.5,\n")


def test_two_pages_do_not_lose_each_others_rows(tmp_path: Path) -> None:
    one, other = _table(tmp_path), MeasuredTable(tmp_path / "image_points.csv", NEW)
    one.measure("c", "P9", "", CELLS)
    other.measure("c", "P8", "", CELLS)
    assert one.path.read_text() == TEXT + "P9,,1.5,c,2.5,\nP8,,1.5,c,2.5,\n"


def test_the_same_row_changed_twice_is_refused_by_name(tmp_path: Path) -> None:
    one, other = _table(tmp_path), MeasuredTable(tmp_path / "image_points.csv", NEW)
    seen = one.of_image("a")[0].line
    one.measure("a", "P1", seen, CELLS)
    before = one.path.read_bytes()
    with pytest.raises(ChangedMeanwhile, match=r"point P1 in image a was changed meanwhile.* it is x 1.5, y 2.5"):
        other.measure("a", "P1", seen, {"x": "3", "y": "4"})
    with pytest.raises(ChangedMeanwhile, match=r"it is x 1\.5"):
        other.measure("a", "P1", "", CELLS)
    assert one.path.read_bytes() == before


def test_an_undo_of_what_an_editor_has_changed_is_refused(tmp_path: Path) -> None:
    table = _table(tmp_path)
    change = table.measure("c", "P9", "", CELLS)
    table.path.write_text(TEXT + "P9,,7,c,8,\n")
    with pytest.raises(ChangedMeanwhile, match=r"x 7\.0, y 8\.0"):
        table.undo("c", "P9", change)
    assert table.path.read_text() == TEXT + "P9,,7,c,8,\n"


def test_a_file_that_an_editor_has_broken_is_left_alone(tmp_path: Path) -> None:
    table = _table(tmp_path)
    broken = TEXT.replace("11", "eleven")
    table.path.write_text(broken)
    with pytest.raises(InputError, match="eleven"):
        table.measure("c", "P9", "", CELLS)
    assert table.path.read_text() == broken


def test_a_file_that_is_not_there_is_made(tmp_path: Path) -> None:
    table = MeasuredTable(tmp_path / "fiducials.csv", ("image", "fiducial", "x", "y", "sx", "sy"))
    table.measure("a", "1", "", CELLS | {"sx": "0.5", "sy": "0.5"})
    assert table.path.read_text() == "image,fiducial,x,y,sx,sy\na,1,1.5,2.5,0.5,0.5\n"
