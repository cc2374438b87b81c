"""The same thing twice counts once and is named; what is only nearly the same counts twice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import CHECK, CONTROL, NO_ROLE, Block
from aatri.errors import InputError
from aatri.formats.tables.writer import write_block
from aatri.progress import Silent
from tests.campaigns.fuzz_seeds import BAL
from tests.checks.as_read.test_screening import Written, rejects
from tests.formats.tables.block_folder import FILES, write_folder
from tests.reading import read_bal, read_block


class Heard(Silent):
    """Keeps warnings."""

    def __init__(self) -> None:
        self.warned: list[str] = []

    def warn(self, message: str) -> None:
        self.warned.append(message)


def test_an_image_point_copied_to_the_last_digit_counts_once(tmp_path: Path) -> None:
    of = Written()
    of.points += ["i1,p3,13.0,12.8750", "i1,p4,14.0001,13.875"]  # the row of i1/p3 again; i1/p4 measured again
    block = of.read(tmp_path)
    assert [r[:2] for r in rejects(block)] == [("image_point", "i1/p3")]
    assert "every digit" in str(block.rejects.reason[0])
    assert block.image_points.active.sum() == 41
    write_block(block, tmp_path / "copy")
    assert rejects(read_block(tmp_path / "copy")) == rejects(block)


def test_an_image_given_twice_counts_once_and_both_are_named(tmp_path: Path) -> None:
    of = Written()
    of.images += ["i9"]
    of.points += [row.replace("i0,", "i9,") for row in of.points if row.startswith("i0,")]
    block = of.read(tmp_path)
    assert ("image", "i9", "its measurements are those of image i0: count once") in rejects(block)
    assert block.images.active.tolist() == [True] * 4 + [False]
    assert block.image_points.active.sum() == 40


@pytest.mark.parametrize("known", ["i1", "a0", ""])
def test_of_an_image_given_twice_that_goes_on_which_is_known_or_fits_its_strip(tmp_path: Path, known: str) -> None:
    """A copy that is before it in the order of ids, and at the end of its strip."""
    rows = [(k, j, f"{10 + j},{10 + j - k / 8}") for k in range(5) for j in range(5 * k, 5 * k + 15)]
    points = [f"i{k},p{j},{xy}" for k, j, xy in rows] + [f"a0,p{j},{xy}" for k, j, xy in rows if k == 1]
    of = Written(
        images=[*(f"i{k}" for k in range(5)), "a0"],
        points=points,
        exterior=[f"{known},0,0,1000,observed"] if known else [],
    )
    of.read(tmp_path)
    images = [*(f"i{k},c,s,{k + 1}" for k in range(5)), "a0,c,s,6"]
    (tmp_path / "images.csv").write_text("\n".join(["image,camera,strip,sequence", *images]) + "\n")
    out = "a0" if known != "a0" else "i1"
    assert [name for kind, name, _ in rejects(read_block(tmp_path)) if kind == "image"] == [out]


@pytest.mark.parametrize("shift", ["0", "0.001"])
def test_an_image_with_one_other_coordinate_is_another(tmp_path: Path, shift: str) -> None:
    of = Written()
    of.images += ["i9"]
    of.points += [row.replace("i0,", "i9,") for row in of.points if row.startswith("i0,")]
    of.points[-1] = f"i9,p9,{19 + float(shift)!r},19"
    assert of.read(tmp_path).images.active.tolist() == [True] * 4 + [shift != "0"]


def test_a_second_feature_at_one_place_counts_once_where_it_is_so_in_two_images(tmp_path: Path) -> None:
    of = Written()
    xy = {row.split(",")[0]: ",".join(row.split(",")[2:]) for row in of.points if ",p3," in row}
    of.points += [f"i0,second,{xy['i0']}", f"i1,second,{xy['i1']}", "i2,second,1,1", "i3,second,2,2"]
    of.points += [f"i0,chance,{xy['i0']}", "i1,chance,5,7", "i2,chance,5,8"]
    heard = Heard()
    found = rejects(of.read(tmp_path, heard))
    assert [r[:2] for r in found] == [("image_point", "i0/second"), ("image_point", "i1/second")]
    assert any("1 point lies at the very place" in w and w.endswith("second (as p3)") for w in heard.warned)


def test_the_second_feature_of_control_is_the_one_that_goes(tmp_path: Path) -> None:
    of = Written()
    of.points += [row.replace(",p3,", ",zc,") for row in of.points if ",p3," in row]
    of.ground = ["zc,1,2,3,control"]
    block = of.read(tmp_path)
    assert {r[1] for r in rejects(block)} == {f"i{k}/p3" for k in range(4)}


def test_control_and_check_at_the_same_coordinates_count_once_as_control(tmp_path: Path) -> None:
    of, heard = Written(), Heard()
    of.ground = ["p1,1.5,2,3,check", "p2,1.50,2,3,control", "p3,1.5,2,3.001,check", "p4,1.5,2,3,approximate"]
    block = of.read(tmp_path, heard)
    assert block.ground_points.role[:, 0].tolist() == [NO_ROLE, CONTROL, CHECK, 3]
    (told,) = [w for w in heard.warned if "every digit" in w]
    assert "ground_points.csv:2: p1 has the coordinates of p2" in told


def test_a_geodetic_observation_copied_counts_once_but_not_two_of_a_set(tmp_path: Path) -> None:
    of = Written()
    of.geodetic = ["distance,p1,p2,100,0.01,", "distance,p1,p2,100.0,0.01,", "distance,p1,p2,100,0.02,"]
    block = of.read(tmp_path)
    assert block.geodetic.active.sum() == 2
    assert [r[:2] for r in rejects(block)] == [("geodetic", "distance p1 p2")]


@pytest.mark.parametrize(
    "name", ["images.csv", "fiducials.csv", "ground_points.csv", "exterior.csv", "covariances.csv"]
)
def test_a_row_copied_in_any_table_counts_once(tmp_path: Path, name: str) -> None:
    row = FILES[name].splitlines()[2 if name != "covariances.csv" else 1]
    heard = Heard()
    once = read_block(write_folder(tmp_path / "once"))
    twice = read_block(write_folder(tmp_path / "twice", {name: f"{FILES[name].rstrip()}\n{row}\n"}), heard)
    assert any(name in w and "counted once" in w for w in heard.warned)
    _equal(once, twice)
    other = row.rsplit(",", 1)[0] + ",77"
    if name in ("fiducials.csv", "covariances.csv"):
        with pytest.raises(InputError, match="twice"):
            read_block(write_folder(tmp_path / "other", {name: f"{FILES[name].rstrip()}\n{other}\n"}))


def test_a_relative_condition_copied_counts_once(tmp_path: Path) -> None:
    text = FILES["relative_control.yaml"].rstrip()
    heard = Heard()
    once = read_block(write_folder(tmp_path / "once"))
    changed = f"{text}\n{text.splitlines()[1]}\n"
    _equal(once, read_block(write_folder(tmp_path / "twice", {"relative_control.yaml": changed}), heard))
    assert any("relative_control.yaml" in w and "count once" in w for w in heard.warned)


def test_a_problem_that_is_defined_by_all_its_rows_keeps_them(tmp_path: Path) -> None:
    rows = BAL.splitlines()
    rows[0] = "3 5 15"
    features = [row.replace(" 1 ", " 4 ", 1) for row in rows[1:13] if row.split()[1] == "1"]
    path = tmp_path / "twice.txt"
    path.write_text("\n".join([*rows[:13], *features, *rows[13:], "1.5", "0", "-0.1"]) + "\n")
    assert read_bal(path).image_points.active.all()


def _equal(a: Block, b: Block) -> None:
    for table in ("images", "fiducial_points", "ground_points", "exterior", "relative_control", "image_points"):
        for column, values in vars(getattr(a, table)).items():
            if column not in ("line", "file"):
                np.testing.assert_array_equal(values, getattr(getattr(b, table), column))
