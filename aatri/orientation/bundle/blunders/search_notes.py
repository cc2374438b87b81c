"""What the search for gross errors has to say: at observations, points, images and control."""

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.limits import SINGLE_LIMIT, expected_beyond
from aatri.arrays import Bool, Float
from aatri.notes import REJECTED, Note
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.all_records import AllRecords
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.rounds import OtherNumber

WHOLE_SHARE, WHOLE_LEAST = 0.3, 5
"""An image is named itself where so many of its image points are rejected; a point where half of its rays are."""


def labels(observed: Observed, rows: Bool) -> tuple[str, ...]:
    """What some observations are called: image/point, or the one there is."""
    image, point = observed.names(np.flatnonzero(rows))
    return tuple("/".join(x for x in pair if x) for pair in zip(image.tolist(), point.tolist()))


@dataclass(frozen=True)
class SearchOutcome:
    """What a search has come to, over all records."""

    active: Bool
    """(n,)."""
    undecided: Bool
    """(n,). Left out though only some of them are wrong."""
    above: Bool
    """(n,). Active with a test above the limit."""
    doubted: Bool
    """(n,). Active, at points where one of them is wrong, by little, and nothing tells which."""
    renumbered: tuple[OtherNumber, ...] = ()
    small: bool = False
    """There is too little redundancy to tell gross errors from wrong standard deviations."""
    test: Float | None = None
    """(n,). |w| of all."""
    whole: Bool | None = None
    """(n,). Of kinds that were left out as a whole."""


def findings(block: BundleInput, records: AllRecords, found: SearchOutcome, options: SearchOptions) -> list[Note]:
    """Notes on what was rejected, why, and on what could not be."""
    notes = []
    gone = records.native & ~found.active
    share = options.max_share
    most = "its redundancy answers for" if share is None else f"{share:.0%}, as `max_share` says,"
    why = (
        f": more than {most} would have to go, and all are used; where so many disagree the model or a whole group is "
    )
    why += "wrong"
    if found.small:
        why = ": none stands out of so few, and the standard deviations may be too small for all of them"
    whole = np.zeros_like(gone) if found.whole is None else found.whole
    said = (
        (gone & whole, "left out together: most of the kind disagree with the rest, which agrees without them"),
        (gone & ~whole & ~found.undecided, REJECTED),
        (gone & found.undecided, "left out: some of them are wrong, and nothing tells which"),
        (found.above, f"beyond {options.limit:.3g} sigma and kept{why}"),
    )
    for part, o in zip(records.parts, records.observed):
        for which, what in said:
            if which[part].any():
                text = f"{o.kind}: {int(which[part].sum())} of {len(o)} {what}"
                notes.append(Note("warning", text, labels(o, which[part])))
    if found.doubted.any():
        text = f"at {len(np.unique(records.point[found.doubted]))} points one of these is wrong, by little (beyond "
        text += f"{options.limit:.3g} sigma), and nothing tells which: all are used"
        names = [
            f"{o.kind} {name}"
            for part, o in zip(records.parts, records.observed)
            for name in labels(o, found.doubted[part])
        ]
        notes.append(Note("warning", text, tuple(names)))
    if found.renumbered:
        ids = tuple(_renumbering(block, one) for one in found.renumbered)
        what = "these fit under another number, which may be theirs"
        notes.append(Note("warning", f"image_point: {len(ids)} rejected, {what}", ids))
    notes += _whole(block, records, gone)
    return [*notes, *_by_chance(records, found)]


def _by_chance(records: AllRecords, found: SearchOutcome) -> list[Note]:
    """AdjustOptions many of what is used are beyond the limit of a single test, and how many chance explains."""
    if found.test is None or not found.active.any():
        return []
    beyond = int((found.active & (found.test > SINGLE_LIMIT)).sum())
    expected = expected_beyond(SINGLE_LIMIT, records.tests)
    text = f"{beyond} of {int(found.active.sum())} observations used are beyond {SINGLE_LIMIT:g} sigma, the limit of a "
    return [Note("note", f"{text}single test; chance explains some {expected:.0f}")] if beyond else []


def _renumbering(block: BundleInput, one: OtherNumber) -> str:
    assert block.rays is not None
    points = block.point_ids
    image, own = block.image_ids[block.rays.image[one.row]], points[block.rays.point[one.row]]
    return f"{image}/{own} (fits {points[one.point]})"


def _whole(block: BundleInput, records: AllRecords, gone: Bool) -> list[Note]:
    """Images and points most of whose observations are rejected."""
    notes = []
    for group, ids, share, what in (
        (
            POSE,
            block.image_ids,
            WHOLE_SHARE,
            "images of which {} and more of the image points are rejected: their "
            "number, interior orientation or camera may be wrong",
        ),
        (
            POINT,
            block.point_ids,
            0.5,
            "points half of whose rays and more are rejected: more than one object may carry the number",
        ),
    ):
        total, out = np.zeros(len(ids)), np.zeros(len(ids))
        for part, o in zip(records.parts, records.observed):
            touched = dict(o.records.touches)
            if POSE in touched and POINT in touched:
                native = records.native[part]
                total += np.bincount(touched[group][native], minlength=len(ids))
                out += np.bincount(touched[group][native & gone[part]], minlength=len(ids))
        least = WHOLE_LEAST if group == POSE else 3
        whole = (out >= least) & (out >= share * total)
        if whole.any():
            named = tuple(np.asarray(ids)[whole].tolist())
            notes.append(Note("warning", what.format(f"{share:.0%}"), named))
    return notes
