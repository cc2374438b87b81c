"""A whole scan of a film frame, 400 million pixels with real marks in it, is measured in 1 GB."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

Image = pytest.importorskip("PIL.Image")
tifffile = pytest.importorskip("tifffile")
pytest.importorskip("cv2")

SIZE, TILE, PIXEL_MM = 20_000, 2_000, 0.0115
REACH = 100
PLACES = ((800, 800), (18_400, 800), (18_400, 18_400), (800, 18_400))
MEASURED = """
import sys
from pathlib import Path
import numpy as np
from aatri.artifacts.block import Fiducials
from aatri.artifacts.builder import block_of
from aatri.regular_file import content_of
from aatri.stages.fiducial_marks.template import TemplateOptions, template

path, picture, pixel_mm, size = sys.argv[1], sys.argv[2], float(sys.argv[3]), int(sys.argv[4])
places = np.array(eval(sys.argv[5]), float)
film = (places - (size - 1) / 2) * [pixel_mm, -pixel_mm]
camera = {"id": "c", "kind": "film", "image_coordinates": "pixel", "pixel_size_mm": [[pixel_mm, pixel_mm]],
          "pixel_origin": "top-left-centre", "pixel_y": "down", "principal_distance_mm": 150.0,
          "format": [[size * pixel_mm, size * pixel_mm]]}
images = {"id": ["a"], "camera": "c", "path": [path], "content": [content_of(path)]}
marks = Fiducials.of(camera=np.zeros(4, int), id=list("1234"), xy_mm=film)
block = block_of(name="film", cameras=camera, images=images, fiducials=marks)
found = template(block, options=TemplateOptions(picture=picture, search_mm=4.0)).fiducial_points
peak_kb = Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0]  # ru_maxrss begins with the parent's
print(np.abs(found.xy - places[found.fiducial]).max(), len(found), peak_kb)
"""


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the peak of memory is read from /proc")
def test_a_frame_of_400_million_pixels_is_measured_in_a_gigabyte(tmp_path: Path, shared_data: Path) -> None:
    mark = np.asarray(Image.open(shared_data / "images" / "fiducials" / "nagap" / "arc" / "T.jpg").convert("L"))
    row, column = 289, 893  # of the cross
    mark = mark[row - REACH : row + REACH + 1, column - REACH : column + REACH + 1]
    side = len(mark)
    Image.fromarray(mark).save(tmp_path / "mark.png")

    def tiles() -> Iterator[np.ndarray]:
        rng = np.random.default_rng(2)
        for row in range(0, SIZE, TILE):
            for column in range(0, SIZE, TILE):
                tile = np.full((TILE, TILE), 6000, np.uint16)
                for x, y in PLACES:
                    left, top = x - column - side // 2, y - row - side // 2
                    if 0 <= left <= TILE - side and 0 <= top <= TILE - side:
                        tile[top : top + side, left : left + side] += mark * np.uint16(100)
                        tile = (tile + rng.normal(0, 200, tile.shape)).astype(np.uint16)
                yield tile

    path = tmp_path / "a.tif"
    tifffile.imwrite(path, tiles(), shape=(SIZE, SIZE), dtype=np.uint16, tile=(TILE, TILE), compression="zlib")
    command = [sys.executable, "-c", MEASURED, str(path), str(tmp_path / "mark.png"), str(PIXEL_MM), str(SIZE)]
    done = subprocess.run([*command, str(PLACES)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    off_px, count, memory_kb = done.stdout.split()
    assert int(count) == 4
    assert float(off_px) < 0.1
    assert int(memory_kb) < 1_000_000
