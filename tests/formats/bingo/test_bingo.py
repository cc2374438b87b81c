"""BINGO: numbers that touch, RADI against the calibration of its exporter, a projected point, damaged files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from aatri.formats.bingo.reader import read_geoin, read_image_coordinates
from aatri.formats.metashape.reader import read_metashape
from aatri.formats.parts.assembled import NotStated, assembled
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.registry.recognised import recognised_file

IMAGES = """        a.jpg    cam
       1 1.5 2.25
       2 -0.5 1.0
        -99
        b.jpg
       1 1.0 2.0
        -99
"""
GEOIN = """*  remark
C   <K><__Camera_Name_><___C'___>
CAPA   FC300X_(3.61_mm)3.610000000000000
RADI   FC300X_(3.61_mm)0.200000000000000 0.0 0.1 0.3
COES                0.0050000000000000.0050000000000000.015000000000000
CONT               1-78.904105813860951-108.1740640550851802189.874591963365700
CONT              413.637481734731409-25.7713665920309722184.272946708835700
CONT               5 10.0 20.0 30.0 0.1 0.1 0.2
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "file.dat"
    path.write_text(text)
    return path


@pytest.mark.parametrize("kind", ["pixel", "photo"])
def test_millimetres_are_what_the_camera_of_another_program_says(tmp_path: Path, kind: str) -> None:
    """Metashape exports its tie points so: 1.5 mm to the right and 2.25 mm up of the centre, pixels of 5 and 4 um."""
    own = {"pixel_size_mm": [[0.005, 0.004]], "pixel_origin": ["top-left-corner"], "pixel_y": ["down"]}
    cameras = {
        "id": ["cam"],
        "image_coordinates": [kind],
        "format": [[4000.0, 3000.0]],
        "distortion": ["none"],
        "principal_distance_mm": [10.0],
        "principal_point_mm": [[0.0, 0.0]],
    }
    lens = BlockParts("other", [tmp_path / "lens"], cameras=cameras | (own if kind == "pixel" else {}))
    points = read_image_coordinates(written(tmp_path, IMAGES))
    xy = assembled([points, lens], NotStated(image_sigma_um=5.0)).image_points.xy
    assert xy[0].tolist() == pytest.approx(
        [2000 + 1.5 / 0.005, 1500 - 2.25 / 0.004] if kind == "pixel" else [1.5, 2.25]
    )


def test_image_points_are_mm_with_the_camera_of_the_header_before(tmp_path: Path) -> None:
    parts = read_image_coordinates(written(tmp_path, IMAGES))
    assert parts.images["id"] == ["a.jpg", "b.jpg"]
    assert parts.images["camera"] == ["cam", "cam"]
    assert parts.image_points["xy"] == [[1.5, 2.25], [-0.5, 1.0], [1.0, 2.0]]
    assert parts.image_points["line"] == [2, 3, 6]


def test_a_fourth_column_is_told_and_not_read(tmp_path: Path) -> None:
    path = written(tmp_path, "a.jpg cam\n1 1.5 -2.5 7\n2 3 4 7\n-99\n")
    assert recognised_file(path).format.name == "bingo"
    parts = read_image_coordinates(path)
    assert parts.image_points["xy"] == [[1.5, -2.5], [3.0, 4.0]]
    assert parts.notes == ["a fourth column of 2 image points is not read"]


def test_remarks_are_not_read_and_a_point_of_their_sign_is(tmp_path: Path) -> None:
    text = IMAGES.replace("       1 1.0 2.0", "C made by hand, twice\n* so is this\n       C 1.0 2.0")
    path = written(tmp_path, "* BINGO\nC a remark of several words\n" + text)
    assert recognised_file(path).format.name == "bingo"
    parts = read_image_coordinates(path)
    assert parts.image_points["point"] == ["1", "2", "C"]
    assert parts.images["id"] == ["a.jpg", "b.jpg"]


def test_numbers_that_touch_are_told_apart(tmp_path: Path) -> None:
    """Point 41: its number ends where X begins, in column 20."""
    parts = read_geoin(written(tmp_path, GEOIN))
    assert parts.cameras["id"] == ["FC300X_(3.61_mm)"]
    assert parts.cameras["principal_distance_mm"] == [3.61]
    assert parts.ground_points["point"] == ["1", "41", "5"]
    assert parts.ground_points["xyz_m"][0] == [-78.904105813860951, -108.174064055085180, 2189.874591963365700]
    assert parts.ground_points["xyz_m"][1] == [3.637481734731409, -25.771366592030972, 2184.272946708835700]
    assert parts.ground_points["sigma_m"] == [[0.005, 0.005, 0.015]] * 2 + [[0.1, 0.1, 0.2]]


def test_a_line_of_a_million_digits_is_refused(tmp_path: Path) -> None:
    """It would take an hour where every digit may begin a number that touches the one before."""
    with pytest.raises(AatriError, match=r"file\.dat:8"):
        read_geoin(written(tmp_path, GEOIN.replace("10.0 20.0", f"{'7' * 1_000_000}x 20.0")))


def test_radial_distortion_is_that_of_the_exporter(interchange: Path) -> None:
    """Metashape's k1, k2 of the same lens (lll.xml): measured - ideal = f (k1 r^3 + k2 r^5) at the ideal radius.

    Within the image (3.9 mm) they agree to 3 % of the correction: the two files are of different runs.
    """
    folder = interchange / "bingo"
    parts = read_geoin(folder / "geoin.dat")
    assert len(parts.ground_points["point"]) == 128
    z = np.array(parts.ground_points["xyz_m"])[:, 2]
    assert 2100 < z.min() < z.max() < 2200
    block = assembled([read_image_coordinates(folder / "bi.dat"), parts], NotStated(image_sigma_um=2.0))
    table = block.distortion_table
    assert table is not None
    ideal_mm = table.radius_mm + table.correction_mm
    r = ideal_mm / 3.61
    expected = -3.61 * (-0.0196561700125592 * r**3 + 0.028128529149923 * r**5)
    inside = ideal_mm < 3.9
    assert inside.sum() == 20
    np.testing.assert_allclose(table.correction_mm[inside], expected[inside], rtol=0.05, atol=6e-5 * 20)
    images = read_image_coordinates(folder / "bi.dat")
    assert images.images["id"] == ["B1_1.JPG", "B1_2.JPG"]
    assert images.images["camera"] == ["FC300X_(3.61_mm)"] * 2
    assert len(images.image_points["xy"]) == 1219  # of 607 and 605 points; seven ids stand twice in an image


def test_millimetres_beside_a_camera_in_pixels_of_no_stated_size_are_refused(interchange: Path) -> None:
    """4000 x 3000 pixels, points up to 3.1 mm from the centre: pixels of 0.001 mm, the nominal size, are too small."""
    folder = interchange / "bingo"
    camera = read_metashape(folder / "lll.xml")
    images = read_image_coordinates(folder / "bi.dat")
    images.images = {**images.images, "camera": [""] * 2}
    with pytest.raises(AatriError, match="counts in pixels of which no file states the size"):
        assembled([images, camera])


DAMAGE = [
    (read_image_coordinates, IMAGES[:-12], r":6: the last image does not end with -99"),
    (read_image_coordinates, IMAGES.replace("1.5 2.25", "1,5 2.25"), r":2: '1,5': a decimal comma"),
    (read_image_coordinates, IMAGES.replace("1.5 2.25", "nan 2.25"), r":2: 'nan'"),
    (read_image_coordinates, IMAGES.replace("b.jpg", "a.jpg"), r":5: image a.jpg twice, first in line 1"),
    (read_image_coordinates, IMAGES.replace("1.5 2.25", "1.5 2.25 0 M"), r":2: 5 words inside an image"),
    (read_image_coordinates, IMAGES.replace("1.5 2.25", "1. 5 2.25"), r":2: 4 words, and 3 in most lines: a blank"),
    (read_image_coordinates, IMAGES.replace("1.5 2.25", "1.\u20095 2.25"), r":2: '1.\S+': not a number"),
    (read_image_coordinates, "  a b c d\n", r":1: 4 words where an image should begin"),
    (read_image_coordinates, "<html>404", r":1: this is a web page"),
    (read_image_coordinates, "", r"the file is empty"),
    (
        read_geoin,
        GEOIN + "CONT   G107 607274.5938 3487083.25 2190.5\n",
        r":9: 'G107 607274\.5' in columns 5-20, which end",
    ),
    (read_geoin, GEOIN.replace("413.637", "\t3.637"), r":7: a tabulator"),
    (read_geoin, GEOIN.replace("   5 10.0", "  41 10.0"), r":8: control point 41 twice, first in line 7"),
    (read_geoin, GEOIN.replace("10.0 20.0 30.0 0.1 0.1 0.2", "10.0 20.0"), r":8: CONT 5 with 2 numbers"),
    (read_geoin, GEOIN.replace("0.1 0.1 0.2", "0.1 -0.1 0.2"), r":8: standard deviations \[0.1, -0.1, 0.2\]"),
    (read_geoin, GEOIN.replace("3.610000000000000", "-3.61"), r":3: principal distance -3.61"),
    (read_geoin, GEOIN.replace("10.0 20.0", "10,0 20.0"), r":8: '10,0': a decimal comma"),
    (read_geoin, GEOIN.replace("CAPA   FC", "CAPA   XX"), r":4: camera FC300X_\(3.61_mm\) has no CAPA"),
    (read_geoin, "*only remarks\n", r"no CAPA and no CONT"),
]


@pytest.mark.parametrize(("read", "text", "message"), DAMAGE)
def test_damaged_files_are_refused_with_their_place(tmp_path: Path, read: object, text: str, message: str) -> None:
    assert callable(read)
    with pytest.raises(AatriError, match=message) as refused:
        read(written(tmp_path, text))
    assert "fix: " in str(refused.value)
