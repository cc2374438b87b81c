"""Heads of photographs: cameras, positions, and what can be wrong with them."""

from __future__ import annotations

import shutil
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.adapters.frame.adjustment_frame import frame_of
from aatri.codes import APPROXIMATE_VALUE, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.navigation.photo_folder import read_photographs
from aatri.stages.block.photos import PhotosOptions, photos
from tests.made_photographs import EAST_M, F_PX, HEIGHT, NORTH_M, WIDTH, exif_of
from tests.stages.film_blocks import Told

Image = pytest.importorskip("PIL.Image")


def _save(folder: Path, name: str, size: tuple[int, int] = (WIDTH, HEIGHT), **tags: Any) -> Path:
    folder.mkdir(exist_ok=True)
    seed = sum(map(ord, name))
    exif = exif_of(np.array([float(seed), 2.0, 100.0]), seed % 60, **tags)
    path = folder / name
    Image.fromarray(np.random.default_rng([seed, ord(name[0])]).integers(0, 255, size[::-1], dtype=np.uint8)).save(
        path, exif=exif
    )
    return path


def test_camera_position_and_time(tmp_path: Path) -> None:
    for name in ("a.jpg", "b.jpg"):
        _save(tmp_path, name)
    parts = read_photographs(tmp_path)
    assert parts.notes == []
    assert parts.cameras["id"] == [f"Made-Up-{WIDTH}x{HEIGHT}"]
    c_mm, size_mm = parts.cameras["principal_distance_mm"][0], parts.cameras["pixel_size_mm"][0, 0]
    assert c_mm / size_mm == pytest.approx(1.12 * F_PX, rel=1e-6)
    of = dict(zip(parts.camera_parameters["name"], parts.camera_parameters["sigma"]))
    assert of["principal_distance"] == pytest.approx(0.3 * c_mm)
    assert (parts.exterior["position_use"] == OBSERVED_VALUE).all()
    assert parts.exterior["sigma_m"].tolist() == [[3.0, 3.0, 10.0]] * 2
    assert parts.images["time_s"][1] - parts.images["time_s"][0] == 1.0


def test_a_gps_altitude_of_zero_by_zero_leaves_the_place_in_plan(tmp_path: Path) -> None:
    """Receivers without a height write 0/0; the middle of no heights was asked for, with a warning of NumPy."""
    from PIL.TiffImagePlugin import IFDRational

    for name in ("a.jpg", "b.jpg"):
        path = _save(tmp_path, name)
        with Image.open(path) as picture:
            exif = picture.getexif()
            exif.get_ifd(0x8825)[6] = IFDRational(0, 0)
            picture.load()
            picture.save(path, exif=exif)
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        block = photos(options=PhotosOptions(path=tmp_path))
    exterior, tangent = block.exterior, frame_of(block)
    assert tangent is not None
    np.testing.assert_allclose(tangent.from_block(np.array([[EAST_M, NORTH_M, 0.0]])), 0.0, atol=1e3)
    assert (exterior.position_use == OBSERVED_VALUE).all()
    assert np.isfinite(exterior.position_m).tolist() == [[True, True, False]] * 2


@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_an_orientation_for_viewers_is_told_and_changes_no_size(tmp_path: Path, orientation: int) -> None:
    _save(tmp_path, "a.jpg", orientation=orientation)
    parts = read_photographs(tmp_path)
    assert parts.cameras["format"] == [(WIDTH, HEIGHT)]
    assert "marked as turned" in parts.notes[0]


def test_one_file_under_two_names_counts_once(tmp_path: Path) -> None:
    shutil.copy(_save(tmp_path, "a.jpg"), tmp_path / "b.jpg")
    parts = read_photographs(tmp_path)
    assert parts.images["id"] == ["a"]
    assert "b.jpg is the same file as a.jpg" in parts.notes[0]


def test_an_upright_photograph_is_another_camera(tmp_path: Path) -> None:
    _save(tmp_path, "a.jpg")
    _save(tmp_path, "b.jpg", size=(HEIGHT, WIDTH))
    parts = read_photographs(tmp_path)
    assert len(parts.cameras["id"]) == 2
    assert "lie upright and across" in parts.notes[0]


def test_a_photograph_of_another_size_is_another_camera_and_told(tmp_path: Path) -> None:
    _save(tmp_path, "a.jpg")
    _save(tmp_path, "b.jpg")
    _save(tmp_path, "c.jpg", size=(WIDTH // 2, HEIGHT // 2))
    parts = read_photographs(tmp_path)
    assert len(parts.cameras["id"]) == 2
    assert parts.notes == [
        f"photographs of Up have several sizes, each a camera of its own: {WIDTH // 2}x{HEIGHT // 2} (1), "
        f"{WIDTH}x{HEIGHT} (2); of one flight take them all as the camera wrote them"
    ]


def test_another_focal_length_is_another_camera(tmp_path: Path) -> None:
    _save(tmp_path, "a.jpg")
    _save(tmp_path, "b.jpg", focal_mm=9.0)
    assert len(read_photographs(tmp_path).cameras["id"]) == 2


def test_no_focal_length_is_told_and_taken_by_the_format(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    Image.fromarray(np.zeros((HEIGHT, WIDTH), np.uint8)).save(path)
    parts = read_photographs(tmp_path)
    assert "says no focal length, or 0" in parts.notes[0]
    assert parts.cameras["principal_distance_mm"][0] == pytest.approx(1.2 * WIDTH * 0.001)
    assert not parts.exterior


def test_missing_and_equal_positions_are_no_observations(tmp_path: Path) -> None:
    for name in ("ab.jpg", "ba.jpg", "c.jpg"):  # the first two stand at one place
        _save(tmp_path, name)
    _save(tmp_path, "d.jpg", position=False)
    parts = read_photographs(tmp_path)
    assert parts.exterior["image"] == ["ab", "ba", "c"]
    assert parts.exterior["position_use"].tolist() == [APPROXIMATE_VALUE, APPROXIMATE_VALUE, OBSERVED_VALUE]
    assert "1 of 4 photographs say no position: d" in parts.notes[0]
    assert "2 of 4 photographs have the position of another one" in parts.notes[1]


@pytest.mark.parametrize("latitude", [(50.0, 80.0, 0.0), (120.0, 0.0, 0.0), (50.0, 30.0, 75.0)])
def test_a_latitude_that_is_no_angle_is_refused_by_name(tmp_path: Path, latitude: tuple[float, ...]) -> None:
    path = _save(tmp_path, "a.jpg")
    with Image.open(path) as picture:
        exif = picture.getexif()
        exif.get_ifd(0x8825)[2] = latitude
        picture.save(path, exif=exif)
    with pytest.raises(InputError, match=f"its GPS latitude is {latitude[0]:g} {latitude[1]:g}") as refused:
        read_photographs(tmp_path)
    assert "a.jpg" in refused.value.where


def test_photographs_that_say_no_position_make_a_block_without_a_place(tmp_path: Path) -> None:
    for name in ("a.jpg", "b.jpg"):
        _save(tmp_path, name, position=False)
    ear = Told()
    block = photos(options=PhotosOptions(path=tmp_path), context=ear)
    assert block.frames.crs.tolist() == ["local"]
    assert len(block.exterior) == 0
    assert any("2 of 2 photographs say no position" in warning for warning in ear.warnings)


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_truncated_file_is_refused_by_name(tmp_path: Path, share: float) -> None:
    path = _save(tmp_path, "a.jpg")
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match="truncated") as caught:
        read_photographs(tmp_path)
    assert "a.jpg" in str(caught.value)


@pytest.mark.parametrize("optimize", [False, True])
def test_zeros_in_the_place_of_pixels_are_refused_by_name_and_a_plain_picture_is_not(
    tmp_path: Path, optimize: bool
) -> None:
    """A card that lost a sector: decoders fill in grey and say nothing."""
    _save(tmp_path, "a.jpg")
    whole = bytearray((tmp_path / "a.jpg").read_bytes())
    Image.fromarray(np.full((600, 800), 255, np.uint8)).save(tmp_path / "plain.jpg", optimize=optimize)
    read_photographs(tmp_path)
    half = len(whole) * 2 // 3
    whole[half : half + 512] = bytes(512)
    (tmp_path / "a.jpg").write_bytes(whole)
    with pytest.raises(InputError, match="has a hole: zeros in the place of pixels from byte ") as caught:
        read_photographs(tmp_path)
    assert "a.jpg" in str(caught.value)


@pytest.mark.parametrize(("content", "why"), [(b"", "the file is empty"), (b"no picture", "that of no format")])
def test_what_is_no_picture_is_told_by_name(tmp_path: Path, content: bytes, why: str) -> None:
    (tmp_path / "a.jpg").write_bytes(content)
    with pytest.raises(InputError, match=why) as caught:
        read_photographs(tmp_path)
    assert "a.jpg" in str(caught.value)


def test_a_folder_without_photographs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no photograph"):
        read_photographs(tmp_path)
