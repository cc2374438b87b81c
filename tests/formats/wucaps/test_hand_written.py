"""WuCAPS files written by hand: what each figure becomes, and figures just inside and just outside what is allowed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import CHECK, CONTROL, NO_ROLE, Block
from aatri.errors import AatriError
from tests.reading import read_wucaps

FILES = {
    "PRECAI.DAT": """\
    1    2
  153.84   0.011   -0.002
  0.0  0.0  0.0
    2   -106.001   -106.004
    1    106.002   -106.003
  -99.0  0.0  0.0
""",
    "PREPHI.DAT": """\
   7   2   25000   0
   321   0
     11    8.5    76.0
     12   76.5   -72.0
     13    1.0     2.0
    -99    0.0     0.0
  -320   0
     11   -8.5    75.0
     12   61.5   -71.0
     13    3.0     4.0
    -99    0.0     0.0
   8   1   25000   0
  -400   0
     11    5.0     6.0
     12    7.0     8.0
     13    9.0    10.0
    -99    0.0     0.0
""",
    "PRECKI.DAT": """\
   12   4505079.577   446263.976    6.378
   11   4504679.416   446287.399    4.079
   13   4504321.045   446254.467    7.908
   14   4504321.000   446254.000    7.000
   -99  0.0  0.0  0.0
""",
    "PRECPI.DAT": "  1  1  1\n  11\n  12\n  13\n  14\n",
}


def write(folder: Path, name: str = "", old: str = "", new: str = "") -> Path:
    folder.mkdir()
    for file, text in FILES.items():
        if file == name:
            assert text.count(old) >= 1
            text = text.replace(old, new, 1)
        (folder / file).write_text(text)
    return folder


@pytest.fixture
def block(tmp_path: Path) -> Block:
    return read_wucaps(write(tmp_path / "block"), image_sigma_mm=0.007, control_sigma_m=0.05)


def test_the_camera(block: Block) -> None:
    assert block.cameras.principal_distance_mm.tolist() == [153.84]
    assert block.cameras.principal_point_mm.tolist() == [[0.011, -0.002]]
    assert (block.cameras.kind[0], block.cameras.image_coordinates[0]) == ("film", "photo")
    assert block.fiducials.id.tolist() == ["1", "2"]
    assert block.fiducials.xy_mm.tolist() == [[106.002, -106.003], [-106.001, -106.004]]


def test_photos_keep_the_order_of_the_file_within_their_strips(block: Block) -> None:
    assert block.images.id.tolist() == ["320", "321", "400"]
    assert block.strips.id[block.images.strip].tolist() == ["7", "7", "8"]
    assert block.images.sequence.tolist() == [2.0, 1.0, 3.0]
    assert block.images.line.tolist() == [7, 2, 13]


def test_image_points(block: Block) -> None:
    rows = block.image_points
    found = {
        (str(block.images.id[i]), str(block.points.id[p])): xy.tolist()
        for i, p, xy in zip(rows.image, rows.point, rows.xy)
    }
    assert len(rows) == 9
    assert found["321", "12"] == [76.5, -72.0]
    assert found["320", "11"] == [-8.5, 75.0]
    assert found["400", "13"] == [9.0, 10.0]
    assert (rows.sigma_mm == 0.007).all()
    assert rows.line[(rows.image == 2) & (rows.point == 0)].tolist() == [14]


def test_ground_points_come_as_east_north_up_with_their_roles(block: Block) -> None:
    ground = block.ground_points
    of = {str(block.points.id[p]): k for k, p in enumerate(ground.point)}
    assert ground.xyz_m[of["12"]].tolist() == [446263.976, 4505079.577, 6.378]
    assert ground.role[of["11"]].tolist() == [CONTROL] * 3
    assert ground.role[of["12"]].tolist() == [CONTROL, CONTROL, NO_ROLE]
    assert ground.role[of["13"]].tolist() == [NO_ROLE, NO_ROLE, CONTROL]
    assert ground.role[of["14"]].tolist() == [CHECK] * 3
    np.testing.assert_allclose(ground.covariance_m2, np.tile(0.0025 * np.eye(3), (4, 1, 1)))
    assert ground.line.tolist() == [2, 1, 3, 4]
    assert block.rejects.id.tolist() == ["14"]  # seen in no image


def test_control_is_exact_unless_a_standard_deviation_is_given(tmp_path: Path) -> None:
    assert not read_wucaps(write(tmp_path / "block")).ground_points.covariance_m2.any()


LIMITS = {
    # case: file, text replaced, a text that is allowed, one that is not, where, what is said of it
    "one camera": ("PRECAI.DAT", "1    2", "1  2", "2    2", 1, "2 cameras"),
    "fiducials": ("PRECAI.DAT", "1    2", "1 2", "1    3", 1, "3 fiducials announced, 2 found"),
    "principal distance": ("PRECAI.DAT", "153.84", "0.001", "0", 2, "principal distance 0"),
    "distortion": ("PRECAI.DAT", "0.0  0.0  0.0\n    2", "0 0 0\n 2", "0.0  0.0  1e-9\n    2", 3, "not known"),
    "fiducial twice": ("PRECAI.DAT", "    1    106", "    3    106", "    2    106", 5, "fiducial 2 twice"),
    "a count": ("PRECPI.DAT", "  1  1  1\n", "  1  0  1\n", "  1  -1  1\n", 1, "'-1' is no count"),
    "a long count": ("PRECAI.DAT", "1    2", "1  00000002", "1  000000002", 1, "is no count"),
    "control points": ("PRECPI.DAT", "  1  1  1\n", "  4  0  0\n", "  4  1  0\n", 1, "5 control points announced, 4"),
    "two roles": ("PRECPI.DAT", "  13\n", "  13\n", "  12\n", 4, "two roles"),
    "two ids": ("PRECPI.DAT", "  13\n", "  13\n", "  13 14\n", 4, "2 words where an id should stand"),
    "unknown point": ("PRECPI.DAT", "  14\n", "  14\n", "  15\n", 5, "not in the ground point file"),
    "last photo": ("PREPHI.DAT", "  -400", "  -401", "   320", 13, "photo 320 twice"),
    "strip ends": ("PREPHI.DAT", "  -320", "  -320", "   320", 12, "the last one has no last photo"),
    "photo ends": (
        "PREPHI.DAT",
        "     13    9.0    10.0\n    -99    0.0     0.0\n",
        "     13 9 10\n  -99\n",
        "     13    9.0    10.0\n",
        16,
        "the file ends within photo 400",
    ),
    "four words": (
        "PREPHI.DAT",
        "   12   76.5   -72.0",
        "   12   76.5   -72.0",
        "   12   76.5   -72.0  1",
        4,
        "4 words",
    ),
    "ground twice": ("PRECKI.DAT", "   14  ", "   15  ", "   12  ", 4, "point 12 twice, first in line 1"),
}


@pytest.mark.parametrize("case", LIMITS)
def test_a_figure_is_taken_up_to_its_limit_and_no_farther(tmp_path: Path, case: str) -> None:
    name, old, inside, outside, line, what = LIMITS[case]
    if case == "ground twice":
        assert "15" not in FILES["PRECPI.DAT"]
    else:
        read_wucaps(write(tmp_path / "inside", name, old, inside))
    folder = write(tmp_path / "outside", name, old, outside)
    with pytest.raises(AatriError) as caught:
        read_wucaps(folder)
    assert f"{folder / name}:{line}: " in str(caught.value)
    assert what in str(caught.value)


def test_two_strips_of_one_number_are_named_by_their_order(tmp_path: Path) -> None:
    block = read_wucaps(write(tmp_path / "block", "PREPHI.DAT", "   8   1", "   7   1"))
    assert block.strips.id.tolist() == ["1", "2"]
    assert block.images.strip.tolist() == [0, 0, 1]
