"""Tracks: the features of several images that are one point, joined by their matches.

Matches join features to components. A component with two features of one image is no point: a wrong match has joined
two. Its weakest link is not known, so that it is refused whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from aatri.arrays import Int


@dataclass(frozen=True)
class Tracks:
    """Tracks as rows of features.

    Attributes
    ----------
    track, image, keypoint : (n,) int
        Number of the track, and the feature by image and row; by track, then by image.
    refused : int
        Components with two features of one image.
    """

    track: Int
    image: Int
    keypoint: Int
    refused: int


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
    again = (np.diff(of) == 0) & (np.diff(image) == 0)
    torn = np.unique(of[1:][again])
    kept = ~np.isin(of, torn)
    track = np.unique(of[kept], return_inverse=True)[1].ravel()
    return Tracks(track, image[kept], used[kept] - first[image[kept]], len(torn))
