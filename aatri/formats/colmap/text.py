"""COLMAP's sparse model as text files.

    cameras.txt    id model width height params ...
    images.txt     id qw qx qy qz tx ty tz camera name | x y point3D x y point3D ...     two lines per image
    points3D.txt   id X Y Z R G B error image index image index ...

`#` begins a comment. A point3D of -1 is a feature without a point. Rigs and frames (rigs.txt, frames.txt of COLMAP
3.12) repeat the poses of the images and are not needed. Numbers are written so that they read back to the same bits.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aatri.arrays import Float, Int
from aatri.formats.colmap.model import (
    MODELS,
    NAMES,
    ColmapCamera,
    ColmapImage,
    ColmapModel,
    compare_count,
    stated_counts,
)
from aatri.formats.text.number_text import numbers_of, what_is_wrong, whole_number_of
from aatri.formats.text.text_file import read_lines
from aatri.formats.text.text_line import TextLine, blank_separated
from aatri.ids import clipped, did_you_mean, several
from aatri.progress import SILENT, Reporter

FEW_DIGITS = 18
"""Digits that any number of 64 bits can have."""


def text_paths(folder: Path) -> list[Path]:
    """The three files."""
    return [folder / f"{name}.txt" for name in NAMES]


def read_text(folder: Path, reporter: Reporter = SILENT) -> ColmapModel:
    """Read text files.

    Raises
    ------
    InputError
        If a file is missing or not of its form.
    """
    paths = text_paths(folder)
    lines = [read_lines(path, reporter) for path in paths]
    cameras = [_camera(row) for row in _rows(paths[0], lines[0])]
    images = _images(paths[1], lines[1])
    points, xyz, at, track = _points(_rows(paths[2], lines[2]))
    counts = (("cameras", len(cameras)), ("images", len(images)), ("points", len(points)))
    for path, text, (what, count) in zip(paths, lines, counts):
        compare_count(path, stated_counts(text), what, count, reporter)
    return ColmapModel(cameras, images, points, xyz, at, paths, track)


def texts_of(model: ColmapModel) -> dict[str, str]:
    """The text files of a model, by their names."""
    cameras = ["# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]"]
    cameras += [f"{c.id} {c.model} {c.width} {c.height} {_joined(c.parameters)}" for c in model.cameras]
    images = ["# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME", "# POINTS2D[] as X Y POINT3D_ID"]
    for image in model.images:
        images.append(f"{image.id} {_joined((*image.quaternion, *image.translation))} {image.camera} {image.name}")
        rows = zip(image.xy_px.tolist(), image.point.tolist())
        images.append(" ".join(f"{x!r} {y!r} {point}" for (x, y), point in rows))
    points = ["# POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX"]
    tracks = model.tracks()
    for k, (name, xyz) in enumerate(zip(model.points.tolist(), model.xyz.tolist())):
        track = " ".join(f"{image} {row}" for image, row in tracks[k])
        points.append(f"{name} {_joined(xyz)} 0 0 0 {model.error_px[k]!r} {track}")
    return {f"{name}.txt": "\n".join([*lines, ""]) for name, lines in zip(NAMES, (cameras, images, points))}


def _joined(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


class _Row(TextLine):
    """A line of many numbers, which are read at once."""

    def values(self, start: int, stop: int | None = None) -> Float:
        words = self.words[start:stop]
        values, bad = numbers_of(words)
        if bad:
            word = words[bad[0]]
            raise self.error(f"{clipped(word)!r}: {what_is_wrong(word)}", "write it like -1234.5")
        return values

    def integer(self, k: int) -> int:
        try:
            return whole_number_of(self.words[k])
        except ValueError as error:
            raise self.error(f"{clipped(self.words[k])!r}: {error}", "write digits only, like 17") from error

    def integers(self) -> Int:
        """All words as whole numbers."""
        digits = "".join(self.words).replace("-", "")
        if self.words and digits.isascii() and digits.isdigit() and max(map(len, self.words)) <= FEW_DIGITS:
            try:
                return np.array(list(map(int, self.words)), dtype=np.int64)
            except ValueError:
                pass  # a minus sign within: which word it is, is told below
        return np.array([self.integer(k) for k in range(len(self.words))], dtype=np.int64)

    def at_least(self, width: int, what: str) -> None:
        if len(self.words) < width:
            raise self.error(f"{several(len(self.words), 'word')} where {what} should stand", f"write at least {width}")


def _rows(path: Path, lines: list[str]) -> list[_Row]:
    rows = [_Row(blank_separated(text), path, k) for k, text in enumerate(lines, 1)]
    return [row for row in rows if row.words and not row.words[0].startswith("#")]


def _camera(row: _Row) -> ColmapCamera:
    row.at_least(5, "id model width height params")
    model = row.words[1]
    if model not in MODELS:
        raise row.error(f"camera model {clipped(model)!r} is unknown{did_you_mean(model, MODELS)}", "convert it")
    if len(row.words) != 4 + MODELS[model]:
        what = f"{several(len(row.words) - 4, 'parameter')} of a {model}"
        raise row.error(what, f"it has {MODELS[model]}")
    return ColmapCamera(row.integer(0), model, row.integer(2), row.integer(3), tuple(row.values(4).tolist()), row.line)


def _images(path: Path, lines: list[str]) -> list[ColmapImage]:
    images: list[ColmapImage] = []
    head: _Row | None = None
    for k, text in enumerate(lines, 1):
        row = _Row(blank_separated(text), path, k)
        if row.words and row.words[0].startswith("#"):
            continue
        if head is not None:
            images.append(_image(head, row))
            head = None
        elif row.words:
            row.at_least(10, "id qw qx qy qz tx ty tz camera name")
            head = row
    if head is not None:
        images.append(_image(head, _Row([], path, head.line)))
    return images


def _image(head: _Row, features: _Row) -> ColmapImage:
    if len(features.words) % 3:
        what = f"{several(len(features.words), 'word')} where `x y point3D` should repeat"
        raise features.error(what, "each image has two lines, the second may be empty")
    words = features.words
    xy = np.stack([_Row(words[k::3], features.path, features.line).values(0) for k in (0, 1)], axis=1)
    ids = _Row(words[2::3], features.path, features.line)
    point = ids.integers()
    pose = head.values(1, 8).tolist()
    return ColmapImage(
        head.integer(0),
        tuple(pose[:4]),
        tuple(pose[4:]),
        head.integer(8),
        " ".join(head.words[9:]),
        xy,
        point,
        head.line,
    )


def _points(rows: list[_Row]) -> tuple[Int, Float, Int, Int]:
    """Ids, coordinates, lines and tracks."""
    tracks = [np.zeros((0, 3), dtype=np.int64)]
    for row in rows:
        row.at_least(8, "id X Y Z R G B error")
        track = _Row(row.words[8:], row.path, row.line).integers()
        if len(track) % 2:
            raise row.error(
                f"{several(len(track), 'word')} where `image index` should repeat", "export the model again"
            )
        tracks.append(np.insert(track.reshape(-1, 2), 0, row.integer(0), axis=1))
    return (
        np.array([row.integer(0) for row in rows], dtype=np.int64),
        np.array([row.values(1, 4) for row in rows], dtype=np.float64).reshape(-1, 3),
        np.array([row.line for row in rows], dtype=np.int32),
        np.concatenate(tracks),
    )
