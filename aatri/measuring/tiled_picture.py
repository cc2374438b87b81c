"""The picture of an image, cut into tiles of several resolutions: what the page shows, and the centres of marks in it.

Level 0 has the pixels as they are, each further level half as many along each side, as means. Of TIFF files that can be
read by windows only those are read that a tile touches; the levels from `COARSE` on come from one small picture, made
by going through the file once, in bands. So a scan of 370 million pixels takes some hundred MB.
Of a block folder the pictures shown last stay open.
"""

import threading
from collections import OrderedDict
from functools import cached_property

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.extras import of_extra
from aatri.ids import clipped
from aatri.measuring.centres import BORDER, centre_of_symmetry
from aatri.measuring.measured_folder import MeasuredFolder
from aatri.pixels.reading import Samples, range_of, reads_windows, size_px, stretched, whole_image, window

TILE = 256
"""Pixels along each side of a tile."""
COARSE = 3
"""The first level that is kept: 1/8 of the pixels along each side."""
BAND = 1024
"""Rows that are read at once, a multiple of the usual heights of tiles in TIFF files."""

KEPT = 3
"""Pictures that are kept open: the one on the page and those before it."""


class TiledPicture:
    """The picture of one file."""

    def __init__(self, path: str) -> None:
        """Open a picture.

        Raises
        ------
        InputError
            If it is not there, or is no picture.
        """
        self.path = path
        self._whole: Samples | None = None if reads_windows(path) else whole_image(path)
        self.width, self.height = size_px(path) if self._whole is None else self._whole.shape[::-1]
        self.levels = 1 + max(0, int(np.ceil(np.log2(max(self.width, self.height) / TILE))))
        self._lock = threading.Lock()

    def tile(self, level: int, column: int, row: int) -> bytes:
        """A tile as PNG; the last of a row or column may be smaller.

        Raises
        ------
        InputError
            If there is no such tile.
        """
        step = 2**level
        x, y = column * TILE * step, row * TILE * step
        if not (0 <= level < self.levels and 0 <= x < self.width and 0 <= y < self.height):
            raise InputError(f"no tile {level}/{column}/{row}", where=self.path)
        if level < COARSE:
            part = _reduced(self._samples(x, y, TILE * step, TILE * step), step)
        else:
            small, coarser = TILE * step // 2**COARSE, 2 ** (level - COARSE)
            left, top = x // 2**COARSE, y // 2**COARSE
            part = _reduced(self._coarse[top : top + small, left : left + small], coarser)
        cv2 = of_extra("cv2", "images")
        grey = stretched(part, self._range)
        return bytes(cv2.imencode(".png", grey, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1])

    def centre(self, xy_px: Float, radius_px: int) -> tuple[Float, Float] | None:
        """The centre of a cross, dot, ring or crossing of fields near a place, and its standard deviation (2,), px.

        See `centres.centre_of_symmetry`; None where nothing within the radius is symmetric about a point.

        Parameters
        ----------
        xy_px : (2,) float64, px
            From the centre of the first pixel.
        radius_px : int
            Of the mark, and of the search.
        """
        half = 2 * radius_px + BORDER
        x, y = (np.round(xy_px).astype(int) - half).tolist()
        side = 2 * half + 1
        if min(x, y) < 0 or x + side > self.width or y + side > self.height:
            return None
        centre = centre_of_symmetry(self._samples(x, y, side, side).astype(float), xy_px - [x, y], radius_px)
        return None if centre is None else (centre[0] + [x, y], centre[1])

    def _samples(self, x: int, y: int, width: int, height: int) -> Samples:
        width, height = min(width, self.width - x), min(height, self.height - y)
        if self._whole is not None:
            return self._whole[y : y + height, x : x + width]
        return window(self.path, x, y, width, height)

    @cached_property
    def _made_coarse(self) -> Samples:
        bands = [_reduced(self._samples(0, y, self.width, BAND), 2**COARSE) for y in range(0, self.height, BAND)]
        return np.concatenate(bands)

    @property
    def _coarse(self) -> Samples:
        with self._lock:  # one thread makes it, the others wait
            return self._made_coarse

    @cached_property
    def _range(self) -> tuple[float, float]:
        return range_of(self._coarse)


def _reduced(part: Samples, step: int) -> Samples:
    """Means of step x step pixels, in the type of the picture; at the edges of those that there are."""
    if step == 1:
        return part
    height, width = part.shape
    rows, columns = np.arange(0, height, step), np.arange(0, width, step)
    sums = np.add.reduceat(np.add.reduceat(part, columns, axis=1, dtype=np.float64), rows, axis=0)
    counts = np.outer(np.minimum(step, height - rows), np.minimum(step, width - columns))
    return np.asarray(sums / counts).round().astype(part.dtype)


class OpenPictures:
    """Pictures by the ids of their images."""

    def __init__(self, folder: MeasuredFolder) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._open: OrderedDict[str, TiledPicture] = OrderedDict()
        self._sizes: dict[str, tuple[int, int]] = {}

    def size(self, image: str) -> tuple[int, int]:
        """Width and height of the picture of an image, px."""
        if image not in self._sizes:
            self._path(image)
            size = self._folder.size_px(image)
            if size is None:
                picture = self.open(image)
                size = picture.width, picture.height
            self._sizes[image] = size
        return self._sizes[image]

    def open(self, image: str) -> TiledPicture:
        """The picture of an image.

        Raises
        ------
        InputError
            If there is no such image, it names no file, or the file is not there or no picture.
        """
        path = self._path(image)
        with self._lock:
            if image not in self._open:
                self._open[image] = TiledPicture(path)
                while len(self._open) > KEPT:
                    self._open.popitem(last=False)
            self._open.move_to_end(image)
            return self._open[image]

    def _path(self, image: str) -> str:
        path = self._folder.path.get(image)
        if not path:
            what = "has no path in images.csv" if image in self._folder.path else "is not in images.csv"
            where = str(self._folder.folder)
            raise InputError(f"image {clipped(image)!r} {what}", where=where, remedy="name its file there")
        return path
