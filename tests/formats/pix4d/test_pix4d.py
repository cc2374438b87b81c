"""Pix4D's parameters: a projected point, the matrices of 168 images, damaged files."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from aatri.formats.parts.assembled import assembled
from aatri.formats.pix4d.reader import read_pix4d
from tests.formats.lens_projection import misfit_px

HEAD = "fileName imageWidth imageHeight\nK\nr\nt\nt\nR\n\nm\n\n"
IMAGE = """{0} 4000 3000
2000 0 2010
0 2000 1490
0 0 1
0.1 0.02 0
0.001 0.002
10 20 30
1 0 0
0 -1 0
0 0 -1
"""


def folder_of(tmp_path: Path, text: str) -> Path:
    (tmp_path / "t_calibrated_camera_parameters.txt").write_text(text)
    (tmp_path / "t_offset.xyz").write_text("1000.0 2000.0 100.0")
    return tmp_path


def test_a_point_is_projected_by_the_formula_of_pix4d(tmp_path: Path) -> None:
    """X - centre = (2, 1, -10): in the camera (2, -1, 10), x = 0.2, y = -0.1, r^2 = 0.05."""
    x, y, r2 = 0.2, -0.1, 0.05
    gain = 1 + 0.1 * r2 + 0.02 * r2**2
    u = 2010 + 2000 * (x * gain + 2 * 0.001 * x * y + 0.002 * (r2 + 2 * x * x))
    v = 1490 + 2000 * (y * gain + 0.001 * (r2 + 2 * y * y) + 2 * 0.002 * x * y)
    block = assembled([read_pix4d(folder_of(tmp_path, HEAD + IMAGE.format("a.jpg") + IMAGE.format("b.jpg")))])
    assert misfit_px(block, "a.jpg", [[u, v]], [[1012.0, 2021.0, 120.0]])[0] < 1e-9
    assert block.cameras.id.tolist() == ["camera"]


def test_the_matrices_of_168_images_are_those_of_their_parameters(interchange: Path, tmp_path: Path) -> None:
    folder = interchange / "pix4d"
    parts = read_pix4d(folder)
    assert len(parts.images["id"]) == 168
    R = np.asarray(parts.exterior["ground_from_image"]) * [1, -1, -1]
    X = np.asarray(parts.exterior["position_m"]) - [368109.0, 3956043.0, 96.0]
    f, px, py = 4470.89710276625464757672, 2806.80399985351095892838, 1694.57401670066087717714
    K = np.array([[f, 0, px], [0, f, py], [0, 0, 1]])
    rows = [line.split() for line in (folder / "test_pmatrix.txt").read_text().splitlines() if line.strip()]
    stated = {row[0]: np.array(row[1:], float).reshape(3, 4) for row in rows}
    for k, name in enumerate(parts.images["id"]):
        P = K @ np.column_stack([R[k].T, -R[k].T @ X[k]])
        np.testing.assert_allclose(P, stated[name], rtol=1e-9, atol=1e-6)
    copy = tmp_path / "params"
    shutil.copytree(folder, copy)
    text = (copy / "test_pmatrix.txt").read_text()
    (copy / "test_pmatrix.txt").write_text(text.replace("DJI_0172.JPG 4436.465963", "DJI_0172.JPG 4436.465973"))
    with pytest.raises(AatriError, match=r"test_pmatrix.txt:\d+: the matrix of DJI_0172.JPG is 9.76e-06 beside"):
        read_pix4d(copy)


DAMAGE = {
    "truncated": (lambda t: t[:-30], r":15: \d+ lines of images, 10 each"),
    "other head": (lambda t: t.replace("fileName", "name"), r":1: the first line is not"),
    "decimal comma": (lambda t: t.replace("0.001 0.002", "0,001 0.002"), r":15: '0,001': a decimal comma"),
    "not a number": (lambda t: t.replace("10 20 30", "10 nan 30"), r":16: 'nan'"),
    "image twice": (lambda t: t + IMAGE.format("a.jpg"), r":20: image a.jpg twice, first in line 10"),
    "a word missing": (lambda t: t.replace("0.1 0.02 0", "0.1 0.02"), r":14: 2 words where"),
    "reflection": (lambda t: t.replace("0 0 -1", "0 0 1"), r":17: this is no rotation"),
    "camera in mm": (lambda t: t.replace("2000 0 2010", "-8.8 0 6"), r":11: this is no camera matrix"),
    "skew": (lambda t: t.replace("2000 0 2010", "2000 3 2010"), r":11: a skew of 3 px"),
    "web page": (lambda _: "<!doctype html>", r":1: this is a web page"),
    "empty": (lambda _: "", r"the file is empty"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_parameters_are_refused_with_their_place(tmp_path: Path, damage: str) -> None:
    change, message = DAMAGE[damage]
    with pytest.raises(AatriError, match=message) as refused:
        read_pix4d(folder_of(tmp_path, change(HEAD + IMAGE.format("a.jpg"))))
    assert "fix: " in str(refused.value)


def test_names_may_have_blanks(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, HEAD + IMAGE.format("IMG 1 a.jpg"))
    (folder / "t_pmatrix.txt").write_text("IMG 1 a.jpg " + " ".join(["0"] * 12) + "\n")
    with pytest.raises(AatriError, match=r"pmatrix.txt:1: the matrix of IMG 1 a.jpg is"):
        read_pix4d(folder)
    (folder / "t_pmatrix.txt").unlink()
    assert read_pix4d(folder).images["id"] == ["IMG 1 a.jpg"]


def test_a_forgotten_offset_is_told(tmp_path: Path) -> None:
    folder = folder_of(tmp_path, HEAD + IMAGE.format("a.jpg"))
    (folder / "t_offset.xyz").unlink()
    assert read_pix4d(folder).notes == [
        "t_offset.xyz is not there: coordinates are taken as they stand, without an offset"
    ]
    (folder / "t_calibrated_camera_parameters.txt").unlink()
    with pytest.raises(AatriError, match=r"no file \*_calibrated_camera_parameters.txt"):
        read_pix4d(folder)
