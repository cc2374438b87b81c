"""Tie points from a database of COLMAP: features and matches that another program has made of the same images.

    u1' E u2 = 0                       checked by five-point essential matrices and data snooping
    s = s_0 max(size / smallest, 1)    standard deviation of an image point, by the size of its feature

Matches that have passed COLMAP's check of a pair are taken where the database has them, else all; they are checked
anew, and joined to tracks. Features at one place of an image count once. The names in the database are those of the
files, or ids of images. No pixels are read: the images need no file here, but a size.

Source: colmap.github.io, Database format; Nister, PAMI 26 (2004) 756.
"""

from pathlib import Path

import numpy as np

from aatri.adapters.interior.feature_tracks import MatchedFeatures, merged_places
from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.formats.colmap.database import ColmapFeatures, read_database
from aatri.ids import several, shown
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._features import CheckOptions, checked


class DatabaseOptions(CheckOptions):
    """Options of tie points from a database."""

    path: InputPath = Field(description="the database, a file")


@stage(version=1, uses=())
def database(block: Block, *, options: DatabaseOptions, context: Context = SILENT) -> Block:
    """Take tie points from a database."""
    features = read_database(options.path)
    row = _images(block, features, options.path, context)
    numbers = sorted(row)
    place = {number: k for k, number in enumerate(numbers)}
    empty = np.zeros((0, 2))
    xy_px = [features.xy_px.get(number, empty) for number in numbers]
    pairs = [pair for pair in features.matches if pair[0] in row and pair[1] in row]
    ends = np.array([[place[number] for number in pair] for pair in pairs], dtype=np.int64).reshape(-1, 2)
    matched = MatchedFeatures(
        np.array([row[number] for number in numbers]),
        xy_px,
        [features.size_px.get(number, empty[:, 0]) for number in numbers],
        ends,
        merged_places(xy_px, ends, [features.matches[pair] for pair in pairs]),
    )
    return checked(block, matched, options, context)


def _images(block: Block, features: ColmapFeatures, path: Path, context: Context) -> dict[int, int]:
    """Rows of the block's images by the ids of the database: by the end of their file's path, else by id."""
    rows: dict[int, int] = {}
    files = [Path(p).parts for p in block.images.path.tolist()]
    for number, name in features.name.items():
        parts = Path(name).parts
        same = [k for k, file in enumerate(files) if file[-len(parts) :] == parts]
        same = same or np.flatnonzero(np.isin(block.images.id, [name, Path(name).stem])).tolist()
        same = [k for k in same if block.images.active[k]]
        if len(same) > 1:
            what = f"image {name!r} may be {shown(block.images.id[same])}"
            raise InputError(what, where=str(path), remedy="names with as much of their path as tells them apart")
        if same and same[0] in rows.values():
            what = f"image {name!r} and another of its images are both {block.images.id[same[0]]}"
            raise InputError(what, where=str(path), remedy="a database with each photograph once")
        if same:
            rows[number] = same[0]
    if not rows:
        what = f"none of its images is one of the block: {shown(list(features.name.values()))}"
        raise InputError(what, where=str(path), remedy="the database of these photographs, with their file names")
    others = [name for number, name in features.name.items() if number not in rows]
    if others:
        context.warn(
            f"{path.name}: {several(len(others), 'image', 'is', 'are')} not in the block and left out: {shown(others)}"
        )
    sizes = block.cameras.format[block.images.camera]
    for number, k in rows.items():
        if np.isfinite(sizes[k]).all() and tuple(sizes[k]) != features.format_px[number]:
            stated, own = (f"{size[0]:.0f} x {size[1]:.0f}" for size in (features.format_px[number], sizes[k]))
            what = f"image {features.name[number]!r} has {stated} px there and {own} in the block"
            raise InputError(what, where=str(path), remedy="features of the photographs as they are, not reduced")
    return rows
