"""Which images of a block are paired, and the points they share, as arrays."""

from pathlib import Path

import numpy as np
from scipy.sparse import coo_array, csr_array, triu
from scipy.sparse.csgraph import connected_components

from aatri.adjustment.threads import by_rows, taken
from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.errors import InputError
from aatri.geometry.coplanarity import RayPairs
from aatri.ids import several, shown
from aatri.notes import Note
from aatri.orientation.relative.orientations import ImagePairs, common_points
from aatri.orientation.strips.overlap_order import strips_by_overlap


def images_of_strip(block: Block, strip: int) -> Int:
    """Active images of a strip in order: by sequence, then by id; those without a sequence come last."""
    rows = np.flatnonzero(block.images.active & (block.images.strip == strip))
    return rows[np.lexsort((rows, block.images.sequence[rows]))]


def neighbouring_images(block: Block) -> Int:
    """Consecutive images of all strips, (m, 2) rows in images."""
    strips = [images_of_strip(block, strip) for strip in range(len(block.strips))]
    pairs = [np.column_stack([rows[:-1], rows[1:]]) for rows in strips]
    return np.concatenate([np.zeros((0, 2), dtype=np.intp), *pairs])


def overlapping_images(block: Block, image_points: ImagePoints, least: int) -> tuple[Int, Int]:
    """Pairs of active images with at least `least` points in common, wherever they were taken.

    Returns
    -------
    images : (m, 2) int
        Rows in images, the smaller first.
    common : (m,) int
        Points in common.
    """
    m = image_points.measurements
    use = m.active & np.isfinite(m.xy_mm).all(axis=1) & block.images.active[m.image]
    seen = csr_array(
        (np.ones(int(use.sum()), dtype=np.int32), (m.image[use], m.point[use])),
        shape=(len(block.images), len(block.points)),
    )
    seen.sum_duplicates()
    seen.data[:] = 1  # of a point measured twice the first counts
    shared = triu((seen @ seen.T).tocoo(), k=1)
    enough = shared.data >= least
    pairs, common = np.column_stack([shared.row[enough], shared.col[enough]]), shared.data[enough]
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    return pairs[order].astype(np.intp), common[order].astype(np.int64)


def strip_pairs(block: Block, image_points: ImagePoints) -> tuple[Int, tuple[Note, ...]]:
    """Consecutive images of all strips, (m, 2) rows in images; images without strip are put in order by overlap."""
    declared = neighbouring_images(block)
    loose = block.images.active & (block.images.strip < 0)
    if loose.sum() < 2:
        return declared, ()
    m = image_points.measurements
    rows = np.flatnonzero(m.active & np.isfinite(m.xy_mm).all(axis=1) & loose[m.image])
    chains = strips_by_overlap(m.image[rows], m.point[rows], m.xy_mm[rows], len(block.images))
    pairs = [np.column_stack([chain[:-1], chain[1:]]) for chain in chains]
    ids = block.images.id
    chain_names = tuple(f"{ids[chain[0]]} ... {ids[chain[-1]]} ({several(len(chain), 'image')})" for chain in chains)
    text = (
        f"no strip given for {several(int(loose.sum()), 'image')}: {several(len(chains), 'strip')} "
        "found from the overlaps"
    )
    return np.concatenate([declared, *pairs]), (Note("warning", text, chain_names),)


def strongest_pairs(images: Int, common: Int, n_images: int, most: int, enough: int) -> Bool:
    """The pairs of most common points of every image, and those of fewer than `enough`, (m,).

    Of `joining_pairs` the latter are those without which parts fall asunder.

    Parameters
    ----------
    images : (m, 2) int
    common : (m,) int
    most : int
        Pairs of each image; a pair stays if it is among those of either image.
    """
    ends, m = images.T.ravel(), len(images)
    order = np.lexsort((np.tile(np.arange(m), 2), -np.tile(common, 2), ends))
    rank = np.arange(2 * m) - np.searchsorted(ends[order], np.arange(n_images))[ends[order]]
    kept = common < enough
    kept[order[rank < most] % max(m, 1)] = True
    return kept


def joining_pairs(images: Int, common: Int, n_images: int, enough: int, least: int) -> Bool:
    """Pairs of `enough` points, and those of at least `least` between images that the former do not join, (m,).

    Parameters
    ----------
    images : (m, 2) int
    common : (m,) int
    """
    strong = common >= enough
    left, right = images[strong].T
    part = connected_components(coo_array((np.ones(len(left)), (left, right)), shape=(n_images, n_images)), False)[1]
    return np.asarray(strong | ((common >= least) & (part[images[:, 0]] != part[images[:, 1]])))


def pairs_of(block: Block, image_points: ImagePoints, images: Int) -> ImagePairs:
    """The common points of pairs of images, from active measurements.

    Parameters
    ----------
    images : (m, 2) int
        Rows in images.
    """
    m = image_points.measurements
    usable = np.flatnonzero(m.active & np.isfinite(m.xy_mm).all(axis=1))
    key = m.image[usable].astype(np.int64) * len(block.points) + m.point[usable]
    order = np.argsort(key, kind="stable")
    rows, key = usable[order], key[order]
    single = np.concatenate([[True], key[1:] != key[:-1]])[: len(key)]  # of a point measured twice the first counts
    rows, key = rows[single], key[single]
    first = np.searchsorted(key, np.arange(len(block.images) + 1, dtype=np.int64) * len(block.points))
    left, right = (images[:, side].astype(np.int32) for side in (0, 1))
    start, a, b = common_points(images, first, m.point[rows])
    pair, a, b = np.repeat(np.arange(len(left)), np.diff(start)), rows[a], rows[b]
    c_mm = block.cameras.principal_distance_mm[block.images.camera]

    def rays(image: Int, row: Int) -> Float:
        return np.column_stack([m.xy_mm[row], -c_mm[image]])

    return ImagePairs(
        left,
        right,
        start,
        m.point[a].astype(np.int32),
        a.astype(np.int32),
        b.astype(np.int32),
        RayPairs(
            by_rows(lambda k, row: rays(left[k], row), pair, a),
            by_rows(lambda k, row: rays(right[k], row), pair, b),
            taken(m.sigma_mm, a),
            taken(m.sigma_mm, b),
        ),
    )


def pair_names(block: Block, pairs: ImagePairs) -> Text:
    """Ids of the models, left-right."""
    ids = block.images.id
    return np.char.add(np.char.add(ids[pairs.left], "-"), ids[pairs.right])


def named_points(path: Path, ids: Text) -> Bool:
    """Which points an orientation-point-name file of WuCAPS names, (n_points,).

    Raises
    ------
    InputError
        If it cannot be read or names points that are not in the block.
    """
    try:
        names = path.read_text(encoding="utf-8-sig").replace(",", " ").split()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("cannot be read as UTF-8 text", where=str(path), remedy="give a file of names") from error
    strange = sorted(set(names) - set(ids.tolist()))
    if strange or not names:
        what = f"names of points that are not in the block: {shown(strange)}" if strange else "no names in the file"
        raise InputError(what, where=str(path), remedy="write the ids of points, one a line")
    return np.isin(ids, names)
