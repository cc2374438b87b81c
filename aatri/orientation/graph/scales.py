"""Lengths of the bases of pairs, by the points that two pairs share in the image they have in common.

A point has in each pair its distance from the image, in units of that pair's base. Two pairs with an image and points
in common therefore tell the ratio of their bases,

    log s_b - log s_a = median over the common points of (log l_a - log l_b),

also where all bases lie on one line, as in a strip, where directions alone leave the scales open. The logarithms of
all bases follow robustly from all ratios (`differences`). Pairs that no chain of such ratios links belong to different
components.

Source: Cui & Tan, Global structure-from-motion by similarity averaging, ICCV 2015.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

from aatri.arrays import Bool, Float, Int
from aatri.orientation.graph.differences import fitted_robustly, parts_of
from aatri.orientation.graph.limits import FEWEST_FOR_SCALE, PAIRS_PER_IMAGE, SPREAD_OF_SCALES
from aatri.orientation.graph.pair_graph import PairGraph


@dataclass(frozen=True)
class Scaled:
    """Pairs with the length of their bases."""

    pair: Int
    """(k,). Rows of the pairs that carry scale."""
    length: Float
    """(k,). Of their bases, one unit per component."""
    component: Int
    """(k,). Numbered from 0, that of most images first."""


def scaled_bases(graph: PairGraph) -> Scaled:
    """Lengths of the bases of the pairs that carry scale."""
    chosen = np.flatnonzero(_carrying(graph))
    part = graph.take(chosen)
    first, second, ratio, weight = _ratios(part)
    logarithm, _ = fitted_robustly(len(chosen), first, second, ratio[:, None], weight)
    component = parts_of(len(chosen), first, second)
    size = [
        len(np.unique([part.left[component == k], part.right[component == k]]))
        for k in range(component.max(initial=-1) + 1)
    ]
    place = np.empty(len(size), dtype=np.int64)
    place[np.argsort(-np.array(size), kind="stable")] = np.arange(len(size))
    return Scaled(chosen, np.exp(logarithm[:, 0]), place[component])


def _carrying(graph: PairGraph) -> Bool:
    """The strongest pairs of every image, and a tree through all images."""
    m, n, strength = len(graph.left), graph.images, graph.strength()
    chosen = np.zeros(m, dtype=bool)
    ends = np.concatenate([graph.left, graph.right])
    order = np.lexsort((-np.tile(strength, 2), ends))
    first = np.searchsorted(ends[order], np.arange(n))
    rank = np.arange(2 * m) - first[ends[order]]
    chosen[order[rank < PAIRS_PER_IMAGE] % m] = True
    cost = coo_array((1.0 / np.maximum(strength, 1e-12), (graph.left, graph.right)), shape=(n, n))
    tree = coo_array(minimum_spanning_tree(cost.tocsr()))
    in_tree = set(zip(tree.row.tolist(), tree.col.tolist()))
    chosen |= np.array([pair in in_tree for pair in zip(graph.left.tolist(), graph.right.tolist())], dtype=bool)
    return chosen


def _ratios(graph: PairGraph) -> tuple[Int, Int, Float, Float]:
    """Pairs of pairs with an image and points in common: first, second, log of the ratio of their bases, weight."""
    pair = graph.pair_of_point
    image = np.concatenate([graph.left[pair], graph.right[pair]]).astype(np.int64)
    point, depth, of = np.tile(graph.point, 2), graph.depth.T.ravel(), np.tile(pair, 2)
    usable = depth > 0
    image, point, depth, of = image[usable], point[usable], np.log(depth[usable]), of[usable]
    order = np.lexsort((of, point, image))
    image, point, depth, of = image[order], point[order], depth[order], of[order]
    links = []
    # a point seen from an image in several pairs: each with the following ones
    for step in range(1, 2 * PAIRS_PER_IMAGE):
        same = (image[step:] == image[:-step]) & (point[step:] == point[:-step])
        rows = np.flatnonzero(same)
        if not len(rows):
            break
        links.append(np.column_stack([rows, rows + step]))
    both = np.concatenate([np.zeros((0, 2), dtype=np.int64), *links])
    a, b = of[both[:, 0]], of[both[:, 1]]
    value = depth[both[:, 0]] - depth[both[:, 1]]
    order = np.lexsort((value, b, a))
    a, b, value = a[order], b[order], value[order]
    begins = np.flatnonzero(np.concatenate([[True], (a[1:] != a[:-1]) | (b[1:] != b[:-1])])[: len(a)])
    count = np.diff(np.concatenate([begins, [len(a)]]))
    middle = value[begins + count // 2]
    spread = 0.5 * (value[begins + (3 * count) // 4 - (count >= 4)] - value[begins + count // 4])
    kept = (count >= FEWEST_FOR_SCALE) & (spread < SPREAD_OF_SCALES)
    weight = count / np.maximum(spread, 1e-3) ** 2
    return (
        a[begins][kept],
        b[begins][kept],
        middle[kept],
        weight[kept] / max(float(weight[kept].max(initial=0.0)), 1e-300),
    )
