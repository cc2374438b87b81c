"""Two images of strips with each other's ids, by the points that they share with their neighbours.

    a    neighbour in its strip of image i, and not of image j; or of j and not of i
    n    points of a that the one beside it shows and the other does not,     f    the other way round

A neighbour shares more with the image beside it than with one farther away. Where f is larger at every neighbour of i
and of j, the order fits with the two ids exchanged. Of two images of one strip those beside both say nothing; two of
different strips must have three neighbours, which no place of two images suits that are in order.

Seen: images that exchanged their ids on the way from measuring; a sequence that is not that of the flight.
Test: a sign test of the points, each once: for or against the order at more of the neighbours. Against it is 1/2, or
the share of the larger image in the points of both where these differ, for an image of few points shares few. The
probability times the number of pairs of images is below `NOT_EXCHANGED`; and by a plane conformal fit of the common
points the farther image lies nearer to each neighbour: cloud and water take points away, not places. Of pairs that
explain each other's neighbours the one stays that most points are for. Strips in which every second image shares more
all along are of a camera that swings to and fro, and in order.
Source: McNemar 1947 (sign test of correlated proportions).
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.special import bdtrc

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.checks.as_read.images_in_strips import ImagesInStrips, images_in_strips
from aatri.checks.finding import Finding
from aatri.checks.limits import FEWEST_ACROSS, NEARER, NOT_EXCHANGED
from aatri.ids import printable


def exchanged_images(block: Block, xy_mm: Float, usable: Bool) -> list[Finding]:
    """Warnings of pairs of images that fit the order of their strips with their ids exchanged.

    Parameters
    ----------
    xy_mm : (k, 2) float64, mm
        Image points, from the middle of the image.
    usable : (k,) bool
    """
    if not (block.images.strip >= 0).any():
        return []
    strips = images_in_strips(block, xy_mm, usable)
    n = int((strips.beside >= 0).any(axis=1).sum())
    judged = [(*_sign_test(strips, *pair), pair) for pair in _pairs_out_of_order(strips)]
    pairs: list[tuple[tuple[int, int], float]] = []
    exchanged: set[int] = set()
    for _, probability, pair in sorted(judged):
        probability *= n * (n - 1) / 2
        by = {*pair, *strips.beside[list(pair)].ravel().tolist()}
        if probability < NOT_EXCHANGED and not by & exchanged:  # an image out of place says nothing of its neighbours
            exchanged |= set(pair)
            pairs.append((pair, probability))
    swung = strips.swung(exchanged) if pairs else ()
    return [_finding(block, *pair, p) for pair, p in pairs if not np.isin(strips.strip[list(pair)], swung).any()]


def _pairs_out_of_order(strips: ImagesInStrips) -> list[tuple[int, int]]:
    """Pairs of images that share more with all neighbours of each other than these share with their own."""
    n = len(strips.beside)
    ones = np.ones(len(strips.point), dtype=np.int32)
    seen = csr_array((ones, strips.point, strips.start), shape=(n, int(strips.point.max(initial=0)) + 1))
    common = (seen @ seen.T).tocsr()
    a = np.repeat(np.arange(n), np.diff(common.indptr))
    out_of_order: list[Int] = []
    for side in range(2):
        i, j = strips.beside[a, side], common.indices
        with_own = np.asarray(common[np.arange(n), strips.beside[:, side]]).ravel()[a]
        more = (i >= 0) & (common.data > with_own) & (j != a) & (strips.beside[a] != j[:, None]).all(axis=1)
        out_of_order.append(i[more] * n + j[more])
    key, count = np.unique(np.concatenate(out_of_order), return_counts=True)
    i, j = key // n, key % n
    own, others = ((strips.telling(x, y) >= 0).sum(axis=1) for x, y in ((i, j), (j, i)))
    one_strip = strips.strip[i] == strips.strip[j]
    every = count == own
    agreed = (one_strip & (others == 0)) | (
        (one_strip | (own + others >= FEWEST_ACROSS)) & np.isin(j * n + i, key[every])
    )
    return sorted({(min(pair), max(pair)) for pair in zip(i[every & agreed].tolist(), j[every & agreed].tolist())})


def _sign_test(strips: ImagesInStrips, i: int, j: int) -> tuple[int, float]:
    """Points in favour of the order, less those against it, and the probability of so many against it.

    Probability 1 where a place is in favour.
    """
    points, signs = [], []
    for beside, other in ((i, j), (j, i)):
        for a in strips.telling(np.array([beside]), np.array([other]))[0].tolist():
            if a >= 0 and strips.distance_mm(a, other) > NEARER * strips.distance_mm(a, beside):
                return 0, 1.0
            of_a = strips.shown(a)[0] if a >= 0 else strips.point[:0]
            points.append(of_a)
            signs.append(np.isin(of_a, strips.shown(other)[0]) * 1 - np.isin(of_a, strips.shown(beside)[0]))
    _, of_point = np.unique(np.concatenate(points), return_inverse=True)
    balance = np.bincount(of_point, weights=np.concatenate(signs))
    f, n = int((balance > 0).sum()), int((balance < 0).sum())
    sizes = [len(strips.shown(image)[0]) for image in (i, j)]
    return int(-balance.sum()), float(bdtrc(f - 1, n + f, max(sizes) / sum(sizes))) if f else 1.0


def _finding(block: Block, i: int, j: int, probability: float) -> Finding:
    first, second = (printable(str(name)) for name in block.images.id[[i, j]])
    text = (
        f"images {first} and {second} fit the order of their strips with their ids exchanged: each shares more points "
    )
    text += "with the neighbours of the other than with its own"
    remedy = "exchange the two ids in image_points.csv"
    if block.images.strip[i] == block.images.strip[j]:
        remedy += ", or their sequence in images.csv"
    where, rows = block.read_at(block.images, i), {"image": np.array([i, j])}
    return Finding("exchanged_images", "warning", text, remedy, where=where, rows=rows, significance=probability)
