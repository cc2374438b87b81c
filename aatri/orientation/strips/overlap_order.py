"""Strips found from the overlaps of images, where none are given.

Consecutive images of a strip share more points than images beside each other, and lie on opposite sides of one
another. Of a pair of images a plane conformal fit of the common points, z_i = p z_j + q, gives the place q of image j
in image i. Pairs are taken in the order of their common points, most first; one is accepted if neither image has two
neighbours already, the new neighbour lies opposite to the one it has (more than 120 degrees from it), it makes no
ring, and it shares at least half as many points as the median of those accepted before. A chain begins at the end
whose image comes first in the block.

Source: photogrammetric practice.
"""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from aatri.arrays import Float, Int
from aatri.orientation.strips.limits import (
    FEWEST_OF_NEIGHBOURS,
    MOST_NEIGHBOUR_CANDIDATES,
    NEIGHBOUR_SHARE,
    OPPOSITE_COSINE,
)

Complex = npt.NDArray[np.complex128]


def strips_by_overlap(image: Int, point: Int, xy_mm: Float, n_images: int) -> list[Int]:
    """Chains of images, each in its order; images without neighbours are in none.

    Parameters
    ----------
    image, point : (n,) int
    xy_mm : (n, 2) float64, mm
        From the principal point.
    """
    pairs, shared = _candidates(image, point, n_images)
    places = _places(image, point, xy_mm, n_images, pairs)
    neighbours: list[list[tuple[int, complex]]] = [[] for _ in range(n_images)]
    root = list(range(n_images))
    accepted: list[int] = []

    def top(i: int) -> int:
        while root[i] != i:
            root[i] = root[root[i]]
            i = root[i]
        return i

    for k in np.argsort(-shared, kind="stable").tolist():
        (i, j), (to_j, to_i) = pairs[k].tolist(), places[k].tolist()
        if not np.isfinite(abs(to_j)) or not np.isfinite(abs(to_i)) or top(i) == top(j):
            continue
        if accepted and shared[k] < NEIGHBOUR_SHARE * float(np.median(accepted)):
            continue
        if _opposite(neighbours[i], to_j) and _opposite(neighbours[j], to_i):
            neighbours[i].append((j, to_j))
            neighbours[j].append((i, to_i))
            root[top(i)] = top(j)
            accepted.append(int(shared[k]))
    return _chains(neighbours)


def _opposite(neighbours: list[tuple[int, complex]], place: complex) -> bool:
    if not neighbours:
        return True
    if len(neighbours) > 1:
        return False
    other = neighbours[0][1]
    return (place * other.conjugate()).real <= OPPOSITE_COSINE * abs(place) * abs(other)


def _candidates(image: Int, point: Int, n_images: int) -> tuple[Int, Int]:
    ones = np.ones(len(image), dtype=np.int32)
    seen = csr_array((ones, (image, point)), shape=(n_images, int(point.max(initial=0)) + 1), dtype=np.int32)
    seen.data[:] = 1
    common = (seen @ seen.T).tocsr()
    shared: dict[tuple[int, int], int] = {}
    for i in range(n_images):
        span = slice(common.indptr[i], common.indptr[i + 1])
        others, count = common.indices[span], common.data[span]
        good = (others != i) & (count >= FEWEST_OF_NEIGHBOURS)
        others, count = others[good], count[good]
        for k in np.lexsort((others, -count))[:MOST_NEIGHBOUR_CANDIDATES].tolist():
            shared[min(i, int(others[k])), max(i, int(others[k]))] = int(count[k])
    pairs = np.array(sorted(shared), dtype=np.int64).reshape(-1, 2)
    return pairs, np.array([shared[i, j] for i, j in pairs.tolist()], dtype=np.int64)


def _places(image: Int, point: Int, xy_mm: Float, n_images: int, pairs: Int) -> Complex:
    """Of each pair the place of the second image in the first, and of the first in the second; complex, mm."""
    order = np.lexsort((point, image))
    start = np.searchsorted(image[order], np.arange(n_images + 1))
    z = xy_mm[order, 0] + 1j * xy_mm[order, 1]
    points = point[order]
    places = np.full((len(pairs), 2), np.nan + 0j)
    for k, (i, j) in enumerate(pairs.tolist()):
        a, b = slice(start[i], start[i + 1]), slice(start[j], start[j + 1])
        _, in_a, in_b = np.intersect1d(points[a], points[b], return_indices=True)
        z_i, z_j = z[a][in_a], z[b][in_b]
        d_i, d_j = z_i - z_i.mean(), z_j - z_j.mean()
        norm = (abs(d_j) ** 2).sum()
        p = (d_j.conj() * d_i).sum() / norm if norm > 0 else 0.0
        if abs(p) > 0:
            q = z_i.mean() - p * z_j.mean()
            places[k] = q, -q / p
    return places


def _chains(neighbours: list[list[tuple[int, complex]]]) -> list[Int]:
    chains: list[Int] = []
    done = np.zeros(len(neighbours), dtype=bool)
    for first in range(len(neighbours)):
        if done[first] or len(neighbours[first]) != 1:
            continue
        chain, before = [first], -1
        done[first] = True
        while True:
            following = [j for j, _ in neighbours[chain[-1]] if j != before]
            if not following:
                break
            before = chain[-1]
            chain.append(following[0])
            done[following[0]] = True
        chains.append(np.array(chain, dtype=np.int64))
    return chains
