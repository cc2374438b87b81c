"""A block to be merged or cut: a block folder, or the Block that a stage of another run has made."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.formats.tables.reader import read_block
from aatri.formats.text.text_file import missing
from aatri.progress import Reporter
from aatri.tables.hdf5 import read

SUFFIX = ".h5"


def block_from(path: Path, reporter: Reporter, of_screening: frozenset[str] = frozenset()) -> Block:
    """The block of a folder or an artifact.

    Parameters
    ----------
    path : Path
        A folder with block.yaml, or a Block artifact (runs/NAME/current/block.h5).
    of_screening : frozenset of str
        Reasons for which rows were set aside that hold for the block as it stood alone: such rows are in use again.

    Raises
    ------
    InputError
        If there is neither.
    """
    if not path.exists():
        raise missing(path)
    if path.is_dir():
        return read_block(path, reporter)
    if path.suffix != SUFFIX:
        raise InputError(
            "is neither a block folder nor the Block of a run",
            where=str(path),
            remedy=f"a folder with block.yaml, or runs/NAME/current/block{SUFFIX}; others: `aatri convert` first",
        )
    return _in_use_again(read(path, Block), of_screening)


def _in_use_again(block: Block, reasons: frozenset[str]) -> Block:
    """Without the rejects of these reasons: images and image points are active again."""
    rejects = block.rejects
    again = np.isin(rejects.reason, list(reasons))
    images, points = block.images, block.image_points
    of_images = np.isin(images.id, rejects.id[again & (rejects.kind == "image")])
    names = set(rejects.id[again & (rejects.kind == "image_point")].tolist())
    of_points = np.zeros(len(points), dtype=bool)
    for k in np.flatnonzero(~points.active).tolist() if names else ():
        of_points[k] = f"{block.images.id[points.image[k]]}/{block.points.id[points.point[k]]}" in names
    return replace(
        block,
        images=replace(images, active=images.active | of_images),
        image_points=replace(points, active=points.active | of_points),
        rejects=rejects.take(~again),
    )
