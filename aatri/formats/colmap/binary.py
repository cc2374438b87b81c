"""COLMAP's sparse model as binary files: little-endian, counts first.

    cameras.bin    count | id u32, model i32, width u64, height u64, parameters f64 ...
    images.bin     count | id u32, q 4 f64, t 3 f64, camera u32, name with zero byte,
                   count u64 of (x f64, y f64, point3D i64)
    points3D.bin   count | id u64, xyz 3 f64, rgb 3 u8, error f64, count u64 of (image u32, index u32)

Source: colmap.github.io, Output format.
"""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float, Int
from aatri.errors import InputError
from aatri.formats.colmap.model import MODELS, NAMES, ColmapCamera, ColmapImage, ColmapModel
from aatri.formats.text.text_file import read_bytes

MAX_ID = 2**63 - 1
TRACK = np.dtype([("image", "<u4"), ("index", "<u4")])
OBSERVATION = np.dtype([("x", "<f8"), ("y", "<f8"), ("point", "<i8")])


def binary_paths(folder: Path) -> list[Path]:
    """The three files."""
    return [folder / f"{name}.bin" for name in NAMES]


def read_binary(folder: Path) -> ColmapModel:
    """Read binary files.

    Raises
    ------
    InputError
        If a file is missing or ends early.
    """
    paths = binary_paths(folder)
    data = [_Bytes(path) for path in paths]
    cameras, images, (points, xyz, track) = _cameras(data[0]), _images(data[1]), _points(data[2])
    for file in data:
        file.ends()
    return ColmapModel(cameras, images, points, xyz, np.zeros(len(points), dtype=np.int32), paths, track)


class _Bytes:
    """A binary file being read."""

    def __init__(self, path: Path) -> None:
        self.path, self.data, self.at = path, read_bytes(path), 0

    def take(self, form: str) -> tuple[Any, ...]:
        """The next values, by a format of struct, little-endian."""
        size = struct.calcsize("<" + form)
        self._need(size)
        values = struct.unpack_from("<" + form, self.data, self.at)
        self.at += size
        return values

    def text(self) -> str:
        """The next text, ended by a zero byte."""
        end = self.data.find(b"\0", self.at)
        if end < 0:
            self._need(len(self.data))
        text = self.data[self.at : end].decode("utf-8", errors="replace")
        self.at = end + 1
        return text

    def array(self, dtype: np.dtype[Any], count: int) -> npt.NDArray[Any]:
        """The next `count` items."""
        self._need(dtype.itemsize * count)
        values = np.frombuffer(self.data, dtype, count, self.at)
        self.at += dtype.itemsize * count
        return values

    def ends(self) -> None:
        """A fault if there is more than was counted."""
        if self.at < len(self.data):
            what = f"has {len(self.data) - self.at} bytes more than the numbers it states need"
            raise InputError(what, where=str(self.path), remedy="export the model again")

    def _need(self, size: int) -> None:
        if self.at + size > len(self.data):
            what = f"ends at byte {len(self.data)}, where {size} bytes from {self.at} are expected"
            raise InputError(what, where=str(self.path), remedy="the file is incomplete or no COLMAP file")


def _cameras(data: _Bytes) -> list[ColmapCamera]:
    cameras = []
    for _ in range(data.take("Q")[0]):
        number, model, width, height = data.take("IiQQ")
        if not 0 <= model < len(MODELS):
            raise InputError(
                f"camera {number} has the model number {model}",
                where=str(data.path),
                remedy=f"known are 0 to {len(MODELS) - 1}: convert it",
            )
        name = list(MODELS)[model]
        cameras.append(ColmapCamera(number, name, width, height, data.take(f"{MODELS[name]}d")))
    return cameras


def _images(data: _Bytes) -> list[ColmapImage]:
    images = []
    for _ in range(data.take("Q")[0]):
        number, *pose, camera = data.take("I7dI")
        name = data.text()
        rows = data.array(OBSERVATION, data.take("Q")[0])
        xy = np.stack([rows["x"], rows["y"]], axis=1)
        images.append(ColmapImage(number, tuple(pose[:4]), tuple(pose[4:]), camera, name, xy, rows["point"].copy()))
    return images


def _points(data: _Bytes) -> tuple[Int, Float, Int]:
    """Ids, coordinates and tracks."""
    ids, xyz, tracks = [], [], [np.zeros((0, 3), dtype=np.int64)]
    for _ in range(data.take("Q")[0]):
        number, x, y, z, _, _, _, _, length = data.take("Q3d3BdQ")
        if number > MAX_ID:
            raise InputError(f"point {number}: an id beyond {MAX_ID}", where=str(data.path), remedy="number anew")
        ids.append(number)
        xyz.append((x, y, z))
        track = data.array(TRACK, length)
        tracks.append(np.stack([np.full(length, number), track["image"], track["index"]], axis=1).astype(np.int64))
    points = np.array(ids, dtype=np.int64)
    return points, np.array(xyz, dtype=np.float64).reshape(len(ids), 3), np.concatenate(tracks)
