"""COLMAP's database: features of images and what agrees between two, as its programs and others keep them.

    images(image_id, name, camera_id)   cameras(camera_id, width, height)
    keypoints(image_id, rows, cols, data)              float32: x, y; scale, turn; or a11, a12, a21, a22
    matches, two_view_geometries(pair_id, rows, cols, data)        uint32: rows of keypoints in both images
    pair_id = 2147483647 smaller + larger image_id

x, y are counted from the upper left corner of the image; the scale is a standard deviation, half of a diameter. What
has passed COLMAP's own check of a pair (`two_view_geometries`) is taken where there is any, else all matches.

Source: colmap.github.io, Database format; src/colmap/scene/database_sqlite.cc.
"""

import sqlite3
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float, Int
from aatri.errors import InputError
from aatri.ids import printable
from aatri.regular_file import open_regular

MOST_IMAGES = 2**31 - 1
COLUMNS = (2, 4, 6)
"""Of keypoints: places, with scale and turn, or with an affine shape."""


@dataclass(frozen=True)
class ColmapFeatures:
    """What a database has of its images, by their ids."""

    name: dict[int, str]
    format_px: dict[int, tuple[int, int]]
    xy_px: dict[int, Float]
    """(n, 2). From the centre of the first pixel; images without features have none."""
    size_px: dict[int, Float]
    """(n,). Diameters; 0 where only places are known."""
    matches: dict[tuple[int, int], Int]
    """By pair (m, 2): rows of features."""


def read_database(path: Path) -> ColmapFeatures:
    """Read a database.

    Raises
    ------
    InputError
        If it is none, is being written, or its parts contradict each other.
    """
    remedy = "a database of COLMAP (colmap feature_extractor, exhaustive_matcher), complete"
    try:
        open_regular(path).close()
        if (log := Path(f"{path}-wal")).exists() and log.stat().st_size:
            raise InputError(f"is being written: {log.name} is not empty", where=str(path), remedy="end COLMAP first")
        with closing(sqlite3.connect(f"file:{quote(str(path.absolute()))}?mode=ro&immutable=1", uri=True)) as database:
            return _read(database, path)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path), remedy=remedy) from error
    except sqlite3.Error as error:
        what = f"cannot be read as a database: {printable(str(error))}"
        raise InputError(what, where=str(path), remedy=remedy) from error


def _read(database: sqlite3.Connection, path: Path) -> ColmapFeatures:
    rows = database.execute(
        "SELECT image_id, name, width, height FROM images JOIN cameras USING (camera_id) ORDER BY image_id"
    ).fetchall()
    names, format_px = {row[0]: str(row[1]) for row in rows}, {row[0]: (row[2], row[3]) for row in rows}
    xy_px, size_px = dict[int, Float](), dict[int, Float]()
    for image, *blob in database.execute("SELECT image_id, rows, cols, data FROM keypoints"):
        table = _array(blob, "<f4", COLUMNS, f"keypoints of image {image}", path).astype(float)
        if not np.isfinite(table).all():
            raise _fault(path, f"keypoints of image {image} are not all numbers")
        xy_px[image], size_px[image] = table[:, :2] - 0.5, _diameters(table)
    matches = dict[tuple[int, int], Int]()
    checked = database.execute("SELECT count(*) FROM two_view_geometries WHERE rows > 0").fetchone()[0]
    query = f"SELECT pair_id, rows, cols, data FROM {'two_view_geometries' if checked else 'matches'} WHERE rows > 0"
    for pair, *blob in database.execute(query):
        first, second = divmod(int(pair), MOST_IMAGES)
        table = _array(blob, "<u4", (2,), f"matches of images {first} and {second}", path).astype(np.int64)
        for image, column in zip((first, second), table.T):
            if image not in names or column.max() >= len(xy_px.get(image, ())):
                raise _fault(path, f"matches of images {first} and {second} name features that there are not")
        matches[first, second] = table
    return ColmapFeatures(names, format_px, xy_px, size_px, matches)


def _array(blob: list[object], form: str, columns: tuple[int, ...], what: str, path: Path) -> npt.NDArray[np.generic]:
    rows, cols, data = blob
    data = data if isinstance(data, bytes) else b""
    if not isinstance(rows, int) or cols not in columns or len(data) != rows * cols * np.dtype(form).itemsize:
        raise _fault(path, f"{what}: {rows} x {cols} values are stated, {len(data)} bytes are there")
    return np.frombuffer(data, form).reshape(rows, cols)


def _diameters(table: Float) -> Float:
    if table.shape[1] == 2:
        return np.zeros(len(table))
    if table.shape[1] == 4:
        return 2 * table[:, 2]
    return 2 * np.sqrt(np.abs(table[:, 2] * table[:, 5] - table[:, 3] * table[:, 4]))


def _fault(path: Path, what: str) -> InputError:
    return InputError(what, where=str(path), remedy="make the database again")
