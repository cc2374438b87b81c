"""Pairs of images to orient: consecutive images of the strips, given or found from the overlaps."""

from __future__ import annotations

import numpy as np

from aatri.adapters.pairs.image_pairs import neighbouring_images
from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.notes import Note
from aatri.orientation.strips.overlap_order import strips_by_overlap


def strip_pairs(block: Block, image_points: ImagePoints) -> tuple[Int, tuple[Note, ...]]:
    """Consecutive images of all strips, (m, 2) rows in images; images without strip are put in order by overlap."""
    given = neighbouring_images(block)
    loose = block.images.active & (block.images.strip < 0)
    if loose.sum() < 2:
        return given, ()
    m = image_points.measurements
    rows = np.flatnonzero(m.active & np.isfinite(m.xy_mm).all(axis=1) & loose[m.image])
    chains = strips_by_overlap(m.image[rows], m.point[rows], m.xy_mm[rows], len(block.images))
    pairs = [np.column_stack([chain[:-1], chain[1:]]) for chain in chains]
    ids = block.images.id
    told = tuple(f"{ids[chain[0]]} ... {ids[chain[-1]]} ({len(chain)} images)" for chain in chains)
    text = f"no strip given for {int(loose.sum())} images: {len(chains)} strips found from the overlaps"
    return np.concatenate([given, *pairs]), (Note("warning", text, told),)
