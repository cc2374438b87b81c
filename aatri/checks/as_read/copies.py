"""The same thing twice: rows copied to the last digit, and measurements given under two names, count once.

Seen: double weight of a measurement, points at one place, an image that contradicts nothing.
Test:

1. an image point or geodetic observation whose row is equal to an earlier one in every column;
2. an image of which every point it shares with another image, and most of both are shared, has the same coordinates:
   the whole image, of the two the one without a row in exterior.csv, or that shares fewer points with those beside it;
3. a point that has the coordinates of another in two images or more (a second feature at one place): its rows in them;
4. a control or check point at the coordinates of another, all three equal: it keeps them, without a role.

Two measurements of two things never agree in every digit; where they are rounded to whole pixels, not in two images.
"""

from collections import Counter
from dataclasses import replace

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import CHECK, CONTROL, NO_ROLE, Block
from aatri.checks.as_read.rejects import name_of_image_point, rejected
from aatri.checks.finding import Finding
from aatri.checks.limits import LEAST_IMAGES, LEAST_SHARE, LEAST_SHARED, MOST_AT_ONE_PLACE
from aatri.ids import printable, several
from aatri.tables.schema import Table, columns_of

COPIED = "equal to another row in every digit: counts once"
ONE_PLACE = "at the very place of another point: counts once"


def without_copies(block: Block) -> tuple[Block, list[Finding]]:
    """The block with copies inactive and listed in its rejects, or, of ground points, without a role and told."""
    block, of_points = _points_twice(_images_twice(_copied_rows(block)))
    block, of_ground = _ground_points_twice(block)
    return block, [*of_points, *of_ground]


def _copied_rows(block: Block) -> Block:
    """Rule 1."""
    points, geodetic = block.image_points, block.geodetic
    correlated = np.concatenate([block.geodetic_covariances.row_a, block.geodetic_covariances.row_b])
    of_points = _copies(points) & points.active
    of_geodetic = _copies(geodetic) & geodetic.active & ~np.isin(np.arange(len(geodetic)), correlated)
    if not (of_points.any() or of_geodetic.any()):
        return block
    rows = np.flatnonzero(of_points).tolist()
    block = rejected(
        block, "image_point", points, rows, [name_of_image_point(block, k) for k in rows], [COPIED] * len(rows)
    )
    rows = np.flatnonzero(of_geodetic).tolist()
    names = [geodetic.called(k) for k in rows]
    block = rejected(block, "geodetic", geodetic, rows, names, [COPIED] * len(rows))
    return replace(
        block,
        image_points=replace(points, active=points.active & ~of_points),
        geodetic=replace(geodetic, active=geodetic.active & ~of_geodetic),
    )


def _copies(rows: Table) -> Bool:
    """Rows equal to the one before them, in canonical order, but for where they were read."""
    n = len(rows)
    same = np.zeros(n, dtype=bool)
    same[1:] = True
    for name in columns_of(type(rows)):
        if name in ("file", "line") or not same.any():
            continue
        column = getattr(rows, name).reshape(n, -1)
        equal = column[1:] == column[:-1]
        if column.dtype.kind == "f":
            equal |= np.isnan(column[1:]) & np.isnan(column[:-1])
        same[1:] &= equal.all(axis=1)
    return same


def _images_twice(block: Block) -> Block:
    """Rule 2."""
    rows = np.flatnonzero(block.image_points.active)
    image, point = block.image_points.image[rows], block.image_points.point[rows]
    a, b = _pairs_of_equals(block.image_points.xy[rows], point)
    equal = Counter(zip(image[a].tolist(), image[b].tolist()))
    likely = [(i, j) for (i, j), count in sorted(equal.items()) if i != j and count >= LEAST_SHARED]
    if not likely:
        return block
    seen = {i: set(point[image == i].tolist()) for i in {i for pair in likely for i in pair}}
    copy: dict[int, int] = {}
    for i, j in likely:
        most = max(len(seen[i]), len(seen[j]))
        if not {i, j} & set(copy) and len(seen[i] & seen[j]) == equal[i, j] >= LEAST_SHARE * most:
            first, second = (_fits_in(block, k, other, seen[k]) for k, other in ((i, j), (j, i)))
            copy |= {i: j} if second > first else {j: i}
    active = block.images.active.copy()
    active[list(copy)] = False
    ids = block.images.id
    reasons = [f"its measurements are those of image {printable(str(ids[i]))}: count once" for i in copy.values()]
    block = rejected(block, "image", block.images, list(copy), [str(ids[j]) for j in copy], reasons)
    return replace(block, images=replace(block.images, active=active))


def _fits_in(block: Block, k: int, copy: int, points: set[int]) -> tuple[bool, int]:
    """Whether something is known of where an image is, and the points it shares with those beside it in its strip."""
    images, measured = block.images, block.image_points
    strip = np.flatnonzero((images.strip == images.strip[k]) & (images.strip >= 0) & images.active)
    strip = strip[(strip != k) & (strip != copy)]
    apart = images.sequence[strip] - images.sequence[k]
    beside = [strip[side][np.argmin(np.abs(apart[side]))] for side in (apart < 0, apart > 0) if side.any()]
    shared = [len(points.intersection(measured.point[measured.image == n].tolist())) for n in beside]
    return bool((block.exterior.image == k).any()), sum(shared)


def _points_twice(block: Block) -> tuple[Block, list[Finding]]:
    """Rule 3."""
    rows = np.flatnonzero(block.image_points.active & block.images.active[block.image_points.image])
    image, point = block.image_points.image[rows], block.image_points.point[rows]
    a, b = _pairs_of_equals(block.image_points.xy[rows], image)
    if not len(a):
        return block, []
    seen = np.bincount(point, minlength=len(block.points))
    is_control, p, q = block.points_given_as(CONTROL), point[a], point[b]
    first = (is_control[p] > is_control[q]) | (
        (is_control[p] == is_control[q]) & (seen[p] >= seen[q])
    )  # which of the two goes on
    p, q, out = np.where(first, p, q), np.where(first, q, p), np.where(first, b, a)
    count = Counter(zip(p.tolist(), q.tolist()))
    copied = {int(rows[k]): (int(i), int(j)) for i, j, k in zip(p, q, out) if count[int(i), int(j)] >= LEAST_IMAGES}
    if not copied:
        return block, []
    active = block.image_points.active.copy()
    active[list(copied)] = False
    names = [name_of_image_point(block, row) for row in copied]
    block = rejected(block, "image_point", block.image_points, list(copied), names, [ONE_PLACE] * len(copied))
    pairs = [f"{block.points.id[j]} (as {block.points.id[i]})" for i, j in dict.fromkeys(copied.values())]
    what = (
        f"{several(len(pairs), 'point', 'lies', 'lie')} at the very place of another in two images or "
        "more, where they count once"
    )
    finding = Finding("copies", "warning", what, ids=tuple(pairs))
    return replace(block, image_points=replace(block.image_points, active=active)), [finding]


def _ground_points_twice(block: Block) -> tuple[Block, list[Finding]]:
    """Rule 4; control goes before check points."""
    ground = block.ground_points
    full = np.flatnonzero(np.isin(ground.role, (CONTROL, CHECK)).all(axis=1))
    is_check = (ground.role[full] == CHECK).any(axis=1)
    full = full[np.argsort(is_check, kind="stable")]
    a, b = _pairs_of_equals(ground.xyz_m[full], np.zeros(len(full), dtype=np.int64))
    if not len(a):
        return block, []
    first: dict[int, int] = {}
    for i, j in sorted(zip(full[a].tolist(), full[b].tolist()), key=lambda pair: (pair[1], pair[0])):
        if i not in first:
            first.setdefault(j, i)
    role = ground.role.copy()
    role[list(first)] = NO_ROLE
    ids = block.points.id[ground.point]
    findings = []
    for j, i in first.items():
        other, name = (printable(str(ids[k])) for k in (i, j))
        what = f"{name} has the coordinates of {other} in every digit: they count once, for {other}"
        findings.append(Finding("copies", "warning", what, where=block.read_at(ground, j)))
    return replace(block, ground_points=replace(ground, role=role)), findings


def _pairs_of_equals(xy: Float, group: Int) -> tuple[Int, Int]:
    """Pairs of rows of one group with equal coordinates, the earlier row first."""
    bits = np.ascontiguousarray(xy + 0.0).view(np.uint64)
    key = group.astype(np.uint64)
    for column in bits.T:  # quick to sort; that they are equal is seen below
        key = (key ^ (key >> np.uint64(29))) * np.uint64(0x9E3779B97F4A7C15) ^ column
    order = np.argsort(key, kind="stable")
    key = key[order]
    first, second = [order[:0]], [order[:0]]
    for apart in range(1, MOST_AT_ONE_PLACE):
        together = np.flatnonzero(key[apart:] == key[:-apart])
        if not len(together):
            break
        first.append(order[together])
        second.append(order[together + apart])
    a, b = np.concatenate(first), np.concatenate(second)
    equal = (group[a] == group[b]) & (xy[a] == xy[b]).all(axis=1)
    return a[equal], b[equal]
