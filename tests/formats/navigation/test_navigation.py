"""DJI's MRK: what it gives, and damaged files."""

from __future__ import annotations

from pathlib import Path

import pytest

from aatri.errors import AatriError
from aatri.formats.navigation.mrk import read_mrk

ROW = "{n}\t{t}\t[2190]\t   12,N\t   -3,E\t  193,V\t31.5,Lat\t121.25,Lon\t88.125,Ellh\t0.011, 0.012, 0.025\t{q},Q\n"
MRK = ROW.format(n=2, t=100.5, q=50) + ROW.format(n=1, t=99.5, q=16)


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
    assert parts.notes == ["1 exposure without a fixed solution: 1"]
    assert read_mrk(written(tmp_path / "..", MRK)).exterior["image"] == ["2", "1"]


DAMAGE = [
    (read_mrk, MRK.replace("31.5,Lat", "31,5,Lat"), r":1: 21 words where an exposure"),
    (read_mrk, MRK.replace("31.5,Lat", "nan,Lat"), r":1: 'nan'"),
    (read_mrk, MRK.replace("31.5,Lat", "131.5,Lat"), r":1: latitude 131.5"),
    (read_mrk, MRK.replace("Ellh", "Alt"), r":1: labels N E V Lat Lon Alt Q"),
    (read_mrk, MRK.replace("1\t99", "2\t99"), r":2: exposure 2 twice, first in line 1"),
    (read_mrk, MRK.replace("0.025", "-0.025"), r":1: standard deviations"),
    (read_mrk, MRK[:-20], r":2: \d+ words where an exposure"),
    (read_mrk, "<html>", r":1: this is a web page"),
]


@pytest.mark.parametrize(("read", "text", "message"), DAMAGE)
def test_damaged_lists_are_refused_with_their_place(tmp_path: Path, read: object, text: str, message: str) -> None:
    assert callable(read)
    with pytest.raises(AatriError, match=message) as refused:
        read(written(tmp_path, text))
    assert "fix: " in str(refused.value)
