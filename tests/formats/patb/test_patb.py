"""PATB's .ori: which way the matrices map is seen by the lines of the flight; a projected point proves it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from aatri.arrays import Float
from aatri.errors import AatriError
from aatri.formats.parts.format import Reading
from aatri.formats.patb.orientations import read_patb
from aatri.progress import SILENT

AZIMUTH = math.radians(30)


def flight(azimuth: float = AZIMUTH, scatter: float = 0.0) -> tuple[Float, Float]:
    """Two lines there and back, the image x axis along the flight: R = Rx Ry Rz with small tilts, and positions."""
    rng = np.random.default_rng(4)
    R, position = [], []
    for line in range(2):
        kappa = azimuth + math.pi * line
        for k in range(5):
            w, p = rng.normal(scale=0.01, size=2)
            t = kappa + scatter * rng.normal()
            Rx = np.array([[1, 0, 0], [0, math.cos(w), -math.sin(w)], [0, math.sin(w), math.cos(w)]])
            Ry = np.array([[math.cos(p), 0, math.sin(p)], [0, 1, 0], [-math.sin(p), 0, math.cos(p)]])
            Rz = np.array([[math.cos(t), -math.sin(t), 0], [math.sin(t), math.cos(t), 0], [0, 0, 1]])
            R.append(Rx @ Ry @ Rz)
            along = np.array([math.cos(kappa), math.sin(kappa)]) * 500 * (k - 2)
            position.append([*(along + np.array([-math.sin(azimuth), math.cos(azimuth)]) * 900 * line), 2000.5])
    return np.array(R), np.array(position) + np.array([500000, 4000000, 0])


def records(matrices: Float, position: Float) -> str:
    """Fixed width, by the field widths of the format's description."""
    text = ""
    for k, (a, x) in enumerate(zip(matrices.reshape(-1, 9), position)):
        text += f"{k + 1:16d}{'':16}" + "".join(f"{v:16.5f}" for v in x) + "\n"
        text += "".join(f"{v:16.12f}" for v in a[:5]) + "\n" + "".join(f"{v:16.12f}" for v in a[5:]) + "\n"
    return text


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "block.ori"
    path.write_text(text)
    return path


@pytest.mark.parametrize("transposed", [False, True])
def test_the_lines_of_the_flight_tell_which_way_the_matrices_map(tmp_path: Path, transposed: bool) -> None:
    """A point 100 m ahead of the middle is seen on the positive x axis of the image, whatever the file has."""
    R, position = flight()
    text = records(R.swapaxes(1, 2) if transposed else R, position)
    parts = read_patb(written(tmp_path, text), Reading(), SILENT)
    turned = np.asarray(parts.exterior["ground_from_image"])
    np.testing.assert_allclose(turned, R, rtol=0, atol=1e-11)
    ahead = position[2] + [100 * math.cos(AZIMUTH), 100 * math.sin(AZIMUTH), -1000]
    u = turned[2].T @ (ahead - position[2])
    assert u[0] / -u[2] == pytest.approx(0.1, abs=0.03)
    assert abs(u[1] / u[2]) < 0.03
    assert parts.notes == [
        f"matrices are read as {'image from ground' if transposed else 'ground from image'}, "
        "as the lines of the flight show"
    ]


def test_along_the_axes_both_senses_are_alike_and_the_usual_one_is_taken(tmp_path: Path) -> None:
    R, position = flight(azimuth=0.0)
    parts = read_patb(written(tmp_path, records(R, position)), Reading(), SILENT)
    assert "both senses are alike" in parts.notes[0]


def test_what_shows_no_lines_is_refused_unless_the_user_says_it(tmp_path: Path) -> None:
    path = written(tmp_path, records(*flight(scatter=1.0)))
    with pytest.raises(AatriError, match=r"block.ori:1: nothing says which way .* map") as refused:
        read_patb(path, Reading(), SILENT)
    assert "`--set maps=...` or in a pipeline `maps`: ground_from_image or image_from_ground" in str(refused.value)
    parts = read_patb(path, Reading(maps="image_from_ground"), SILENT)
    np.testing.assert_allclose(parts.exterior["ground_from_image"], flight(scatter=1.0)[0].swapaxes(1, 2), atol=1e-11)


def test_columns_that_touch_are_told_apart(tmp_path: Path) -> None:
    R, position = flight()
    far = position + np.array([1e9, 1e9, 0])
    text = records(R, far).replace(f"{1:16d}", "line 7 photo 1  ", 1)
    parts = read_patb(written(tmp_path, text), Reading(), SILENT)
    assert parts.images["id"][0] == "line 7 photo 1"
    assert parts.exterior["position_m"][0].tolist() == pytest.approx(far[0].tolist(), abs=1e-5)


def test_what_stands_beyond_the_columns_is_refused(tmp_path: Path) -> None:
    text = records(*flight()).replace("\n", "01\n", 1)
    with pytest.raises(AatriError, match=r":1: '01' stands beyond character 80, where the record ends"):
        read_patb(written(tmp_path, text), Reading(), SILENT)


def test_a_file_of_blanks_has_no_rows(tmp_path: Path) -> None:
    with pytest.raises(AatriError, match=r"block.ori: the file has no rows"):
        read_patb(written(tmp_path, "      \n\n"))
