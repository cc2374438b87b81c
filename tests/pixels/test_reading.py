"""Pixels of files: as they lie, of any depth, in windows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import InputError
from aatri.pixels import reading
from aatri.pixels.reading import grey_image, reads_windows, size_px, window
from tests.made_photographs import texture

Image = pytest.importorskip("PIL.Image")
tifffile = pytest.importorskip("tifffile")


def _picture() -> np.ndarray:
    return np.clip(texture()[:90, :140], 0, 255).astype(np.uint8)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_an_orientation_for_viewers_is_never_applied(tmp_path: Path, orientation: int) -> None:
    exif = Image.Exif()
    exif[274] = orientation
    Image.fromarray(_picture()).save(tmp_path / "a.jpg", quality=100, exif=exif)
    grey = grey_image(str(tmp_path / "a.jpg"))
    assert grey.shape == (90, 140)
    assert np.abs(grey.astype(int) - _picture()).max() <= 2


def test_twelve_bits_in_sixteen_fill_the_range(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", _picture().astype(np.uint16) * 16)
    grey = grey_image(str(tmp_path / "a.tif"))
    assert grey.dtype == np.uint8
    assert grey.min() == 0
    assert grey.max() == 255
    assert np.corrcoef(grey.ravel(), _picture().ravel())[0, 1] > 0.999


def test_a_window_of_a_tiled_scan_is_that_of_the_whole(tmp_path: Path) -> None:
    whole = np.random.default_rng(0).integers(0, 65535, (500, 700), dtype=np.uint16)
    for name, layout in (("tiles", {"tile": (64, 48)}), ("strips", {"rowsperstrip": 37}), ("one", {})):
        path = tmp_path / f"{name}.tif"
        tifffile.imwrite(path, whole, **layout)
        assert size_px(str(path)) == (700, 500)
        assert (window(str(path), 131, 77, 301, 202) == whole[77:279, 131:432]).all()


@pytest.mark.parametrize("compression", ["tiff_lzw", "packbits"])
@pytest.mark.parametrize("kind", ["grey", "deep", "colour"])
def test_windows_of_compressed_scans_are_decoded_by_the_strips_they_touch(
    tmp_path: Path, compression: str, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = _picture()
    samples = {"grey": whole, "deep": whole.astype(np.uint16) * 200, "colour": np.dstack([whole, whole[::-1], whole])}
    path = tmp_path / "a.tif"
    more = {278: 17, 317: 2 if compression == "tiff_lzw" else 1}  # differences of neighbours
    Image.fromarray(samples[kind]).save(path, compression=compression, tiffinfo=more)
    monkeypatch.setattr(reading, "whole_by_pillow", None)  # never the whole
    assert reads_windows(str(path))
    part = window(str(path), 11, 7, 101, 70)
    if kind == "colour":
        expected = (samples[kind] @ np.array([0.299, 0.587, 0.114])).round()
        assert np.abs(part - expected[7:77, 11:112]).max() <= 1
    else:
        assert (part == samples[kind][7:77, 11:112]).all()


def test_colours_and_inks_become_brightness(tmp_path: Path) -> None:
    colour = np.zeros((40, 50, 3), np.uint8)
    colour[:, :25] = 200
    Image.fromarray(colour).convert("CMYK").save(tmp_path / "a.jpg", quality=100)
    tifffile.imwrite(tmp_path / "a.tif", colour, photometric="rgb")
    for name in ("a.jpg", "a.tif"):
        grey = grey_image(str(tmp_path / name))
        assert abs(int(grey[20, 5]) - 200) < 8
        assert grey[20, 45] < 8


def test_what_is_no_picture_or_not_there_is_told_by_name(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8\xff\xe0 no picture")
    (tmp_path / "b.tif").write_bytes(b"II*\0 no picture")
    for name in ("a.jpg", "b.tif", "c.jpg", "d.tif"):
        with pytest.raises(InputError, match=r"cannot be read as a picture|is not there") as caught:
            grey_image(str(tmp_path / name))
        assert name in str(caught.value)
