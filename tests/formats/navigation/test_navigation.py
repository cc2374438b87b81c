"""DJI's MRK and Applanix' EO text: what they give, and damaged files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from aatri.formats.navigation.applanix import read_applanix
from aatri.formats.navigation.mrk import read_mrk

ROW = "{n}\t{t}\t[2190]\t   12,N\t   -3,E\t  193,V\t31.5,Lat\t121.25,Lon\t88.125,Ellh\t0.011, 0.012, 0.025\t{q},Q\n"
MRK = ROW.format(n=2, t=100.5, q=50) + ROW.format(n=1, t=99.5, q=16)
APPLANIX = """POSPac exterior orientation
Boresight 0.01 0.02 0.03
(position in Meters, orientation in Degrees, lat, long in Deg)
ID, EVENT, TIME(s), EASTING, NORTHING, ELLIPSOID HEIGHT, OMEGA, PHI, KAPPA, LAT, LONG
a1 1 200.5 500000.5 4000000.25 1200.0 0.5 -0.25 90.0 36.0 117.0
a2 2 201.5 500100.5 4000000.25 1201.0 0.5 -0.25 91.0 36.0 117.0
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "list.txt"
    path.write_text(text)
    return path


def test_an_exposure_is_of_the_image_with_its_number(tmp_path: Path) -> None:
    """Longitude first, standard deviations east first; the offset to the antenna is not applied again."""
    for name in ("DJI_20260101_0001.JPG", "DJI_20260101_0002.JPG"):
        (tmp_path / name).touch()
    parts = read_mrk(written(tmp_path, MRK))
    assert parts.exterior["image"] == ["DJI_20260101_0002.JPG", "DJI_20260101_0001.JPG"]
    assert parts.exterior["position_m"][0] == (121.25, 31.5, 88.125)
    assert parts.exterior["sigma_m"][0] == (0.012, 0.011, 0.025)
    assert parts.notes == ["1 exposures without a fixed solution: 1"]
    assert read_mrk(written(tmp_path / "..", MRK)).exterior["image"] == ["2", "1"]


def test_applanix_gives_grid_coordinates_angles_and_times(tmp_path: Path) -> None:
    parts = read_applanix(written(tmp_path, APPLANIX))
    assert parts.images["id"] == ["a1", "a2"]
    assert parts.images["time_s"] == [200.5, 201.5]
    assert parts.exterior["position_m"][1] == [500100.5, 4000000.25, 1201.0]
    np.testing.assert_allclose(np.degrees(parts.exterior["angles_rad"])[0], [0.5, -0.25, 90.0])
    assert parts.notes == ["applied by POSPac: Boresight 0.01 0.02 0.03"]


DAMAGE = [
    (read_mrk, MRK.replace("31.5,Lat", "31,5,Lat"), r":1: 21 words where an exposure"),
    (read_mrk, MRK.replace("31.5,Lat", "nan,Lat"), r":1: 'nan'"),
    (read_mrk, MRK.replace("31.5,Lat", "131.5,Lat"), r":1: latitude 131.5"),
    (read_mrk, MRK.replace("Ellh", "Alt"), r":1: labels N E V Lat Lon Alt Q"),
    (read_mrk, MRK.replace("1\t99", "2\t99"), r":2: exposure 2 twice, first in line 1"),
    (read_mrk, MRK.replace("0.025", "-0.025"), r":1: standard deviations"),
    (read_mrk, MRK[:-20], r":2: \d+ words where an exposure"),
    (read_mrk, "<html>", r":1: this is a web page"),
    (read_applanix, APPLANIX.replace("Degrees", "Radians"), r":3: units \(position in Meters, orientation in Radians"),
    (read_applanix, APPLANIX.replace("OMEGA, PHI", "PHI, OMEGA"), r":4: columns ID EVENT"),
    (read_applanix, APPLANIX.replace("a2", "a1"), r":6: image a1 twice, first in line 5"),
    (read_applanix, APPLANIX.replace("1201.0", "1201,0"), r":6: '1201,0': a decimal comma"),
    (read_applanix, APPLANIX.replace(" 36.0 117.0\na2", "\na2"), r":5: 9 words where a row of the columns"),
    (read_applanix, APPLANIX.split("(position")[0], r":2: no line `\(position in Meters"),
    (read_applanix, "", r"the file is empty"),
]


@pytest.mark.parametrize(("read", "text", "message"), DAMAGE)
def test_damaged_lists_are_refused_with_their_place(tmp_path: Path, read: object, text: str, message: str) -> None:
    assert callable(read)
    with pytest.raises(AatriError, match=message) as refused:
        read(written(tmp_path, text))
    assert "fix: " in str(refused.value)
