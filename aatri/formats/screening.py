"""Screening: what of a block cannot be used is set aside, by name and with the reason, and nothing else.

Every reader of blocks ends with `screen_block`. What does not pass the `gate` is refused, `copies` count once. On the
tables of a `Block` in which everything else is still active this is repeated until nothing changes:

1. image point outside the image format by more than 5 % of the format -> rejected;
2. point seen in one image only, without control and without other observations -> its image points are rejected;
3. image with fewer than 3 points, without an observed position -> rejected, with its image points.

Ground points with a role that no image shows are listed, but keep their role. If more than `max_reject_share` of the
image points would go by rule 1, a unit or the format is wrong: an error, with the first places. Points seen once (2)
and images with few points (3) are no reason to refuse the others, however many, as long as an image is left.
So are positions that cannot be, control that lies off the block, and angles between rays to control that do not agree
with positions and control (see `orientation.plausibility`); a line per camera says what was found right.
The outcome depends on the content alone, so that a block written out and read again is screened to the same.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from aatri.adapters.imported import read_at
from aatri.adapters.plausibility import control_as_given
from aatri.adapters.sanity_as_given import as_given
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import CHECK, CONTROL, OBSERVED_VALUE, Block, Rejects
from aatri.errors import InputError, raise_all
from aatri.formats.control_lost import joined, lost_control
from aatri.formats.copies import without_copies
from aatri.formats.gate import faults_of
from aatri.formats.positions_screened import without_impossible_positions
from aatri.ids import printable
from aatri.notes import Note, tell
from aatri.progress import SILENT, Reporter

MAX_REJECT_SHARE = 0.05
"""Largest share of the image points that may lie outside the format, unless options say another."""

REJECT_SHARE = "largest share of image points outside the format, or impossible positions, to set aside; else an error"
"""What the option of that name says."""

FORMAT_MARGIN = 0.05
"""How far beyond the image format, as a share of it, an image point may lie."""

MIN_IMAGE_POINTS = 3
"""Image points that determine an image without an observed position."""

SAME_POINT_SIGMAS = 6.0
"""Two measurements of one point in one image agree if they differ by at most this many sigmas of the difference."""

MOST_LISTED, MANY = 20, 5
"""Places shown of one error; more rejects of one kind for one reason are told in one line."""

OUTSIDE = "outside the image format"
SEEN_ONCE = "seen in one image only"
REJECTED_IMAGE = "its image is rejected"
FEW_POINTS = f"fewer than {MIN_IMAGE_POINTS} points and no observed position"
NOT_SEEN = "seen in no image"


@dataclass
class _Set:
    """Rows set aside of one table, with the reason."""

    active: Bool
    reasons: dict[int, str] = field(default_factory=dict)

    def reject(self, rows: Int, reason: str) -> None:
        self.active[rows] = False
        self.reasons.update({int(row): reason for row in rows})


def screen_block(block: Block, reporter: Reporter = SILENT, max_reject_share: float = MAX_REJECT_SHARE, *,
                 copies: bool = False) -> Block:  # fmt: skip
    """The block with what cannot be used set inactive and listed in `rejects`.

    Parameters
    ----------
    block : Block
        With the active flags as the files give them; rows in `rejects` are kept.
    reporter : Reporter
        Gets a warning per reject.
    max_reject_share : float
        Largest share of the image points that may lie outside the format, and of the positions that cannot be.
    copies : bool
        What is given twice counts twice: for problems that are defined by all their rows.

    Raises
    ------
    InputError
        If the block does not pass the gate, measurements disagree, more than the share would be rejected, or no image
        is left.
    """
    raise_all(faults_of(block))
    block, told_of_copies = (block, []) if copies else without_copies(block)
    block, impossible = without_impossible_positions(block, max_reject_share)
    lost, other_names = lost_control(block)
    problems = [*repeated_measurements(block), *impossible, *lost]
    images, points = _Set(block.images.active.copy()), _Set(block.image_points.active.copy())
    points.reject(np.flatnonzero(_outside_format(block) & points.active), OUTSIDE)
    while _reject_round(block, images, points):
        pass
    problems += _too_many(block, images, points, max_reject_share)
    tell(_told(block.rejects) if problems else [], reporter)  # they may be why so little is left
    raise_all(problems)
    misplaced, notes = control_as_given(block)
    raise_all(misplaced)
    contradictions, figures = as_given(block, points.active)
    tell([*figures, *notes, *told_of_copies, *other_names], reporter)
    raise_all(contradictions)
    rejects = _rejects(block, images, points)
    tell(_told(rejects), reporter)
    return dataclasses.replace(
        block,
        images=dataclasses.replace(block.images, active=images.active),
        image_points=dataclasses.replace(block.image_points, active=points.active),
        rejects=rejects,
    )


def _told(rejects: Rejects) -> list[Note]:
    """A warning each; many of one kind for one reason in one line."""
    same: dict[tuple[str, str], list[str]] = {}
    for kind, name, reason in zip(rejects.kind.tolist(), rejects.id.tolist(), rejects.reason.tolist()):
        same.setdefault((kind, reason), []).append(printable(str(name)))
    notes = []
    for (kind, reason), names in same.items():
        if len(names) > MANY:
            notes.append(Note("warning", f"rejected: {len(names)} of kind {kind}: {reason}", tuple(names)))
        else:
            notes += [Note("warning", f"rejected: {kind} {name}: {reason}") for name in names]
    return notes


def repeated_measurements(block: Block) -> list[InputError]:
    """Errors for points measured twice in an image with different results."""
    rows = block.image_points
    key = _pair_key(block)
    order = np.argsort(key, kind="stable")
    order = order[rows.active[order]]
    first = _first_of_each(key[order])
    leader = order[np.maximum.accumulate(np.where(first, np.arange(len(order)), 0))]
    sigma = np.hypot(rows.sigma_mm[order], rows.sigma_mm[leader]) / _mm_per_unit(block)[rows.image[order]]
    apart = (np.abs(rows.xy[order] - rows.xy[leader]) > SAME_POINT_SIGMAS * sigma).any(axis=1)
    errors = []
    for k in np.flatnonzero(apart)[:MOST_LISTED]:
        a, b = int(leader[k]), int(order[k])
        name = _point_name(block, b)
        gap = np.abs(rows.xy[b] - rows.xy[a]).max()
        what = f"image point {name} measured twice, {gap:g} apart (first: {read_at(block, block.image_points, a)})"
        errors.append(
            InputError(
                what, where=read_at(block, block.image_points, b), remedy="remove the wrong one, or rename the point"
            )
        )
    return errors


def _mm_per_unit(block: Block) -> Float:
    """(images, 2) size in mm of the unit of the image coordinates."""
    pixel = (block.cameras.image_coordinates == "pixel")[:, None]
    return np.where(pixel, block.cameras.pixel_size_mm, 1.0)[block.images.camera].reshape(-1, 2)


def _outside_format(block: Block) -> Bool:
    """Image points more than the margin outside.

    The axes of a comparator or of a scan have no known place on the film, so nothing is outside there: interior
    orientation tells.
    """
    cameras = block.cameras
    size = cameras.format
    low, high = -size / 2, size / 2
    corner = np.isin(cameras.pixel_origin, ["top-left-corner", "top-left-centre", "bottom-left-corner"])
    from_corner = (corner & (cameras.image_coordinates == "pixel"))[:, None]
    low, high = np.where(from_corner, 0.0, low), np.where(from_corner, size, high)
    scanned = (cameras.kind == "film") & (cameras.image_coordinates == "pixel")
    unknown = ((cameras.image_coordinates == "comparator") | scanned)[:, None]
    low = np.where(unknown, np.nan, low - FORMAT_MARGIN * size)
    high = np.where(unknown, np.nan, high + FORMAT_MARGIN * size)
    camera = block.images.camera[block.image_points.image]
    xy = block.image_points.xy
    return np.asarray(((xy < low[camera]) | (xy > high[camera])).any(axis=1))


def _reject_round(block: Block, images: _Set, points: _Set) -> bool:
    """Apply rules 2 and 3 once; whether anything was rejected."""
    rows = block.image_points
    once = points.active & (_images_per_point(block, points.active) < 2)[rows.point]
    once &= ~_has_prior(block)[rows.point]
    points.reject(np.flatnonzero(once), SEEN_ONCE)
    count = np.bincount(rows.image[_pairs(block, points.active)], minlength=len(block.images))
    few = images.active & (count < MIN_IMAGE_POINTS) & ~_has_position(block)
    images.reject(np.flatnonzero(few), FEW_POINTS)
    orphans = points.active & ~images.active[rows.image]
    points.reject(np.flatnonzero(orphans), REJECTED_IMAGE)
    return bool(once.any() or few.any() or orphans.any())


def _pairs(block: Block, active: Bool) -> Int:
    """Rows of the active image points, one for each image and point."""
    rows = np.flatnonzero(active)
    key = _pair_key(block)[rows]
    order = np.argsort(key, kind="stable")  # the rows are sorted already, which makes this cheap
    return rows[order][_first_of_each(key[order])]


def _pair_key(block: Block) -> Int:
    rows = block.image_points
    return rows.image.astype(np.int64) * max(1, len(block.points)) + rows.point


def _first_of_each(sorted_key: Int) -> Bool:
    return np.concatenate([[True], sorted_key[1:] != sorted_key[:-1]])[: len(sorted_key)]


def _images_per_point(block: Block, active: Bool) -> Int:
    """Number of images in which each point has an active measurement."""
    return np.bincount(block.image_points.point[_pairs(block, active)], minlength=len(block.points))


def _has_prior(block: Block) -> Bool:
    """Points that one ray may determine: control, or with geodetic observations or relative control."""
    prior = np.zeros(len(block.points), bool)
    prior[block.ground_points.point[(block.ground_points.role == CONTROL).any(axis=1)]] = True
    return prior | joined(block)


def _has_position(block: Block) -> Bool:
    rows = block.exterior
    observed = (rows.position_use == OBSERVED_VALUE) & np.isfinite(rows.position_m).all(axis=1)
    return np.isin(np.arange(len(block.images)), rows.image[observed])


def _too_many(block: Block, images: _Set, points: _Set, share: float) -> list[InputError]:
    """An error where too much lies outside the format, or no image is left."""
    rows = block.image_points
    by_reason = {why: sorted(r for r, of in points.reasons.items() if of == why) for why in (OUTSIDE, SEEN_ONCE)}
    outside = [(_point_name(block, r), read_at(block, rows, r)) for r in by_reason[OUTSIDE]]
    if len(outside) > share * len(rows):
        what = f"{len(outside)} of {len(rows)} image points: {OUTSIDE}; at most {share:.0%} may be set aside: "
        remedy = (
            "check unit, origin, axes and `format` of the camera in block.yaml; or allow more with max_reject_share"
        )
        return [InputError(what + _listed(outside), where=outside[0][1], remedy=remedy)]
    if images.active.any() or not images.reasons:
        return []
    gone = [(str(block.images.id[r]), read_at(block, block.images, r)) for r in sorted(images.reasons)]
    once = [(_point_name(block, r), read_at(block, rows, r)) for r in by_reason[SEEN_ONCE]]
    what = f"no image is left: {len(gone)} of {len(block.images)} with {FEW_POINTS}: {_listed(gone)}"
    if once:
        what += f"; {len(once)} of {len(rows)} image points {SEEN_ONCE}: {_listed(once)}"
    remedy = "check that a point has the same id in all images; measure more points, or give observed positions"
    return [InputError(what, where=(once or gone)[0][1], remedy=remedy)]


def _listed(found: list[tuple[str, str]]) -> str:
    """The first of some names with their places."""
    more = f" and {len(found) - MOST_LISTED} more" if len(found) > MOST_LISTED else ""
    names = (f"{printable(name)} ({where})" if where else printable(name) for name, where in found[:MOST_LISTED])
    return ", ".join(names) + more


def _point_name(block: Block, row: int) -> str:
    """`image/point` of an image point."""
    rows = block.image_points
    return f"{block.images.id[rows.image[row]]}/{block.points.id[rows.point[row]]}"


def _rejects(block: Block, images: _Set, points: _Set) -> Rejects:
    """The list of rejects, in canonical order: by kind, id and reason."""
    old, ground = block.rejects, block.ground_points
    listed = list(zip(old.kind.tolist(), old.id.tolist(), old.reason.tolist(), old.file.tolist(), old.line.tolist()))
    for row, why in images.reasons.items():
        rows = block.images
        listed.append(("image", str(rows.id[row]), why, int(rows.file[row]), int(rows.line[row])))
    for row, why in points.reasons.items():
        measured = block.image_points
        listed.append(("image_point", _point_name(block, row), why, int(measured.file[row]), int(measured.line[row])))
    unseen = (
        np.isin(ground.role, (CONTROL, CHECK)).any(axis=1)
        & ((_images_per_point(block, points.active) == 0) & ~joined(block))[ground.point]
    )
    for row in np.flatnonzero(unseen).tolist():
        point = str(block.points.id[ground.point[row]])
        listed.append(("ground_point", point, NOT_SEEN, int(ground.file[row]), int(ground.line[row])))
    listed = sorted(set(listed), key=lambda r: (r[0], r[1].encode(), r[2], r[3], r[4]))
    if not listed:
        return Rejects.empty()
    kind, name, reason, file, line = zip(*listed)
    return Rejects(kind=np.array(kind), id=np.array(name), reason=np.array(reason), file=np.array(file, np.int32),
                   line=np.array(line, np.int32))  # fmt: skip
