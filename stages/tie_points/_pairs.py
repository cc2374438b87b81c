"""Which images are matched."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aatri.adapters.pairs.image_pairs import images_of_strip
from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.formats.text.text_line import word_lines
from aatri.pixels.matching import all_pairs, coarse_pairs, consecutive_pairs, largest, near_pairs
from aatri.plugin import Context
from aatri.progress import Kept

if TYPE_CHECKING:
    from ._features import FeatureOptions


def chosen_pairs(block: Block, images: Int, features: Sequence[Kept], options: FeatureOptions, context: Context) -> Int:
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
