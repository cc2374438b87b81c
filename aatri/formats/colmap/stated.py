"""What a COLMAP model states of itself, held against what was read: tracks of points, numbers of images and points.

Tracks repeat the features of the images. An image that a track names and that is not there has been left out, or the
file is cut: a warning. A track that contradicts a feature is an error: one of the two files was changed.
"""

import re
from pathlib import Path

import numpy as np

from aatri.arrays import Int
from aatri.errors import InputError
from aatri.formats.colmap.model import NO_POINT, ColmapModel
from aatri.ids import several, shown
from aatri.progress import Reporter

_COUNT = re.compile(r"#\s*Number of (cameras|images|points):\s*([0-9]{1,15})\b")


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
