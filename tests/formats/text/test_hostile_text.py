"""Texts made to harm: without end, without a file behind them, with numbers of no quantity."""

from __future__ import annotations

import difflib
import os
import re
from pathlib import Path

import pytest

from aatri import ids
from aatri.errors import AatriError, Errors, InputError
from aatri.formats.tables.writer import write_block
from aatri.formats.text.csv_cells import shielded, start_of_cell, unshielded
from aatri.formats.text.json_text import JsonText
from aatri.formats.text.number_text import number_of, numbers_of, whole_number_of
from aatri.ids import clipped, did_you_mean
from aatri.strict_yaml import loads
from tests.contract.made_files import colmap_model
from tests.formats.tables.block_folder import FILES, replaced, write_folder
from tests.reading import read_block, read_colmap


def fault_of(folder: Path) -> str:
    """The faults of a block folder, all of the kind that a user causes."""
    with pytest.raises(AatriError) as caught:
        read_block(folder)
    error = caught.value
    assert {e.exit_code for e in (error.errors if isinstance(error, Errors) else (error,))} == {3}
    return str(error)


@pytest.mark.parametrize("cell", ["9" * 40_000 + "x", "1" * 40_000, "1." + "2" * 40_000, "1e" + "3" * 40_000])
def test_a_cell_of_any_length_is_refused_at_once_and_not_echoed(tmp_path: Path, cell: str) -> None:
    text = fault_of(write_folder(tmp_path / "b", replaced("image_points.csv", "1,a1,10.5", f"1,a1,{cell}")))
    assert "a text of 40" in text
    assert len(text) < 1000
    with pytest.raises(ValueError, match="characters"):
        number_of(cell)


def test_an_id_of_any_length_is_not_echoed(tmp_path: Path) -> None:
    for change in (
        replaced("images.csv", "a2,007", f"{'y' * 40_000},007"),
        replaced("images.csv", "a2,007", f"a2,{'z' * 40_000}"),
        replaced("block.yaml", "name: bit", f"{'k' * 40_000}: bit"),
        replaced("geodetic.csv", "distance,1,2", f"{'d' * 40_000},1,2"),
    ):
        text = fault_of(write_folder(tmp_path / "b", change))
        assert all(len(line) < 1000 for line in text.splitlines())


def test_errors_are_bounded_and_have_a_form_in_utf_8() -> None:
    error = InputError("x" * 10**6 + "\udcff", where="y" * 10**6)
    assert len(str(error)) < 25_000
    str(error).encode()


def test_the_search_for_the_nearest_name_looks_at_few_names(monkeypatch: pytest.MonkeyPatch) -> None:
    looked_at = []
    compare = difflib.get_close_matches

    def counting(word: str, names: list[str], **how: float) -> list[str]:
        looked_at.append(len(names))
        return compare(word, names, **how)  # type: ignore[arg-type]

    monkeypatch.setattr(difflib, "get_close_matches", counting)
    known = [f"P{k:06d}" for k in range(100_000)]
    assert did_you_mean("P000042x", known) != ""
    assert max(looked_at) <= ids.MOST_COMPARED
    assert did_you_mean("P" * 10_000, known) == ""
    assert did_you_mean("imges", ["images", "points"]) == " - did you mean 'images'?"


def test_a_word_cut_short_is_near_what_it_begins_and_a_number_is_not() -> None:
    assert did_you_mean("max_iter", ["max_sigma0", "max_iterations"]) == " - did you mean 'max_iterations'?"
    assert did_you_mean("101", ["10100100"]) == ""
    assert did_you_mean("P10", ["P10100100"]) == ""


@pytest.mark.parametrize("text", ["1e308", "-1e200", "9" * 200, "1e-200", "-1e-400", f"0.{'0' * 200}1"])
def test_a_number_whose_square_is_none_is_no_quantity(tmp_path: Path, text: str) -> None:
    as_json = tmp_path / "a.json"
    as_json.write_text(f"[{text}]")
    with pytest.raises(ValueError, match=r"too (large|small)"):
        number_of(text)
    assert numbers_of(["1", text, ""])[1] == [1]
    with pytest.raises(AatriError, match=r"too (large|small)"):
        loads(f"a: {text}")
    with pytest.raises(AatriError, match=r"too (large|small)"):
        JsonText(as_json, "a list")
    for name, old in (
        ("ground_points.csv", "6.378"),
        ("image_points.csv", "20.25"),
        ("exterior.csv", "385.1"),
        ("geodetic.csv", "141.42"),
        ("block.yaml", "153.84"),
        ("relative_control.yaml", "200.05"),
    ):
        fault = fault_of(write_folder(tmp_path / "b", replaced(name, old, text)))
        assert re.search("too (large|small)|not a number", fault)


@pytest.mark.parametrize("text", ["0", "-0.000", "0e-999", ".0", "1e-99"])
def test_a_zero_is_one_however_it_is_written(text: str) -> None:
    assert abs(number_of(text)) < 1e-98
    assert numbers_of([text, "1"])[1] == []


def test_whole_numbers_are_digits_within_64_bits() -> None:
    assert whole_number_of("-17") == -17
    for text in ("1e2", "1.0", str(2**63), "1_0", "", "9" * 5000, "１"):
        with pytest.raises(ValueError, match=r"whole number|beyond"):
            whole_number_of(text)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("cameras", "1 SIMPLE_PINHOLE 1000", "1 SIMPLE_PINHOLE 1e3"),
        ("cameras", "1 SIMPLE", "1.0 SIMPLE"),
        ("images", "1 1 0 0 0", "9223372036854775808 1 0 0 0"),
        ("images", " 1\n", " 9223372036854775808\n"),
        ("points3D", "1 -1.0", "9223372036854775808 -1.0"),
        ("points3D", "1 -1.0", "1e0 -1.0"),
        ("images", " 8\n", " 8.0\n"),
        ("cameras", "900", "1e308"),
    ],
)
def test_numbers_of_colmap_that_do_not_fit_are_refused(tmp_path: Path, name: str, old: str, new: str) -> None:
    folder = colmap_model(tmp_path / "m")
    path = folder / f"{name}.txt"
    text = path.read_text()
    if old == " 1\n":
        text, old = text.replace("1.jpg\n", "1.jpg\n", 1), "0 0 1 1.jpg"
        new = "0 0 9223372036854775808 1.jpg"
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError):
        read_colmap(folder)


def test_a_track_longer_than_its_file_is_refused(tmp_path: Path) -> None:
    from aatri.formats.results.oriented_block import OrientedBlock
    from tests.formats.start_solution import start_solution, write_binary

    block = read_colmap(colmap_model(tmp_path / "m"))
    write_binary(OrientedBlock(block, start_solution(block)), tmp_path / "b")
    path = tmp_path / "b" / "points3D.bin"
    data = path.read_bytes()
    path.write_bytes(data[: 8 + 43] + (2**62).to_bytes(8, "little") + data[8 + 51 :])
    with pytest.raises(InputError, match="ends at byte"):
        read_colmap(tmp_path / "b")


def test_a_quote_in_a_header_or_cell_is_placed(tmp_path: Path) -> None:
    assert start_of_cell('a"b,c', 1) == 5
    assert start_of_cell('"a,b", c', 1) == 8
    assert start_of_cell('a"', 5) == 1
    for name in ("geodetic.csv", "ground_points.csv"):
        first = FILES[name].splitlines()[0]
        for header in (first.replace(",", '",', 1), first.replace(",", ',"', 1), f'{first}"', f'"{first}'):
            fault_of(write_folder(tmp_path / "b", replaced(name, first, header)))


@pytest.mark.parametrize("name", sorted(FILES))
def test_a_table_that_is_a_link_to_nothing_or_a_pipe_is_not_absent(tmp_path: Path, name: str) -> None:
    folder = write_folder(tmp_path / "b", {name: None})
    (folder / name).symlink_to("gone")
    assert "is a link to gone, which is not there" in fault_of(folder)
    (folder / name).unlink()
    os.mkfifo(folder / name)
    assert "a pipe, not a file" in fault_of(folder)


def test_a_block_without_cameras_says_so_and_a_network_needs_none(tmp_path: Path) -> None:
    text = FILES["block.yaml"]
    without = {"block.yaml": text[: text.index("cameras:")]}
    assert "camera '007' is unknown" in fault_of(write_folder(tmp_path / "b", without))
    network = dict.fromkeys(("images.csv", "image_points.csv", "fiducials.csv", "exterior.csv"))
    rows = FILES["geodetic.csv"].replace("height_difference,K,a1,378.7,0.01,,,,,image\n", "")
    block = read_block(write_folder(tmp_path / "n", without | network | {"geodetic.csv": rows}))
    assert len(block.images) == len(block.cameras) == 0


@pytest.mark.parametrize("text", ["=1+1", "+5", "-A", "@x", "'=1", "''-x", "'quiet", "plain"])
def test_formulas_are_shielded_and_come_back(text: str) -> None:
    cell = shielded(text)
    assert not cell.startswith(("=", "+", "-", "@"))
    assert unshielded(cell) == text


def test_an_exported_block_holds_no_formula_and_reads_back_to_the_bit(tmp_path: Path) -> None:
    from aatri.tables.digest import content_digest

    folder = write_folder(tmp_path / "b")
    for path in folder.glob("*.csv"):
        head, rows = path.read_text().split("\n", 1)
        path.write_text(head + "\n" + rows.replace("0123", "=1+1").replace(",s1,", ",-s1,"))
    control = folder / "relative_control.yaml"
    control.write_text(control.read_text().replace("0123", '"=1+1"'))
    block = read_block(folder)
    write_block(block, tmp_path / "out")
    for path in (tmp_path / "out").glob("*.csv"):
        for line in path.read_text().splitlines()[1:]:
            assert not any(cell.startswith("=") for cell in line.split(","))
    assert "'=1+1" in (tmp_path / "out" / "image_points.csv").read_text()
    assert content_digest(read_block(tmp_path / "out")) == content_digest(block)


def test_what_is_clipped_says_how_long_it_was() -> None:
    assert clipped("a\x1b" + "b" * 200).endswith("(202 characters)")
    assert clipped("short\x1b") == "short\\x1b"


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("line", ["x" * 1_000_000 + ",", '"' * 1_000_000, 'a"' * 500_000 + ",b", ',"' * 500_000])
def test_the_place_of_a_cell_is_found_at_once_in_a_line_of_any_length(line: str) -> None:
    for index in (0, 1, 7):  # a scan that looks back at every quote would take hours
        assert 1 <= start_of_cell(line, index) <= len(line) + 1


@pytest.mark.parametrize("kind", ["[a, b]", "{a: 1}", "~", "5"])
def test_a_condition_whose_type_is_no_text_is_refused(tmp_path: Path, kind: str) -> None:
    text = FILES["relative_control.yaml"].replace("type: sphere", f"type: {kind}", 1)
    told = fault_of(write_folder(tmp_path / "b", {"relative_control.yaml": text}))
    assert "relative_control.yaml:6:" in told
    assert "unknown condition" in told
