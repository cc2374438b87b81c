"""Images through which alone a part of the block hangs on the rest.

Seen: two halves of a block that share one image are tied as well as that image is oriented in each of them; an error
of it turns and scales one half against the other, and no residual shows it.
Test: two images are tied by `TIE_POINTS` common points or more. An image is a hinge if without it the images fall
apart, and one of the parts, of two images at least, has fewer than `OWN_DATUM` control points and observed positions
of its own (articulation points; Hopcroft & Tarjan 1973, Algorithm 447).
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_array

from aatri.arrays import Float, Int
from aatri.checks.finding import Finding
from aatri.checks.limits import OWN_DATUM, TIE_POINTS
from aatri.ids import several
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput

REMEDY = "measure more points common to the images before and after it, or give each part control of its own"


def hinge_images(inputs: BundleInput) -> list[Finding]:
    """A warning for each image on which alone a part hangs."""
    image, point, own = np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(len(inputs.image_ids))
    for o in inputs.observed:
        touched = dict(o.records.touches)
        if POSE in touched and POINT in touched and o.kind == "image_point":
            image = np.append(image, touched[POSE][o.records.active])
            point = np.append(point, touched[POINT][o.records.active])
        elif o.kind == "position":
            own[np.unique(touched[POSE][o.records.active])] += 1.0
    first = np.full(len(inputs.point_ids), -1)
    first[point[::-1]] = image[::-1]  # of several rays the first: it is set last
    for o in inputs.observed:
        if o.kind == "control":
            seen_from = first[np.unique(dict(o.records.touches)[POINT][o.records.active])]
            np.add.at(own, seen_from[seen_from >= 0], 1.0)
    shows = csr_array((np.ones(len(image)), (image, point)), shape=(len(inputs.image_ids), len(inputs.point_ids)))
    common = (shows @ shows.T).tocoo()
    tied = (common.data >= TIE_POINTS) & (common.row != common.col)
    neighbours = np.split(common.col[tied], np.cumsum(np.bincount(common.row[tied], minlength=len(own)))[:-1])
    return [_finding(inputs, hinge, part) for hinge, part in hanging_parts(neighbours, own)]


def _finding(inputs: BundleInput, hinge: int, part: Int) -> Finding:
    text = f"image {inputs.image_ids[hinge]} alone ties {several(len(part), 'image')} to the rest of the block"
    return Finding(
        "hinge_image", "warning", text, REMEDY, ids=tuple(inputs.image_ids[k] for k in sorted(part.tolist()))
    )


def hanging_parts(neighbours: list[Int], own: Float) -> Iterator[tuple[int, Int]]:
    """Hinges, each with a part that hangs on it: the smaller one, or one beside a part with a datum.

    Parameters
    ----------
    neighbours : list of (k,) int
        Images tied to each image.
    own : (n,) float64
        Control points and positions of each image.
    """
    for order, children, low, number, size in _trees(neighbours):
        of_hinge: dict[int, list[Int]] = {}
        for parent, child in children:
            if low[child] >= number[parent]:  # no edge passes by
                of_hinge.setdefault(parent, []).append(order[number[child] : number[child] + size[child]])
        for hinge, parts in of_hinge.items():
            rest = np.setdiff1d(order, np.concatenate([[hinge], *parts]))
            parts = [*parts, rest] if len(rest) else parts
            images_beside, control = len(order) - 1, own[order].sum() - own[hinge]
            for part in parts if len(parts) > 1 else ():
                datum = own[part].sum()
                if (
                    len(part) > 1
                    and datum < OWN_DATUM
                    and (2 * len(part) <= images_beside or control - datum >= OWN_DATUM)
                ):
                    yield hinge, part


def _trees(neighbours: list[Int]) -> Iterator[tuple[Int, list[tuple[int, int]], Int, Int, Int]]:
    """A depth-first tree of each component: order, edges, and per image low point, number and size of its subtree."""
    n = len(neighbours)
    number, low, size = np.full(n, -1), np.zeros(n, np.intp), np.ones(n, np.intp)
    for root in range(n):
        if number[root] >= 0 or not len(neighbours[root]):
            continue
        order, children = [root], list[tuple[int, int]]()
        number[root] = low[root] = 0
        stack = [(root, -1, iter(neighbours[root].tolist()))]
        while stack:
            here, parent, rest = stack[-1]
            other = next(rest, None)
            if other is None:
                stack.pop()
                if parent >= 0:
                    low[parent] = min(low[parent], low[here])
                    size[parent] += size[here]
            elif number[other] < 0:
                number[other] = low[other] = len(order)
                order.append(other)
                children.append((here, other))
                stack.append((other, here, iter(neighbours[other].tolist())))
            elif other != parent:
                low[here] = min(low[here], number[other])
        yield np.array(order), children, low, number, size
