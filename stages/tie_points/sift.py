"""Tie points by scale-invariant features: found in each image, matched in pairs, checked by five points, joined.

    D = G(k s) * I - G(s) * I          features: extrema in x, y and scale, spread over the cells of an image
    d_1 < 0.8 d_2, mutual              matches
    u1' E u2 = 0                       checked by five-point essential matrices and data snooping
    s = s_0 max(size / smallest, 1)    standard deviation of an image point, by the size of its feature

Features of an image and matches of a pair are kept one by one: what was killed goes on, an image more makes itself and
its pairs. Pairs are images near each other (by positions), of one strip, all, or those whose largest features match.
Matches that pass the check are joined to tracks; a track with two features of one image is refused. What passes goes on
to `initial_orientation/graph` and the bundle, which search again for what a pair alone cannot show.

Image points that the block has already, of control, stay. Source: Lowe 2004, IJCV 60, 91; Nister, PAMI 26 (2004) 756.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from aatri.adapters.interior.image_pixels import CELLS, covered_cells, pixel_matrices, with_image_points
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.features import Features, Matches
from aatri.checks.limits import FEWEST_CELLS
from aatri.errors import InputError
from aatri.geometry.coplanarity import RayPairs
from aatri.ids import shown
from aatri.orientation.relative.essential import essential_orientations
from aatri.pixels.features import features_of
from aatri.pixels.matching import RATIO, matches_of
from aatri.pixels.tracks import tracks_of
from aatri.plugin import SILENT, Context, Field, InputPath, Options, stage
from aatri.progress import Item, Kept

from ._pairs import chosen_pairs


class SiftOptions(Options):
    """Options of the tie points by features."""

    most: int = Field(4000, ge=100, description="features of an image at most")
    cells: int = Field(16, ge=1, description="cells along the longer side of an image, from which features are taken")
    ratio: float = Field(RATIO, gt=0, lt=1, description="largest ratio of the distance of a match to the second")
    pairs: Literal["auto", "positions", "strips", "coarse", "all"] = Field(
        "auto",
        description="which images are matched: near each other, in strips, by their largest features, all; auto: "
        "positions where all images have one, else coarse",
    )
    neighbours: int = Field(8, ge=1, description="with positions and strips: so many nearest images of each")
    pairs_file: InputPath | None = Field(None, description="file of pairs, `image image` a line, instead")
    min_matches: int = Field(15, ge=8, description="a pair with fewer matches that pass the check is left out")
    snooping_limit: float = Field(4.0, gt=0, description="a match is rejected beyond this test statistic of its pair")
    sigma_px: float = Field(0.25, gt=0, description="standard deviation of the smallest features, px")
    prefix: str = Field("t", description="what the ids of tie points begin with")


SMALLEST_PX = 4.0
"""Diameter up to which features are as good as small ones get."""


@stage(version=1, uses=())
def sift(block: Block, *, options: SiftOptions = SiftOptions(), context: Context = SILENT) -> Block:
    """Find tie points."""
    images = np.flatnonzero(block.images.active)
    rows = block.images.take(images)
    if lacking := rows.id[rows.path == ""].tolist():
        what = f"{len(lacking)} images have no file: {shown(lacking)}"
        raise InputError(what, where="images.csv", remedy="name it in the column path")
    matrix = pixel_matrices(block)[images]
    work = [
        Item(name, (path, mask), (content, options.most, options.cells))
        for name, path, mask, content in zip(*(c.tolist() for c in (rows.id, rows.path, rows.mask, rows.content)))
    ]
    features = context.mapped(features_of, work, Features, "images")
    pairs = chosen_pairs(block, images, features, options, context)
    work = [
        Item(f"{rows.id[i]} and {rows.id[j]}", (), (features[i], features[j], options.ratio)) for i, j in pairs.tolist()
    ]
    matches = context.mapped(matches_of, work, Matches, "pairs")
    keypoints = [f.load().keypoints for f in features]
    xy_px = [k.xy_px for k in keypoints]
    sigma_px = [options.sigma_px * np.maximum(k.size_px / SMALLEST_PX, 1.0) for k in keypoints]
    first = np.concatenate([[0], np.cumsum([len(xy) for xy in xy_px])])
    left, right = _checked(block, images, pairs, matches, first, matrix, (xy_px, sigma_px), options, context)
    tracks = tracks_of(left, right, first)
    rays = np.bincount(tracks.track)
    context.log(f"{len(rays)} tie points with {len(tracks.track)} image points, {int((rays > 2).sum())} in three "
                f"images and more; {tracks.refused} refused with two places in one image")  # fmt: skip
    if not len(rays):
        raise InputError("no tie points: the images have nothing in common", where=block.name, remedy="see the log")
    digits = len(str(len(rays)))
    names = np.array([f"{options.prefix}{k + 1:0{digits}d}" for k in range(len(rays))])
    at = first[tracks.image] + tracks.keypoint
    made = with_image_points(
        block, images[tracks.image], names[tracks.track], np.concatenate(xy_px)[at], np.concatenate(sigma_px)[at]
    )
    _tell_weak(made, images, context)
    return made


def _checked(
    block: Block,
    images: Int,
    pairs: Int,
    matches: Sequence[Kept],
    first: Int,
    matrix: Float,
    of_features: tuple[list[Float], list[Float]],
    options: SiftOptions,
    context: Context,
) -> tuple[Int, Int]:
    """Matches that pass the check of their pair, as features counted through all images."""
    xy_px, sigma_px = of_features
    c_mm = block.cameras.principal_distance_mm[block.images.camera[images]]
    rows = [m.load().pairs for m in matches]
    kept = [k for k, of in enumerate(rows) if len(of) >= options.min_matches]
    if not kept:
        what = f"of {len(pairs)} pairs of images none has {options.min_matches} matches"
        remedy = "images that overlap, sharp ones; more features (`most`); `pairs: all`"
        raise InputError(what, where=block.name, remedy=remedy)

    def rays(k: int, keypoint: Int) -> tuple[Float, Float]:
        xy = xy_px[k][keypoint] @ matrix[k, :, :2].T + matrix[k, :, 2]
        sigma = sigma_px[k][keypoint, None] * np.abs(matrix[k, :, :2]).sum(axis=1)
        return np.column_stack([xy, np.full(len(xy), -c_mm[k])]), sigma

    left = [rays(int(pairs[k, 0]), rows[k].left) for k in kept]
    right = [rays(int(pairs[k, 1]), rows[k].right) for k in kept]
    of_pairs = RayPairs(*(np.concatenate([side[part] for side in of]) for part in (0, 1) for of in (left, right)))
    start = np.concatenate([[0], np.cumsum([len(rows[k]) for k in kept])])
    made = essential_orientations(
        of_pairs, start, snooping_limit=options.snooping_limit, min_points=options.min_matches, reporter=context
    )
    fit = made.orientations
    good = [
        p
        for p in range(len(kept))
        if fit.formed[p] and fit.active[start[p] : start[p + 1]].sum() >= options.min_matches
    ]
    use = np.concatenate([np.zeros(0, bool), *(fit.active[start[p] : start[p + 1]] for p in good)])
    context.log(f"{len(pairs)} pairs, {len(kept)} with {options.min_matches} matches, {len(good)} pass the check with "
                f"{int(use.sum())} of {start[-1]} matches")  # fmt: skip
    ends = [
        np.concatenate(
            [np.zeros(0, np.int64), *(first[pairs[kept[p], side]] + getattr(rows[kept[p]], name) for p in good)]
        )
        for side, name in enumerate(("left", "right"))
    ]
    return ends[0][use], ends[1][use]


def _tell_weak(block: Block, images: Int, context: Context) -> None:
    """Name images of which large parts have no point, and those with none at all."""
    share = covered_cells(block)[images]
    none = block.images.id[images[share == 0]]
    weak = block.images.id[images[(share > 0) & (share < FEWEST_CELLS)]]
    if len(none):
        context.warn(f"{len(none)} images have no tie point: {shown(none)}")
    if len(weak):
        context.warn(f"{len(weak)} images have tie points in less than {FEWEST_CELLS:.0%} of their {CELLS} x {CELLS} "
                     f"cells: {shown(weak)}")  # fmt: skip
