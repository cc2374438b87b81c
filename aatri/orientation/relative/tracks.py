"""Tracks: the features of several images that are one point, joined by their matches.

Matches join features to components. A component with two features of one image is no point: a wrong match has joined
two. Its weakest link is not known, so that it is refused whole.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from aatri.arrays import Int


@dataclass(frozen=True)
class Tracks:
    """Tracks as rows of features."""

    track: Int
    """(n,). Number of the track, whose features stand together, by image."""
    image: Int
    keypoint: Int
    """(n,). The feature: its row in the image."""
    refused: int
    """Components with two features of one image."""


def tracks_of(left: Int, right: Int, first: Int) -> Tracks:
    """Tracks of matches.

    Parameters
    ----------
    left, right : (m,) int
        Features of a match, counted through all images.
    first : (n_images + 1,) int
        First feature of each image in that count, and the number of all.
    """
    n = int(first[-1])
    graph = coo_array((np.ones(len(left), np.int8), (left, right)), shape=(n, n))
    component = connected_components(graph, directed=False)[1]
    used = np.unique(np.concatenate([left, right])).astype(np.int64)
    image = np.searchsorted(first, used, side="right") - 1
    order = np.lexsort((image, component[used]))
    used, image, of = used[order], image[order], component[used][order]
    repeated = (np.diff(of) == 0) & (np.diff(image) == 0)
    torn = np.unique(of[1:][repeated])
    kept = ~np.isin(of, torn)
    track = np.unique(of[kept], return_inverse=True)[1].ravel()
    return Tracks(track, image[kept], used[kept] - first[image[kept]], len(torn))


def lone_joints(pairs: Int, n: int) -> Int:
    """Rows of pairs (m, 2) of n images on each of which alone two parts of the block hang together.

    Depth first: a pair is such a joint if nothing beyond it is paired with anything before it (Tarjan 1974).
    """
    beside: list[list[tuple[int, int]]] = [[] for _ in range(n)]
    for row, (i, j) in enumerate(pairs.tolist()):
        beside[i].append((j, row))
        beside[j].append((i, row))
    seen, earliest, joints = [-1] * n, [0] * n, list[int]()
    count = 0
    for root in range(n):
        if seen[root] >= 0:
            continue
        path = [(root, -1, iter(beside[root]))]
        seen[root] = earliest[root] = count
        count += 1
        while path:
            image, came_by, others = path[-1]
            for other, row in others:
                if row == came_by:
                    continue
                if seen[other] < 0:
                    seen[other] = earliest[other] = count
                    count += 1
                    path.append((other, row, iter(beside[other])))
                    break
                earliest[image] = min(earliest[image], seen[other])
            else:
                path.pop()
                if path:
                    before = path[-1][0]
                    earliest[before] = min(earliest[before], earliest[image])
                    if earliest[image] > seen[before]:
                        joints.append(came_by)
    return np.array(sorted(joints), dtype=np.int64)
