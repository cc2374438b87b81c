"""SOCET's samples equal the tables that came with them; damaged files."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from aatri.formats.parts.format import Reading
from aatri.formats.socet.reader import read_gpf, read_ipf, read_points
from aatri.frames.conversion import crs_of

GPF = """GROUND POINT FILE
2
point_id,stat,known,lat_Y_North,long_X_East,ht,sig(3),res(3)
A 1 1
0.085  2.38  -2697.5
0.1 0.2 1.7
1 2 3

B 1 0
0.086  2.39  -2700.0
0 0 0
1 2 3
"""
IPF = """IMAGE POINT FILE
2
pt_id,val,fid_val,no_obs,l.,s.,sig_l,sig_s,res_l,res_s,fid_x,fid_y
A 1 0 0
-4058.5  -2318.25
0.5  0.25
0 0
0 0

B 0 0 0
10 20
0 0
0 0
0 0
"""


@pytest.fixture
def samples(interchange: Path) -> Path:
    return interchange / "socet"


def written(tmp_path: Path, text: str, name: str = "img_1.ipf") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("name", "table", "kind"),
    [
        ("GXP_example_gpf.gpf", "GXP_example_gpf.csv", ("GROUND POINT FILE", 2, (3, 3, 3))),
        ("InSightE08_XW.gpf", "InSightE08_XW.csv", ("GROUND POINT FILE", 2, (3, 3, 3))),
        ("P20_008845_1894_XN_09N203W.ipf", "P20_008845_1894_XN_09N203W.csv", ("IMAGE POINT FILE", 3, (2, 2, 2, 2))),
    ],
)
def test_points_equal_the_table_that_came_with_them(
    samples: Path, name: str, table: str, kind: tuple[str, int, tuple[int, ...]]
) -> None:
    _, points = read_points(samples / name, *kind)
    with (samples / table).open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    assert len(points) == len(rows)
    for point, row in zip(points, rows):
        numbers = [float(word) for word in row[1:] if not word.startswith("P20")]
        own = [*point.flags, *(v for line in point.rows for v in line)]
        own += [0.0] * (len(numbers) - len(own))  # points without eigenvalues have zeros in the table
        assert point.id == row[0]
        np.testing.assert_allclose(own, numbers, rtol=1e-15)


def test_every_sample_is_read(samples: Path) -> None:
    for path in sorted(samples.glob("*.gpf")):
        assert len(read_gpf(path, Reading(crs="EPSG:4979")).ground_points["point"]) > 0
    for path in sorted(samples.glob("*.ipf")):
        if path.name != "GXP_example_ipf.ipf":  # all its points are invalid
            assert len(read_ipf(path).image_points["point"]) > 0
    assert read_gpf(samples / "InSightE08_string_id.gpf", Reading(crs="EPSG:4979")).ground_points["point"] == [
        "1",
        "02",
        "3",
    ]


def test_units_order_and_roles(tmp_path: Path) -> None:
    """Line comes before sample; radians become degrees, longitude first; kind 0 is a start value."""
    parts = read_ipf(written(tmp_path, IPF))
    assert parts.image_points["image"] == "img_1"
    assert parts.image_points["xy"] == [[-2318.25, -4058.5]]
    assert parts.image_points["sigma_px"].tolist() == [[0.25, 0.5]]
    assert parts.notes == ["1 point is not valid"]
    ground = read_gpf(written(tmp_path, GPF), Reading(crs="EPSG:4979")).ground_points
    np.testing.assert_allclose(ground["xyz_m"][0], [math.degrees(2.38), math.degrees(0.085), -2697.5], rtol=1e-15)
    assert ground["role"].tolist() == [[3, 3, 1], [3, 3, 3]]
    np.testing.assert_array_equal(ground["sigma_m"], [[0.0, 0.0, 1.7], [0.0, 0.0, 0.0]])


def test_a_missing_ellipsoid_is_asked_for_with_the_line_to_add(tmp_path: Path) -> None:
    """MARS2000 has b = 3376200 m; the line that is proposed is taken as it stands."""
    path = written(tmp_path, GPF, "p.gpf")
    what = r"p.gpf:4: point A is at latitude 0.085, longitude 2.38 radians, and no line of the file names the ellipsoid"
    with pytest.raises(AatriError, match=what + r"(?s:.*)on Earth `--set crs=EPSG:4979`, on Mars"):
        read_gpf(path)
    (tmp_path / "a.prj").write_text('GEOGCS["WGS 84"]\n')
    (tmp_path / "m.prj").write_text("PROJECT_FILE m\nA_EARTH  3.39619e6\nE_EARTH  1.08339143554195e-001\n")
    with pytest.raises(AatriError, match=r"as m.prj beside it has it, `--set \"crs=") as refused:
        read_gpf(path)
    proposed = str(refused.value).partition('"crs=')[2].partition('"')[0]
    frame = read_gpf(path, Reading(crs=proposed)).frame
    assert frame is not None
    assert crs_of(frame).ellipsoid.semi_minor_metre == pytest.approx(3376200.0, abs=1e-6)


@pytest.mark.parametrize("stated", ["A_EARTH x\nE_EARTH 0.1", "A_EARTH 3396190\nE_EARTH 1.5"])
def test_an_ellipsoid_of_the_header_that_is_none_is_refused(tmp_path: Path, stated: str) -> None:
    with pytest.raises(AatriError, match=r"img_1.ipf:[23]: "):
        read_gpf(written(tmp_path, GPF.replace("\n2\n", f"\n{stated}\nGXP_XY_UNITS 8\n2\n")))


DAMAGE = [
    (read_gpf, GPF.replace("GROUND", "GROUNDS"), r":1: the first line is not 'GROUND POINT FILE'"),
    (read_gpf, GPF.replace("\n2\n", "\n3\n"), r":2: 3 points are announced, 2 are there"),
    (read_gpf, GPF[:-6], r":9: point B ends early"),
    (read_gpf, GPF.replace("B 1 0", "A 1 0"), r":9: point A twice, first in line 4"),
    (read_gpf, GPF.replace("B 1 0", "B 1 7"), r":9: point B is of kind 7"),
    (read_gpf, GPF.replace("B 1 0", "B 1 x"), r":9: 'x' is no count"),
    (read_gpf, GPF.replace("0.086", "0,086"), r":10: '0,086': a decimal comma"),
    (read_gpf, GPF.replace("0.086", "nan"), r":10: 'nan'"),
    (read_gpf, GPF.replace("0.1 0.2 1.7", "0.1 0.2"), r":6: 2 words where 3 numbers of point A should stand"),
    (read_gpf, GPF.split("point_id")[0].replace("2\n", ""), r":1: the number of points is not there"),
    (read_ipf, IPF.replace("A 1 0 0", "A 0 0 0"), r":2: none of 2 points is used"),
    (read_ipf, "<html>", r":1: this is a web page"),
    (read_ipf, GPF, r":1: the first line is not 'IMAGE POINT FILE'"),
    (read_ipf, IPF.replace("10 20", "10 20 30"), r":11: 3 words where 2 numbers of point B should stand"),
]


@pytest.mark.parametrize(("read", "text", "message"), DAMAGE)
def test_damaged_files_are_refused_with_their_place(tmp_path: Path, read: object, text: str, message: str) -> None:
    assert callable(read)
    with pytest.raises(AatriError, match=message) as refused:
        read(written(tmp_path, text))
    assert "fix: " in str(refused.value)
