"""What the variants that look for features share: options, features image by image, matches pair by pair."""

from collections.abc import Callable
from typing import Literal

import numpy as np

from aatri.adapters.interior.feature_tracks import MatchedFeatures, with_tie_points
from aatri.adapters.interior.image_pixels import CELLS, covered_cells
from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.artifacts.features import Features, Matches
from aatri.checks.limits import FEWEST_CELLS
from aatri.errors import InputError
from aatri.ids import several, shown
from aatri.pixels.matching import RATIO
from aatri.plugin import Context, Field, InputPath, Options
from aatri.progress import Item

from ._pairs import chosen_pairs


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
    ratio: float = Field(RATIO, gt=0, lt=1, description="largest ratio of the distance of a match to the second")
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
    pairs = chosen_pairs(block, images, features, options, context)
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
