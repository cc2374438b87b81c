"""A COLMAP sparse model: cameras, images with their features, points.

P = R(q) X + t has x right, y down, z forward; x, y are pixels from the upper left corner of the image, so that the
centre of the first pixel is (0.5, 0.5). Files: `colmap_text`, `colmap_binary`.

Source: colmap.github.io, Output format; src/colmap/sensor/models.h.

What a COLMAP model states of itself, held against what was read: tracks of points, numbers of images and points.

Tracks repeat the features of the images. An image that a track names and that is not there has been left out, or the
file is cut: a warning. A track that contradicts a feature is an error: one of the two files was changed.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from aatri.arrays import Float, Int
from aatri.errors import InputError
from aatri.ids import several, shown
from aatri.progress import Reporter

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

_COUNT = re.compile(r"#\s*Number of (cameras|images|points):\s*([0-9]{1,15})\b")


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


def stated_counts(lines: list[str]) -> dict[str, int]:
    """Numbers in the comments at the top of a text file, by what is counted."""
    matches = (_COUNT.match(line) for line in lines[:10])
    return {match.group(1): int(match.group(2)) for match in matches if match}


def compare_count(path: Path, stated: dict[str, int], what: str, read: int, reporter: Reporter) -> None:
    """Warn if a file has not as many rows as its comment says."""
    if stated.get(what, read) != read:
        reporter.warn(f"{path}: its first lines say {stated[what]} {what}, {read} follow: is it complete?")


def compare_tracks(model: ColmapModel, reporter: Reporter) -> list[InputError]:
    """Errors of tracks that contradict the features; a warning of images that are not there."""
    track = model.track
    if not len(track):  # not every program writes them
        return []
    images = np.array([image.id for image in model.images], dtype=np.int64)
    here = np.isin(track[:, 1], images)
    if len(away := np.unique(track[~here, 1])):
        reporter.warn(
            f"{model.paths[2]}: its tracks name {several(len(away), 'image', 'that is', 'that are')} not "
            f"in {model.paths[1].name}: {shown(map(str, away.tolist()))}; is it complete?"
        )
    features = [
        np.stack([image.point[k], np.full(len(k), image.id), k], axis=1)
        for image in model.images
        for k in [np.flatnonzero(image.point != NO_POINT)]
    ]
    of_images = np.concatenate(features or [np.zeros((0, 3), dtype=np.int64)])
    if np.array_equal(_sorted(track[here]), _sorted(of_images)):
        return []
    lacking, more = _not_in(track[here], of_images), _not_in(of_images, track[here])
    if not len(lacking) + len(more):
        return []
    where, line = str(model.paths[2]), dict(zip(model.points.tolist(), model.point_lines.tolist()))
    point, image, index = (lacking if len(lacking) else more)[0].tolist()
    where += f":{line[point]}" if line.get(point) else ""
    says = "its track says so, the image does not" if len(lacking) else "the image says so, its track does not"
    what = (
        f"point {point} is feature {index} of image {image}: {says}; "
        f"{several(len(lacking) + len(more), 'such contradiction')}"
    )
    return [InputError(what, where=where, remedy="export the model again")]


def _sorted(rows: Int) -> Int:
    return rows[np.lexsort(rows.T)]


def _not_in(rows: Int, others: Int) -> Int:
    """Rows that are not among others, (k, 3)."""
    both = np.unique(
        np.concatenate([np.unique(rows, axis=0), np.unique(others, axis=0), np.unique(others, axis=0)]),
        axis=0,
        return_counts=True,
    )
    return np.asarray(both[0][both[1] == 1])
