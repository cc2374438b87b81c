"""A COLMAP sparse model: cameras, images with their features, points.

P = R(q) X + t has x right, y down, z forward; x, y are pixels from the upper left corner of the image, so that the
centre of the first pixel is (0.5, 0.5). Files: `colmap_text`, `colmap_binary`.

Source: colmap.github.io, Output format; src/colmap/sensor/models.h.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from aatri.arrays import Float, Int

MODELS = {
    "SIMPLE_PINHOLE": 3,
    "PINHOLE": 4,
    "SIMPLE_RADIAL": 4,
    "RADIAL": 5,
    "OPENCV": 8,
    "OPENCV_FISHEYE": 8,
    "FULL_OPENCV": 12,
    "FOV": 5,
    "SIMPLE_RADIAL_FISHEYE": 4,
    "RADIAL_FISHEYE": 5,
    "THIN_PRISM_FISHEYE": 12,
    "RAD_TAN_THIN_PRISM_FISHEYE": 16,
    "SIMPLE_DIVISION": 4,
    "DIVISION": 5,
    "SIMPLE_FISHEYE": 3,
    "FISHEYE": 4,
    "EUCM": 6,
    "EQUIRECTANGULAR": 2,
}
"""Camera models by their number in binary files, with the count of parameters."""

NAMES = ("cameras", "images", "points3D")
NO_POINT = -1
"""Point of a feature that has none."""


@dataclass(frozen=True)
class ColmapCamera:
    """A camera; size in px, parameters in the order of its model, line of the file (0: binary)."""

    id: int
    model: str
    width: int
    height: int
    parameters: tuple[float, ...]
    line: int = 0


@dataclass(frozen=True)
class ColmapImage:
    """An image: P = R(q) X + t; features xy in px with the id of their point, or -1; line of the file (0: binary)."""

    id: int
    quaternion: tuple[float, ...]
    translation: tuple[float, ...]
    camera: int
    name: str
    xy_px: Float
    point: Int
    line: int = 0


@dataclass(frozen=True)
class ColmapModel:
    """A sparse model."""

    cameras: list[ColmapCamera]
    images: list[ColmapImage]
    points: Int
    """(p,) int64. Ids of the points."""
    xyz: Float
    """(p, 3)."""
    point_lines: Int
    """(p,) int32. Lines of the file (0: binary)."""
    paths: list[Path]
    """The files, in the order of `NAMES`."""
    track: Int = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    """(t, 3) int64. Point, image, and row of the feature, as points3D repeats them."""
    error_px: list[float] = field(default_factory=list)
    """(p,) float64, px. Mean reprojection error, -1 not known; not read."""

    def tracks(self) -> list[list[tuple[int, int]]]:
        """For each point the images and the rows of their features that show it."""
        row = {name: k for k, name in enumerate(self.points.tolist())}
        tracks: list[list[tuple[int, int]]] = [[] for _ in row]
        for image in self.images:
            for k, point in enumerate(image.point.tolist()):
                if point != NO_POINT:
                    tracks[row[point]].append((image.id, k))
        return tracks
