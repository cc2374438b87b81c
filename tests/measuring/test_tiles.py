"""Tiles of pictures: their pixels, and a scan of 370 million of them in less than a gigabyte."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aatri.errors import InputError
from aatri.measuring.tiled_picture import TILE, TiledPicture

cv2 = pytest.importorskip("cv2", reason="works on images need the extra `images`")
tifffile = pytest.importorskip("tifffile", reason="works on images need the extra `images`")


def _tile(picture: TiledPicture, level: int, column: int, row: int) -> np.ndarray:
    return np.asarray(cv2.imdecode(np.frombuffer(picture.tile(level, column, row), np.uint8), cv2.IMREAD_GRAYSCALE))


@pytest.mark.parametrize("name", ["a.png", "a.tif", "tiled.tif"])
def test_tiles_are_the_pixels_and_their_means(tmp_path: Path, name: str) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (5 * TILE + 17, 9 * TILE + 5), dtype=np.uint8)
    path = tmp_path / name
    if name == "a.png":
        cv2.imwrite(str(path), pixels)
    else:
        tifffile.imwrite(path, pixels, tile=(64, 64) if name == "tiled.tif" else None, compression="deflate")
    picture = TiledPicture(str(path))
    assert (picture.width, picture.height) == (9 * TILE + 5, 5 * TILE + 17)
    assert np.array_equal(_tile(picture, 0, 9, 5), pixels[5 * TILE :, 9 * TILE :])
    for level in range(1, picture.levels):
        step = 2**level
        first = pixels[: TILE * step, : TILE * step]
        whole = first[: len(first) // step * step, : first.shape[1] // step * step]
        means = whole.reshape(len(whole) // step, step, -1, step).mean(axis=(1, 3))
        tile = _tile(picture, level, 0, 0)
        assert np.abs(tile[: means.shape[0], : means.shape[1]] - means).max() <= 1.0
        assert tile.shape == (-(-len(first) // step), -(-first.shape[1] // step))
    with pytest.raises(InputError, match="no tile"):
        picture.tile(0, 10, 0)


def test_sixteen_bits_are_stretched_alike_in_all_tiles(tmp_path: Path) -> None:
    ramp = np.tile(np.linspace(1000, 3000, 2 * TILE).astype(np.uint16), (2 * TILE, 1))
    tifffile.imwrite(tmp_path / "a.tif", ramp)
    picture = TiledPicture(str(tmp_path / "a.tif"))
    left, right = _tile(picture, 0, 0, 0), _tile(picture, 0, 1, 0)
    assert abs(int(left[0, -1]) - int(right[0, 0])) <= 2
    assert left[0, 0] < 3
    assert right[0, -1] > 252


def test_what_is_no_picture_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.tif").write_bytes(b"II*\0 no more")
    (tmp_path / "a.jpg").write_text("text")
    for name in ("a.tif", "a.jpg"):
        with pytest.raises(InputError, match="cannot be read as a picture"):
            TiledPicture(str(tmp_path / name))


OPENED = """
import sys
from pathlib import Path
import numpy as np
from aatri.measuring.tiled_picture import TiledPicture
picture = TiledPicture(sys.argv[1])
made = [len(picture.tile(level, 0, 0)) for level in range(picture.levels)]
made += [len(picture.tile(0, (picture.width - 1) // 256, (picture.height - 1) // 256))]
centre = picture.centre(np.array([12000.4, 9000.2]), 12)
peak_kb = Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0]  # ru_maxrss begins with the parent's
print(picture.width * picture.height, min(made), centre is None, peak_kb)
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the peak of memory is read from /proc")
def test_a_scan_of_370_million_pixels_takes_less_than_a_gigabyte(tmp_path: Path) -> None:
    path, side = tmp_path / "scan.tif", 1024
    shape = (19_456, 19_072)  # a film of 23 cm at 12 um, 16 bits

    def tiles() -> object:
        ramp = np.tile(np.arange(side, dtype=np.uint16) * 16, (side, 1))
        for _ in range(-(-shape[0] // side) * -(-shape[1] // side)):
            yield ramp

    tifffile.imwrite(path, tiles(), shape=shape, dtype=np.uint16, tile=(side, side), compression="deflate")
    told = subprocess.run([sys.executable, "-c", OPENED, str(path)], capture_output=True, text=True, check=True)
    pixels, smallest, nothing, kilobytes = told.stdout.split()
    assert int(pixels) > 370_000_000
    assert int(smallest) > 50
    assert nothing == "True"
    assert int(kilobytes) < 1_000_000
