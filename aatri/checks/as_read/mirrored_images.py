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
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.checks.as_read.images_in_strips import Complex, ImagesInStrips, images_in_strips
from aatri.checks.as_read.measured_twice import of_image_and_point
from aatri.checks.limits import COMPARED_POINTS, MIRRORED_BETTER, NOT_MIRRORED
from aatri.codes import CONTROL

MIRRORED = (
    "fits the images beside it in its strip only as a mirror image: measured from the wrong side of the film or scan "
    "(negate its x in image_points.csv), or looking from the other side (give it a strip of its own)"
)

MIRRORED_CAMERA = (
    "camera {}: its images fit those of other cameras only as mirror images: measured from the wrong side; negate x, "
    "or y, of all its points in image_points.csv"
)
EITHER_CAMERA = "cameras {} see the same points from opposite sides: the images of some fit the others mirrored"
EITHER_REMEDY = (
    "negate x, or y, of all points of the camera that is measured from the wrong side, in image_points.csv; four "
    "control points in an image would tell which it is"
)
PARTNERS = 8
"""Rays of a point with which each of them is compared."""


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
    return _sides_of(strips.place_mm[rows], strips.place_mm[place[rows]], image[rows], n, len(first))[first]


def _sides_of(z: Complex, w: Complex, pair: Int, n: int, tests: int) -> Int:
    """The same of n pairs of images, or of an image and the ground, by where they have their points, (k,)."""
    count = np.maximum(np.bincount(pair, minlength=n), 1)
    z, w = (v - (_sums(v, pair, n) / count)[pair] for v in (z, w))
    size = (_sums(np.abs(z) ** 2, pair, n) * _sums(np.abs(w) ** 2, pair, n)).real
    by_similarity, by_mirror = (
        np.clip(1.0 - np.abs(_sums(w * v, pair, n)) ** 2 / np.where(size > 0, size, np.nan), 0.0, 1.0)
        for v in (z.conj(), z)
    )
    limit = (NOT_MIRRORED / max(tests, 1)) ** (1.0 / np.maximum(count - 2, 0.01))
    side = np.where((by_similarity < MIRRORED_BETTER * by_mirror) & (by_similarity < limit), 1, 0)
    side[(by_mirror < MIRRORED_BETTER * by_similarity) & (by_mirror < limit)] = -1
    return side


def mirrored_cameras(block: Block, xy_mm: Float, usable: Bool) -> tuple[Int, Int]:
    """Cameras that see the ground from the other side than the rest, by their images that overlap, and cameras of
    which some do so and nothing tells which: rows in cameras, of either.

    An image of four control points or more tells which side is the right one.
    """
    camera, points, names, none = block.images.camera, block.image_points, len(block.cameras), np.zeros(0, np.int64)
    if names < 2:
        return none, none
    every = 1 + len(points) // (COMPARED_POINTS * len(camera))
    rows = of_image_and_point(block, usable & (points.point % every == 0))
    rows = rows[np.argsort(points.point[rows], kind="stable")]
    image, point, place = points.image[rows].astype(np.int64), points.point[rows], xy_mm[rows] @ np.array([1, 1j])
    a, b = np.concatenate([(k := np.arange(max(len(rows) - step, 0)), k + step) for step in range(1, PARTNERS + 1)], 1)
    other = (point[a] == point[b]) & (camera[image[a]] != camera[image[b]])
    a, b = a[other], b[other]
    together = _comparable(block, camera[image[a]], camera[image[b]])
    a, b = a[together], b[together]
    key, pair = np.unique(image[a] * len(camera) + image[b], return_inverse=True)
    pairs = camera[key // len(camera)], camera[key % len(camera)]
    between = csr_matrix((_sides_of(place[a], place[b], pair, len(key), len(key)), pairs), (names, names))
    between += between.T
    between.eliminate_zeros()
    first = int(np.argmax(np.bincount(camera, minlength=names)))
    order, nearer = breadth_first_order(between, first, directed=False)
    side = np.zeros(names, dtype=np.int64)
    side[first] = 1
    votes = np.asarray(between[order[1:], nearer[order[1:]]]).ravel() if len(order) > 1 else order[1:]
    for one, vote in zip(order[1:].tolist(), np.sign(votes).tolist()):
        side[one] = vote * side[nearer[one]]
    if not (side < 0).any():
        return none, none
    vote = side @ np.bincount(camera, _by_control(block, xy_mm, usable), names)
    return (np.flatnonzero(side == -np.sign(vote)), none) if vote else (none, np.flatnonzero(side))


def _by_control(block: Block, xy_mm: Float, usable: Bool) -> Int:
    """1 where an image sees its control from above, -1 from below, 0 unknown, (n,)."""
    plan_m = np.full((len(block.points), 2), np.nan)
    control = (block.ground_points.role[:, :2] == CONTROL).all(axis=1)
    plan_m[block.ground_points.point[control]] = block.ground_points.xyz_m[control, :2]
    points, n = block.image_points, len(block.images)
    rows = np.flatnonzero(usable & np.isfinite(plan_m[points.point]).all(axis=1))
    z, w = (xy[rows] @ np.array([1, 1j]) for xy in (xy_mm, plan_m[points.point]))
    return _sides_of(z, w, points.image[rows].astype(np.int64), n, n)


def _sums(values: Complex | Float, group: Int, n: int) -> Complex:
    """Sum of the values of each of n groups."""
    return np.bincount(group, values.real, n) + 1j * np.bincount(group, values.imag, n)
