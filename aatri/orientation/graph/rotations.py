"""Rotations of all images from those of pairs: rotation averaging.

    R_right = R_left R_pair,    e = log(R_left R_pair R_right')

Start: a spanning tree of the best pairs. Then increments d on the ground side (R <- exp([d]x) R) of all images at once,
d_right - d_left = e, by least absolute deviations, then by Cauchy's weights (`differences`): a wrong pair is outvoted
by the others, in whatever cycle it lies.

Cycle check: the three rotations of a triangle of pairs multiply to the identity, up to their standard deviations. A
pair is as good as the share of its triangles that close; one without triangles is not checked.

Source: Chatterjee & Govindu, ICCV 2013 and PAMI 40 (2018) 958; Zach, Klopschitz & Pollefeys, CVPR 2010 (cycles).
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from aatri.adjustment.statistics.limits import OFF_SIGMAS
from aatri.arrays import Float, Int, ranges
from aatri.geometry.rotations import exp_rotation, log_rotation
from aatri.orientation.graph.differences import STEPS, fitted, robust_weights
from aatri.orientation.graph.limits import CLOSED_RAD

SETTLED_RAD = 1e-7


def closing_triangles(n: int, left: Int, right: Int, left_from_right: Float, sigma_rad: Float) -> tuple[Int, Int]:
    """How many triangles each pair lies in, and how many of them close.

    Parameters
    ----------
    n : int
        Images.
    left, right : (m,) int
    left_from_right : (m, 3, 3) float64
    sigma_rad : (m,) float64, rad
        Standard deviation of each rotation.

    Returns
    -------
    triangles, closing : (m,) int64
    """
    m = len(left)
    low, high = np.minimum(left, right), np.maximum(left, right)
    turned = np.where((left < right)[:, None, None], left_from_right, left_from_right.swapaxes(1, 2))
    order = np.lexsort((high, low))
    key = (low.astype(np.int64) * n + high)[order]
    first = np.searchsorted(low[order], np.arange(n + 1))
    count = (first[1:] - first[:-1])[high]
    ab = np.repeat(np.arange(m), count)  # pair a-b, then every pair b-c with c > b
    bc = order[ranges(first[high], count)]
    closing_key = low[ab].astype(np.int64) * n + high[bc]
    place = np.minimum(np.searchsorted(key, closing_key), max(m - 1, 0))
    has_pair = key[place] == closing_key if m else np.zeros(0, dtype=bool)
    ab, bc, ac = ab[has_pair], bc[has_pair], order[place[has_pair]]
    trace = np.einsum("nij,njk,nik->n", turned[ab], turned[bc], turned[ac], optimize=True)
    error = np.arccos(np.clip(0.5 * (trace - 1.0), -1.0, 1.0))
    sigma = np.sqrt(sigma_rad[ab] ** 2 + sigma_rad[bc] ** 2 + sigma_rad[ac] ** 2)
    closes = error <= np.maximum(CLOSED_RAD, OFF_SIGMAS * sigma)
    members = np.concatenate([ab, bc, ac])
    return np.bincount(members, minlength=m), np.bincount(members, np.tile(closes, 3), m).astype(np.int64)


def averaged_rotations(n: int, left: Int, right: Int, left_from_right: Float, weight: Float) -> tuple[Float, Float]:
    """Rotations of all images.

    Parameters
    ----------
    n : int
        Images.
    left, right : (m,) int
    left_from_right : (m, 3, 3) float64
    weight : (m,) float64
        Trust in each pair.

    Returns
    -------
    rotation : (n, 3, 3) float64
        Images to one frame per connected part; the identity where an image has no pair.
    error_rad : (m,) float64, rad
        What remains of each pair.
    """
    rotation = _along_a_tree(n, left, right, left_from_right, weight)
    for absolute in (True, False):
        for _ in range(STEPS):
            e = log_rotation(rotation[left] @ left_from_right @ rotation[right].swapaxes(1, 2))
            w = robust_weights(np.linalg.norm(e, axis=1), weight, absolute=absolute)
            d = fitted(n, left, right, e, w)
            rotation = exp_rotation(d) @ rotation
            if np.abs(d).max(initial=0.0) <= SETTLED_RAD:
                break
    e = log_rotation(rotation[left] @ left_from_right @ rotation[right].swapaxes(1, 2))
    return rotation, np.asarray(np.linalg.norm(e, axis=1))


def _along_a_tree(n: int, left: Int, right: Int, left_from_right: Float, weight: Float) -> Float:
    """Rotations along a spanning tree of the pairs of most weight, part by part."""
    cost = 1.0 / np.maximum(weight, 1e-12)
    tree = coo_array(minimum_spanning_tree(coo_array((cost, (left, right)), shape=(n, n)).tocsr()))
    kept = dict(zip(zip(left.tolist(), right.tolist()), range(len(left))))
    both = (tree + tree.T).tocsr()
    rotation, visited = np.tile(np.eye(3), (n, 1, 1)), np.zeros(n, dtype=bool)
    for root in range(n):
        if visited[root]:
            continue
        order, predecessor = breadth_first_order(both, root, directed=False)
        visited[order] = True
        for image in order[1:].tolist():
            parent = int(predecessor[image])
            k = kept.get((parent, image))
            if k is not None:
                rotation[image] = rotation[parent] @ left_from_right[k]
            else:
                rotation[image] = rotation[parent] @ left_from_right[kept[image, parent]].T
    return rotation
