"""What tie points cannot be found in is told: plain water, a file that has changed, images without a file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.stages.block.photos import PhotosOptions, photos
from aatri.stages.tie_points.sift import sift
from tests.made_photographs import HEIGHT, WIDTH, exif_of, flown
from tests.stages.film_blocks import Told

Image = pytest.importorskip("PIL.Image")
pytest.importorskip("cv2")


def _water(folder: Path) -> Block:
    for k in range(2):
        picture = Image.fromarray(np.full((120, 160), 90 + k, np.uint8))
        picture.save(folder / f"{k}.jpg", exif=exif_of(np.array([10.0 * k, 0, 100]), k))
    return photos(options=PhotosOptions(path=folder))


def test_plain_water_has_no_tie_points(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="none has 15 matches"):
        sift(_water(tmp_path))


@pytest.mark.slow
def test_a_repeated_pattern_has_no_tie_points(tmp_path: Path) -> None:
    """Every corner of a tiled roof has its like: none is clearer than the next."""
    tile = np.kron(np.random.default_rng(5).integers(40, 220, (4, 4)), np.ones((4, 4)))
    for k in range(2):
        grey = np.roll(np.tile(tile, (15, 20)), 5 * k, axis=1).astype(np.uint8)
        Image.fromarray(grey).save(tmp_path / f"{k}.png", exif=exif_of(np.array([10.0 * k, 0, 100]), k))
    with pytest.raises(InputError, match="none has 15 matches"):
        sift(photos(options=PhotosOptions(path=tmp_path)))


@pytest.mark.slow
def test_an_image_of_another_flight_is_named(tmp_path: Path) -> None:
    made, ear = flown(tmp_path / "p", strips=1, per_strip=2), Told()
    other = np.random.default_rng(6).integers(0, 255, (HEIGHT // 4, WIDTH // 4)).astype(np.uint8)
    picture = Image.fromarray(other).resize((WIDTH, HEIGHT), Image.Resampling.BICUBIC)
    picture.save(made.folder / "other.jpg", exif=exif_of(made.position_m[0] + 5.0, 20.0))
    block = sift(photos(options=PhotosOptions(path=made.folder)), context=ear)
    assert len(block.image_points) > 100
    assert any("1 image has no tie point: other" in text for text in ear.warnings)


def test_a_file_that_has_changed_is_refused_by_name(tmp_path: Path) -> None:
    block = _water(tmp_path)
    (tmp_path / "1.jpg").write_bytes((tmp_path / "0.jpg").read_bytes())
    with pytest.raises(InputError, match="has changed since the block was read") as caught:
        sift(block)
    assert "1.jpg" in str(caught.value)
    (tmp_path / "1.jpg").unlink()
    with pytest.raises(InputError, match="is not there"):
        sift(block)


def test_images_without_a_file_are_named(tmp_path: Path) -> None:
    block = _water(tmp_path)
    without = replace(block, images=replace(block.images, path=["", ""]))
    with pytest.raises(InputError, match="2 images have no file: 0, 1"):
        sift(without)


def test_real_photographs_of_a_drone(shared_data: Path) -> None:
    """Focal length 3.61 mm, 20 mm in terms of 36 x 24: 20 x 2295 / 43.27 = 1061 px for 2000 x 1125 pixels."""
    block = photos(options=PhotosOptions(path=shared_data / "images" / "brighton"))
    assert len(block.images) == 18
    assert block.cameras.id.tolist() == ["DJI-FC300S-2000x1125"]
    c_px = block.cameras.principal_distance_mm / block.cameras.pixel_size_mm[:, 0]
    assert c_px == pytest.approx([20 * np.hypot(2000, 1125) / np.hypot(36, 24)])
    assert block.frames.crs.tolist() == ["EPSG:32615"]
