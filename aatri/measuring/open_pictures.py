"""The pictures of a block folder: the last ones shown stay open."""

import threading
from collections import OrderedDict

from aatri.errors import InputError
from aatri.ids import clipped
from aatri.measuring.measured_folder import MeasuredFolder
from aatri.measuring.tiled_picture import TiledPicture

KEPT = 3
"""Pictures that are kept open: the one on the page and those before it."""


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
