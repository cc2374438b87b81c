"""An image measured from the wrong side of its film or scan, by the points that it shares with those beside it.

Places z = x + i y and w of n common points in two images, less their means, fit a similarity, or that of a mirror
image, to the squares of the correlations

    R2 = |sum w conj(z)|^2 / (sum |z|^2 sum |w|^2),        R2' = |sum w z|^2 / (sum |z|^2 sum |w|^2)

Two cameras on the same side of the ground see it alike but for heights and tilts: R2 is near 1. Points along a line fit
both ways, and points of different numbers neither.

Seen: points of one image rejected by the dozen, a strip that falls in two, images that look upwards.
Test: a pair of neighbours in a strip is mirrored where the mirror image leaves less than `MIRRORED_BETTER` of the
squares that the similarity leaves, and points that have nothing to do with each other fit so well, (1 - R2')^(n - 2),
less often than `NOT_MIRRORED` in all pairs of a block; and alike, the other way round. Pairs that say neither, as those
of a comparator's axes and others', divide the strip; of each piece the images on the side of most are right.
Source: the least squares similarity in complex numbers; R2 of complex normal variables without correlation has the beta
distribution of 1 and n - 2.
"""

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.checks.as_read.images_in_strips import Complex, ImagesInStrips, images_in_strips
from aatri.checks.limits import MIRRORED_BETTER, NOT_MIRRORED

MIRRORED = (
    "fits the images beside it in its strip only as a mirror image: measured from the wrong side of the film or scan "
    "(negate its x in image_points.csv), or looking from the other side (give it a strip of its own)"
)


def mirrored_images(block: Block, xy_mm: Float, usable: Bool) -> Int:
    """Images that fit their neighbours only mirrored, (n,).

    Parameters
    ----------
    xy_mm : (k, 2) float64, mm
        Image points, from the middle of the image.
    usable : (k,) bool
    """
    if not (block.images.strip >= 0).any():
        return np.zeros(0, dtype=np.int64)
    strips = images_in_strips(block, xy_mm, usable)
    first = np.flatnonzero(strips.beside[:, 1] >= 0)
    first = first[np.lexsort((block.images.sequence[first], block.images.strip[first]))]
    if not len(first):
        return first
    second, camera = strips.beside[first, 1], block.images.camera
    sides = np.where(_comparable(block, camera[first], camera[second]), _sides(strips, first), 0)
    mirrored: list[Int] = []
    follows = (second[:-1] == first[1:]) & (sides[1:] != 0) & (sides[:-1] != 0)
    for pairs in np.split(np.arange(len(first)), np.flatnonzero(~follows) + 1):
        images = np.concatenate([first[pairs[:1]], second[pairs]])
        side = np.cumprod(np.concatenate([[1], sides[pairs]]))
        other = images[side != np.sign(side.sum())]
        mirrored.append(other if side.all() and side.sum() else other[:0])
    return np.unique(np.concatenate(mirrored)) if mirrored else np.zeros(0, dtype=np.int64)


def _comparable(block: Block, first: Int, second: Int) -> Bool:
    """Pairs of cameras whose axes are known to turn the same way: those of a comparator or a scan may have y down."""
    cameras = block.cameras
    has_axes = (cameras.image_coordinates == "photo") | (cameras.kind == "digital")
    return np.asarray((first == second) | (has_axes[first] & has_axes[second]))


def _sides(strips: ImagesInStrips, first: Int) -> Int:
    """1 where an image and the one after it see the ground from one side, -1 where from opposite sides, 0 unknown."""
    n_points, n = int(strips.point.max(initial=0)) + 1, len(strips.beside)
    image = np.repeat(np.arange(n), np.diff(strips.start))
    after, key = strips.beside[image, 1], image * n_points + strips.point
    place = np.searchsorted(key, after * n_points + strips.point)
    rows = np.flatnonzero((after >= 0) & (np.append(key, -1)[place] == after * n_points + strips.point))
    pair, count = image[rows], np.maximum(np.bincount(image[rows], minlength=n), 1)
    z, w = (v - (_sums(v, pair, n) / count)[pair] for v in (strips.place_mm[rows], strips.place_mm[place[rows]]))
    size = (_sums(np.abs(z) ** 2, pair, n) * _sums(np.abs(w) ** 2, pair, n)).real
    by_similarity, by_mirror = (
        np.clip(1.0 - np.abs(_sums(w * v, pair, n)) ** 2 / np.where(size > 0, size, np.nan), 0.0, 1.0)
        for v in (z.conj(), z)
    )
    limit = (NOT_MIRRORED / max(len(first), 1)) ** (1.0 / np.maximum(count - 2, 0.01))
    side = np.where((by_similarity < MIRRORED_BETTER * by_mirror) & (by_similarity < limit), 1, 0)
    side[(by_mirror < MIRRORED_BETTER * by_similarity) & (by_mirror < limit)] = -1
    return side[first]


def _sums(values: Complex | Float, group: Int, n: int) -> Complex:
    """Sum of the values of each of n groups."""
    return np.bincount(group, values.real, n) + 1j * np.bincount(group, values.imag, n)
