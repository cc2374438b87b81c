"""What the variants that look for features share: options, features image by image, matches pair by pair."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from aatri.adapters.interior.feature_tracks import MatchedFeatures, with_tie_points
from aatri.adapters.interior.image_pixels import CELLS, covered_cells
from aatri.adapters.pairs.image_pairs import images_of_strip
from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.artifacts.features import Features, Matches
from aatri.checks.limits import FEWEST_CELLS
from aatri.errors import InputError
from aatri.formats.text.text_line import word_lines
from aatri.ids import several, shown
from aatri.pixels.limits import NEXT_RATIO
from aatri.pixels.matching import all_pairs, coarse_pairs, consecutive_pairs, largest, near_pairs
from aatri.plugin import Context, Field, InputPath, Options
from aatri.progress import Item, Kept


class CheckOptions(Options):
    """Options of matches that become tie points."""

    min_matches: int = Field(15, ge=8, description="a pair with fewer matches that pass the check is left out")
    snooping_limit: float = Field(4.0, gt=0, description="a match is rejected beyond this test statistic of its pair")
    sigma_px: float = Field(0.25, gt=0, description="standard deviation of the smallest features, px")
    prefix: str = Field("t", description="what the ids of tie points begin with")
    readout_s: float | None = Field(
        None,
        description="rolling shutter: time from the first row of the file to the last, negative if read upwards, s; "
        "the time of an image is that of its middle row",
    )


class FeatureOptions(CheckOptions):
    """Options of features that are found in the pixels."""

    most: int = Field(4000, ge=100, description="features of an image at most")
    ratio: float = Field(NEXT_RATIO, gt=0, lt=1, description="largest ratio of the distance of a match to the second")
    pairs: Literal["auto", "positions", "strips", "coarse", "all"] = Field(
        "auto",
        description="which images are matched: near each other, in strips, by their largest features, all; auto: "
        "positions where all images have one, else coarse",
    )
    neighbours: int = Field(8, ge=1, description="with positions and strips: so many nearest images of each")
    pairs_file: InputPath | None = Field(None, description="file of pairs, `image image` a line, instead")


def with_features(
    block: Block,
    features_of: Callable[..., Features],
    settings: tuple[int, ...],
    matches_of: Callable[..., Matches],
    options: FeatureOptions,
    context: Context,
) -> Block:
    """The block with tie points by features of its images, kept one by one, and their matches.

    Parameters
    ----------
    features_of : callable
        Of a file, its mask, the digest of their content and `settings`.
    matches_of : callable
        Of two Features and `options.ratio`.
    """
    images = np.flatnonzero(block.images.active)
    rows = block.images.take(images)
    if lacking := rows.id[rows.path == ""].tolist():
        what = f"{several(len(lacking), 'image', 'has', 'have')} no file: {shown(lacking)}"
        raise InputError(what, where="images.csv", remedy="name it in the column path")
    work = [
        Item(name, (path, mask), (content, *settings))
        for name, path, mask, content in zip(*(c.tolist() for c in (rows.id, rows.path, rows.mask, rows.content)))
    ]
    features = context.mapped(features_of, work, Features, "images")
    pairs = _chosen_pairs(block, images, features, options, context)
    work = [
        Item(f"{rows.id[i]} and {rows.id[j]}", (), (features[i], features[j], options.ratio)) for i, j in pairs.tolist()
    ]
    matches = [kept.load().pairs for kept in context.mapped(matches_of, work, Matches, "pairs")]
    keypoints = [kept.load().keypoints for kept in features]
    matched = MatchedFeatures(
        images,
        [k.xy_px for k in keypoints],
        [k.size_px for k in keypoints],
        pairs,
        [np.column_stack([m.left, m.right]) for m in matches],
    )
    return checked(block, matched, options, context)


def checked(block: Block, matched: MatchedFeatures, options: CheckOptions, context: Context) -> Block:
    """The block with tie points by matches; images with few of them are named."""
    matched_block = with_tie_points(
        block, matched, **options.model_dump(include=set(CheckOptions.model_fields)), reporter=context
    )
    _tell_weak(matched_block, np.flatnonzero(block.images.active), context)
    return matched_block


def _tell_weak(block: Block, images: Int, context: Context) -> None:
    """Name images of which large parts have no point, and those with none at all."""
    share = covered_cells(block)[images]
    none = block.images.id[images[share == 0]]
    weak = block.images.id[images[(share > 0) & (share < FEWEST_CELLS)]]
    if len(none):
        context.warn(f"{several(len(none), 'image', 'has', 'have')} no tie point: {shown(none)}")
    if len(weak):
        context.warn(
            f"{several(len(weak), 'image', 'has', 'have')} tie points in less than {FEWEST_CELLS:.0%} of "
            f"their {CELLS} x {CELLS} cells: {shown(weak)}"
        )


def _chosen_pairs(
    block: Block, images: Int, features: Sequence[Kept], options: FeatureOptions, context: Context
) -> Int:
    """Pairs (m, 2) of images as the options say, by their places among `images`.

    Raises
    ------
    InputError
        If what the pairs are to be chosen by is not there.
    """
    if options.pairs_file is not None:
        return _listed(options.pairs_file, block, images, context)
    position_m = block.positions_m
    placed = np.isfinite(position_m[images, :2]).all(axis=1)
    pairing = options.pairs
    if pairing == "auto":
        pairing = (
            "positions" if placed.all() and len(np.unique(position_m[images, :2], axis=0)) == len(images) else "coarse"
        )
    if pairing == "positions":
        if not placed.any():
            remedy = "pairs: coarse"
            raise InputError("no image has a position, by which pairs are chosen", where=block.name, remedy=remedy)
        pairs = near_pairs(position_m[images], options.neighbours)
        return _and_coarse(pairs, np.flatnonzero(~placed), features)
    if pairing == "strips":
        place = np.full(len(block.images), -1)
        place[images] = np.arange(len(images))
        strips = [place[images_of_strip(block, strip)] for strip in range(len(block.strips))]
        if not strips:
            raise InputError("no image has a strip", where=block.name, remedy="pairs: coarse")
        return np.concatenate([consecutive_pairs(strip, options.neighbours) for strip in strips])
    if pairing == "coarse":
        return coarse_pairs([largest(f.load().keypoints) for f in features])
    return all_pairs(len(images))


def _and_coarse(pairs: Int, lost: Int, features: Sequence[Kept]) -> Int:
    """The pairs, and for images without a position those whose largest features match."""
    if not len(lost):
        return pairs
    coarse = coarse_pairs([largest(f.load().keypoints) for f in features])
    return np.unique(np.concatenate([pairs, coarse[np.isin(coarse, lost).any(axis=1)]]), axis=0)


def _listed(path: Path, block: Block, images: Int, context: Context) -> Int:
    place = {name: k for k, name in enumerate(block.images.id[images].tolist())}
    pairs = set()
    for line in word_lines(path, context):
        line.of_width(2, "a pair `image image`")
        for name in line.words:
            if name not in place:
                raise line.error(f"image {name!r} is not in the block", "mend the name, or take the pair out")
        i, j = sorted(place[name] for name in line.words)
        if i != j:
            pairs.add((i, j))
    return np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)
