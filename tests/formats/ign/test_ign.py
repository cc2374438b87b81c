"""IGN's lists: what they hold, and what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from aatri.errors import AatriError
from aatri.formats.ign.reader import read_camera, read_ground_points, read_marks

FILES = {
    "mes": '\n"1003" 1306 24042.25 14781.17 \n"1003" 1307 24120.2 10329.3 ',
    "app": '"1003" 13 815601.510 6283629.280 54.960 \n"1005" 3 833670.940 6281965.400 52.630 0.1 0.1 0.2',
    "camera": "Name = UCE s06\nPPAx = 13210.00\nPPAy = 8502.00\nfocal = 30975.00\nwidth = 26460\nheight = 17004\n",
}
READERS = {"mes": read_marks, "app": read_ground_points, "camera": read_camera}


def written(tmp_path: Path, kind: str, text: str) -> Path:
    path = tmp_path / f"list.{kind}"
    path.write_text(text)
    return path


def test_the_lists_give_what_they_hold(tmp_path: Path) -> None:
    marks = read_marks(written(tmp_path, "mes", FILES["mes"]))
    assert marks.image_points["point"] == ["1003", "1003"]
    assert marks.image_points["line"] == [2, 3]
    points = read_ground_points(written(tmp_path, "app", FILES["app"]))
    assert points.ground_points["xyz_m"][1] == [833670.94, 6281965.4, 52.63]
    assert math.isnan(points.ground_points["sigma_m"][0][0])
    assert points.ground_points["sigma_m"][1] == [0.1, 0.1, 0.2]
    camera = read_camera(written(tmp_path, "camera", FILES["camera"]))
    assert camera.cameras["id"] == ["UCE s06"]
    assert camera.cameras["principal_point_mm"].tolist() == [[pytest.approx(-0.02), pytest.approx(0.0)]]
    assert camera.cameras["principal_distance_mm"].tolist() == [pytest.approx(30.975)]


def test_a_name_in_quotes_may_have_blanks(tmp_path: Path) -> None:
    points = read_ground_points(written(tmp_path, "app", '"P 1" 13 1.5 2.5 3.5\r\n'))
    assert points.ground_points["point"] == ["P 1"]
    assert points.ground_points["xyz_m"] == [[1.5, 2.5, 3.5]]


DAMAGE = [
    ("mes", (" 14781.17", ""), r":2: 3 words where `point image column row`"),
    ("mes", ("24042.25", "24042,25"), r":2: '24042,25': a decimal comma"),
    ("mes", ("24120.2", "nan"), r":3: 'nan': not a finite number"),
    ("mes", ("1307", "1306"), r":3: point \"1003\" in image 1306 twice, first in line 2"),
    ("mes", ('"1003" 1306', '"" 1306'), r":2: '\"\"' is no name"),
    ("mes", "<html>404</html>", r":1: this is a web page"),
    ("app", ("1005", "1003"), r":2: ground point 1003 twice, first in line 1"),
    ("app", (" 0.1 0.1 0.2", " 0.1 0.1"), r":2: 7 words"),
    ("app", ("0.1 0.2", "-0.1 0.2"), r":2: standard deviations 0.1, -0.1, 0.2"),
    ("app", ("13 815", "x 815"), r":1: 'x' is no count"),
    ("camera", ("focal = 30975.00\n", ""), r":5: focal missing"),
    ("camera", ("30975.00", "-120"), r":4: focal length -120"),
    ("camera", ("focal = 30975.00", "focal = 120 mm"), r":4: 3 words where focal = value"),
    ("camera", ("PPAy", "PPAx"), r":3: key PPAx twice, first in line 2"),
    ("camera", "", r"the file is empty"),
]


@pytest.mark.parametrize(("kind", "change", "message"), DAMAGE)
def test_damaged_lists_are_refused_with_their_place(
    tmp_path: Path, kind: str, change: tuple[str, str] | str, message: str
) -> None:
    text = FILES[kind].replace(*change) if isinstance(change, tuple) else change
    with pytest.raises(AatriError, match=message) as refused:
        READERS[kind](written(tmp_path, kind, text))
    assert "fix: " in str(refused.value)


def test_the_files_of_borea_name_the_same_points(interchange: Path) -> None:
    folder = interchange / "borea"
    marks = read_marks(folder / "terrain_test.mes").image_points
    points = read_ground_points(folder / "GCP_test.app").ground_points
    cameras = [read_camera(folder / f"Camera{k}.txt").cameras for k in (1, 2)]
    assert [c["id"] for c in cameras] == [["UCE-M3-f120-s06"], ["UCE-M3-f120-s07"]]
    assert len(marks["point"]) == 7
    assert set(marks["point"]) == set(points["point"])
