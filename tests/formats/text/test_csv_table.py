"""Tables of text, and their code pages."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aatri.errors import AatriError, Faults, InputError, ResourceError
from aatri.formats.text import text_file
from aatri.formats.text.csv_cells import cells_of, start_of_cell
from aatri.formats.text.csv_table import CsvColumn, read_csv
from aatri.formats.text.number_text import number_of, numbers_of, what_is_wrong
from aatri.formats.text.text_file import read_lines

# Strict CSV: cells, places and numbers.

COLUMNS = {"id": CsvColumn("id", "cell"), "x": CsvColumn("number", "cell"), "note": CsvColumn("text")}


@pytest.mark.parametrize("text", ["0", "-1.5", "+2.", ".5", "1e-3", "1E+05", "007"])
def test_plain_numbers_are_numbers(text: str) -> None:
    assert number_of(text) == float(text)


@pytest.mark.parametrize(
    "text",
    ["", "1_000", "nan", "inf", "1e400", "１２", "٣", "1,5", "1 000", "0x10", "\u22121", "1e", ".", "--1", "1d3"],
)
def test_nothing_else_is_a_number(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        number_of(text)
    assert what_is_wrong(text)


@pytest.mark.slow
@given(
    st.lists(st.one_of(st.just(""), st.floats(allow_nan=False, allow_infinity=False).map(repr), st.text(max_size=5)))
)
def test_a_column_is_read_like_its_cells(cells: list[str]) -> None:
    values, bad = numbers_of(cells)
    for k, cell in enumerate(cells):
        try:
            expected = number_of(cell) if cell else np.nan
            assert k not in bad
            np.testing.assert_equal(values[k], expected)
        except ValueError:
            assert k in bad


@pytest.mark.slow
@given(
    st.lists(st.text(st.characters(exclude_characters="\r\n\0")).map(lambda t: t.strip(" \t")), min_size=1, max_size=5)
)
def test_quoted_cells_come_back(cells: list[str]) -> None:
    line = ",".join('"' + cell.replace('"', '""') + '"' for cell in cells)
    assert cells_of(line) == cells


def test_an_open_quote_is_refused() -> None:
    with pytest.raises(csv.Error):
        cells_of('a,"b,c')


def test_a_comma_between_doubled_quotes_separates_nothing() -> None:
    assert start_of_cell('"a""b,c",d', 1) == 10
    assert start_of_cell('1" 2,"3,4", 5', 2) == 13


@pytest.mark.parametrize(("index", "character"), [(0, 1), (1, 3), (2, 12), (3, 14)])
def test_the_place_of_a_cell_is_its_first_character(index: int, character: int) -> None:
    assert start_of_cell('a,"b,""c", d,', index) == character


def test_comments_blank_lines_own_columns_and_blanks_do_not_count(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text('# note\nx , id,x_mine\n\n 1.5 ,"#7", ?\n  # more\n2,8,\n')
    problems = Faults()
    table = read_csv(path, COLUMNS, problems)
    assert problems == []
    assert table.text["id"] == ["#7", "8"]
    assert table.number["x"].tolist() == [1.5, 2.0]
    assert table.text["note"] == ["", ""]
    assert table.line.tolist() == [4, 6]
    assert table.where(0, "id") == f"{path}:4:7"


def test_rows_beyond_one_chunk_keep_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    n = 120_000
    path.write_text("id,x\n" + "".join(f"p{k},{k}.5\n" for k in range(n)) + "last,oops\n")
    problems = Faults()
    table = read_csv(path, COLUMNS, problems)
    assert table.number["x"][:n].tolist() == [k + 0.5 for k in range(n)]
    assert table.line[-1] == n + 2
    assert [problem.where for problem in problems] == [f"{path}:{n + 2}:6"]


@pytest.mark.parametrize(
    ("cell", "reason"),
    [
        ("40-41-12.5", "an angle, 40.6868056 degrees"),  # 40 + 41 / 60 + 12.5 / 3600
        ("-40 30 00", "an angle, -40.5 degrees"),
        ("40\u00b030'00\"S", "a latitude, -40.5 degrees"),
        ("40.7N", "a latitude, 40.7 degrees"),
        ("119.25W", "a longitude, -119.25 degrees"),
        ("40-75-12", "not a number"),  # 75 minutes
        ("2024-11-22", "not a number"),
        ("a7N", "not a number"),
    ],
)
def test_angles_are_told_with_their_decimal_reading(cell: str, reason: str) -> None:
    assert what_is_wrong(cell).startswith(reason)


def test_empty_rows_and_empty_columns_of_a_spreadsheet_do_not_count(tmp_path: Path) -> None:
    problems = Faults()
    path = tmp_path / "t.csv"
    path.write_text("id,x,,\nA,1,,\n,,,\nB,2,,\n , , ,\n,,,,,,\n", encoding="utf-8")
    table = read_csv(path, COLUMNS, problems)
    assert not problems
    assert (table.header, table.text["id"], table.number["x"].tolist()) == (("id", "x"), ["A", "B"], [1.0, 2.0])
    assert table.line.tolist() == [2, 4]


def test_a_cell_in_a_column_without_a_name_is_an_error_at_its_place(tmp_path: Path) -> None:
    problems = Faults()
    path = tmp_path / "t.csv"
    path.write_text("id,x,\nA,1,\nB,2,high\n", encoding="utf-8")
    read_csv(path, COLUMNS, problems)
    (problem,) = problems
    assert problem.what == "'high' stands beyond the 2 columns that have a name"
    assert problem.where == f"{path}:3:5"


def test_an_empty_name_between_others_is_no_column(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("id,,x\nA,,1\n", encoding="utf-8")
    with pytest.raises(AatriError, match="unknown column ''"):
        read_csv(path, COLUMNS, Faults())


def test_a_column_in_another_case_is_suggested(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("ID,X\nA,1\n", encoding="utf-8")
    with pytest.raises(AatriError, match="did you mean 'id'"):
        read_csv(path, COLUMNS, Faults())


@pytest.mark.parametrize("encoding", ["utf-32", "utf-32-le", "utf-32-be"])
def test_text_of_32_bits_a_sign_is_refused_as_that_or_as_no_text(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes("id,x\nA,1\n".encode(encoding))
    with pytest.raises(AatriError, match="UTF-32" if encoding == "utf-32" else "a zero byte"):
        read_csv(path, COLUMNS, Faults())


# Texts of 8 bits are not taken for Chinese, and Chinese is; texts larger than memory are refused before.

WESTERN = [
    "Größe",
    "Übersicht,über,Öl",
    "45°30'N",
    "µm",
    "Straße;GRÖßE",
    "café,naïve",
    "São Paulo,Ñandú",
    "Ærø,Åse",
    "x²,£5",
    "Müller,Jürgen",
]


@pytest.mark.parametrize("text", WESTERN)
@pytest.mark.parametrize("encoding", ["cp1252", "latin-1"])
def test_western_text_is_refused_as_what_it_is(tmp_path: Path, text: str, encoding: str) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(f"point,x\n{text},1\n".encode(encoding))
    with pytest.raises(InputError, match="Windows-1252") as caught:
        read_lines(path)
    assert caught.value.where.endswith("t.csv:2")


@pytest.mark.parametrize("text", ["点号", "控制点1,外业检查点", "像片，比例尺", "武汉大学", "GCP点1", "航线 1"])
def test_chinese_text_is_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(f"{text}\n".encode("gbk"))
    assert read_lines(path) == [text]


def test_a_file_that_memory_cannot_hold_is_refused_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "image_points.csv"
    path.write_bytes(b"image,point,x,y\n")
    os.truncate(path, os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))  # a hole as large as memory
    monkeypatch.setattr(text_file, "memory_bytes", lambda: 6e9)  # of a container
    with pytest.raises(ResourceError, match="GB of memory to read, and there are 6 GB here"):
        read_lines(path)
