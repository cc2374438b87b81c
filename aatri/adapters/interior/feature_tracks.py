"""Tie points of a Block from matched features: each pair checked by five points, what passes joined to tracks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adapters.interior.image_pixels import pixel_matrices, with_image_points
from aatri.adapters.limits import SMALLEST_PX
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.geometry.coplanarity import RayPairs
from aatri.ids import several, shown
from aatri.orientation.relative.essential import essential_orientations
from aatri.orientation.relative.tracks import lone_joints, tracks_of
from aatri.progress import Reporter


@dataclass(frozen=True)
class MatchedFeatures:
    """Features of images, and what agrees between two of them."""

    images: Int
    """(k,). Rows in the images of the Block."""
    xy_px: Sequence[Float]
    """Of each image (n, 2), from the centre of the first pixel."""
    size_px: Sequence[Float]
    """Of each image (n,): diameters."""
    pairs: Int
    """(m, 2). Places of both images among `images`."""
    matches: Sequence[Int]
    """Of each pair (p, 2): rows of features in both."""


def with_tie_points(
    block: Block,
    features: MatchedFeatures,
    *,
    sigma_px: float,
    min_matches: int,
    snooping_limit: float,
    prefix: str,
    readout_s: float | None,
    reporter: Reporter,
) -> Block:
    """The block with tie points; those of control that it has stay.

    Parameters
    ----------
    sigma_px : float
        Standard deviation of the smallest features; of others it grows with their size.
    min_matches : int
        A pair with fewer matches, before or after its check, is left out.
    snooping_limit : float
        A match is rejected beyond this test statistic of its pair.
    prefix : str
        What the ids of tie points begin with.
    readout_s : float, optional, s
        From the first row to the last of a rolling shutter.

    Raises
    ------
    InputError
        If no pair has enough matches, or none is left.
    """
    sigmas_px = [sigma_px * np.maximum(size / SMALLEST_PX, 1.0) for size in features.size_px]
    first = np.concatenate([[0], np.cumsum([len(xy) for xy in features.xy_px])])
    matches = _checked(block, features, sigmas_px, min_matches, snooping_limit, reporter)
    _tell_lone_joints(block, features, matches, reporter)
    ends = [np.zeros((0, 2), np.int64), *(first[features.pairs[k]] + rows for k, rows in matches.items())]
    left, right = np.concatenate(ends).T
    tracks = tracks_of(left, right, first)
    rays = np.bincount(tracks.track)
    reporter.log(
        f"{several(len(rays), 'tie point')} with {several(len(tracks.track), 'image point')}, "
        f"{int((rays > 2).sum())} in three images and more; {tracks.refused} refused with two places in one image"
    )
    if not len(rays):
        raise InputError("no tie points: the images have nothing in common", where=block.name, remedy="see the log")
    names = np.array([f"{prefix}{k + 1:0{len(str(len(rays)))}d}" for k in range(len(rays))])
    at = first[tracks.image] + tracks.keypoint
    image, xy_px = features.images[tracks.image], np.concatenate(features.xy_px)[at]
    row_time_s = np.full(len(image), np.nan)
    if readout_s is not None:  # the image's time is that of its middle row
        height = block.cameras.format[block.images.camera[image], 1]
        row_time_s = ((xy_px[:, 1] + 0.5) / height - 0.5) * readout_s
    return with_image_points(
        block, image, names[tracks.track], xy_px, np.concatenate(sigmas_px)[at], row_time_s=row_time_s
    )


def _tell_lone_joints(block: Block, features: MatchedFeatures, matches: dict[int, Int], reporter: Reporter) -> None:
    """Name pairs without which the block falls apart: a wrong one bends it unseen."""
    pairs, counts = features.pairs[list(matches)], [len(rows) for rows in matches.values()]
    joints = lone_joints(pairs, len(features.images))
    if len(features.images) > 2 and len(joints):
        ids = block.images.id[features.images]
        names = [f"{ids[i]} - {ids[j]} ({counts[k]} matches)" for k, (i, j) in zip(joints, pairs[joints].tolist())]
        reporter.warn(f"{several(len(joints), 'joint', 'hangs', 'hang')} on one pair of images each: {shown(names)}")


def merged_places(xy_px: Sequence[Float], pairs: Int, matches: Sequence[Int]) -> list[Int]:
    """Matches in which features at one place of an image count as the first of them: orientations are no points.

    Parameters
    ----------
    xy_px, pairs, matches
        As of `MatchedFeatures`.
    """
    first = []
    for xy in xy_px:
        _, row, place = np.unique(np.round(xy, 2), axis=0, return_index=True, return_inverse=True)
        first.append(row[place.ravel()])
    places = []
    for (left, right), rows in zip(pairs.tolist(), matches):
        same = np.column_stack([first[left][rows[:, 0]], first[right][rows[:, 1]]])
        places.append(np.unique(same, axis=0))
    return places


def _checked(
    block: Block,
    features: MatchedFeatures,
    sigmas_px: list[Float],
    min_matches: int,
    snooping_limit: float,
    reporter: Reporter,
) -> dict[int, Int]:
    """Matches that pass the check of their pair, by the number of the pair."""
    matrix = pixel_matrices(block)[features.images]
    c_mm = block.cameras.principal_distance_mm[block.images.camera[features.images]]
    placed = np.asarray(np.isfinite(matrix).all(axis=(1, 2)))
    if not placed.all():
        names = shown(block.images.id[features.images[~placed]].tolist())
        reporter.warn(f"film images whose fiducial marks do not place them get no tie points: {names}")
    of_placed = np.asarray(placed[features.pairs].all(axis=1))
    enough = [k for k, rows in enumerate(features.matches) if of_placed[k] and len(rows) >= min_matches]
    if not enough:
        what = f"of {len(features.pairs)} pairs of images none has {min_matches} matches"
        remedy = "images that overlap, sharp ones; more features (`most`); `pairs: all`"
        raise InputError(what, where=block.name, remedy=remedy)

    def rays(image: int, rows: Int) -> tuple[Float, Float]:
        xy = features.xy_px[image][rows] @ matrix[image, :, :2].T + matrix[image, :, 2]
        sigma = sigmas_px[image][rows, None] * np.abs(matrix[image, :, :2]).sum(axis=1)
        return np.column_stack([xy, np.full(len(xy), -c_mm[image])]), sigma

    sides = [[rays(int(features.pairs[k, side]), features.matches[k][:, side]) for k in enough] for side in (0, 1)]
    of_pairs = RayPairs(*(np.concatenate([ray[part] for ray in side]) for part in (0, 1) for side in sides))
    start = np.concatenate([[0], np.cumsum([len(features.matches[k]) for k in enough])])
    fit = essential_orientations(
        of_pairs, start, snooping_limit=snooping_limit, min_points=min_matches, reporter=reporter
    ).orientations
    passed = {}
    for p, k in enumerate(enough):
        active = fit.active[start[p] : start[p + 1]]
        if fit.formed[p] and active.sum() >= min_matches:
            passed[k] = features.matches[k][active]
    reporter.log(
        f"{several(len(features.pairs), 'pair')}, {len(enough)} with {min_matches} matches, "
        f"{len(passed)} pass the check with {sum(map(len, passed.values()))} of {start[-1]} matches"
    )
    return passed
