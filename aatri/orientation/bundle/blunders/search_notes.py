"""What the search for gross errors has to say: at observations, points, images and control."""

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.limits import SINGLE_LIMIT, expected_beyond
from aatri.arrays import Bool, Float
from aatri.ids import several
from aatri.notes import REJECTED, Note
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.all_records import AllRecords
from aatri.orientation.bundle.blunders.limits import REJECTED_LEAST, REJECTED_SHARE
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.rounds import OtherNumber


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
    above_limit: Bool
    """(n,). Active with a test above the limit."""
    kept_ambiguous: Bool
    """(n,). Active, at points where one of them is wrong, by little, and nothing tells which."""
    renumbered: tuple[OtherNumber, ...] = ()
    low_redundancy: bool = False
    """There is too little redundancy to tell gross errors from wrong standard deviations."""
    test: Float | None = None
    """(n,). |w| of all."""
    rejected_kinds: Bool | None = None
    """(n,). Of kinds that were left out as a whole."""
    of_datum: Bool | None = None
    """(n,). Active though a robust adjustment rejects them, as the datum would be open without them."""


def findings(block: BundleInput, records: AllRecords, outcome: SearchOutcome, options: SearchOptions) -> list[Note]:
    """Notes on what was rejected, why, and on what could not be."""
    notes = []
    rejected = records.native & ~outcome.active
    share = options.max_share
    allowed = "its redundancy answers for" if share is None else f"{share:.0%}, as `max_share` says,"
    reason = f": more than {allowed} would have to go, and all are used; where so many disagree the model or a whole "
    reason += "group is wrong"
    if outcome.low_redundancy:
        reason = ": none stands out of so few, and the standard deviations may be too small for all of them"
    of_kinds = np.zeros_like(rejected) if outcome.rejected_kinds is None else outcome.rejected_kinds
    rejected_kind = of_kinds.copy()
    for part in records.parts:  # where most has come back, no kind is out
        rejected_kind[part] &= rejected[part].sum() > 0.5 * records.native[part].sum()
    categories = (
        (
            rejected & rejected_kind,
            "left out together: most of the kind disagree with the rest, which agrees without them",
        ),
        (rejected & ~rejected_kind & ~outcome.undecided, REJECTED),
        (rejected & outcome.undecided, "left out: some of them are wrong, and nothing tells which"),
        (
            np.zeros_like(rejected) if outcome.of_datum is None else outcome.of_datum,
            "rejected by a robust adjustment and used: without them the datum is open; check them, or observe more",
        ),
        (outcome.above_limit, f"beyond {options.w_limit:.3g} sigma and kept{reason}"),
    )
    for part, o in zip(records.parts, records.observed):
        for mask, text_of_category in categories:
            if mask[part].any():
                text = f"{o.kind}: {int(mask[part].sum())} of {len(o)} {text_of_category}"
                notes.append(Note("warning", text, labels(o, mask[part])))
    if outcome.kept_ambiguous.any():
        count = len(np.unique(records.point[outcome.kept_ambiguous]))
        text = f"at {several(count, 'point')} one of these is wrong, by little (beyond {options.w_limit:.3g} sigma), "
        text += "and nothing tells which: all are used"
        names = [
            f"{o.kind} {name}"
            for part, o in zip(records.parts, records.observed)
            for name in labels(o, outcome.kept_ambiguous[part])
        ]
        notes.append(Note("warning", text, tuple(names)))
    if outcome.renumbered:
        ids = tuple(_renumbering(block, one) for one in outcome.renumbered)
        text_of_category = "these fit under another number, which may be theirs"
        notes.append(Note("warning", f"image_point: {len(ids)} rejected, {text_of_category}", ids))
    notes += _mostly_rejected(block, records, rejected, outcome.undecided)
    return [*notes, *_by_chance(records, outcome)]


def _by_chance(records: AllRecords, outcome: SearchOutcome) -> list[Note]:
    """How many of what is used are beyond the limit of a single test, and how many chance explains."""
    if outcome.test is None or not outcome.active.any():
        return []
    beyond = int((outcome.active & (outcome.test > SINGLE_LIMIT)).sum())
    expected = expected_beyond(SINGLE_LIMIT, records.tests)
    text = (
        f"{beyond} of {int(outcome.active.sum())} observations used are beyond {SINGLE_LIMIT:g} sigma, the limit of a "
    )
    return [Note("note", f"{text}single test; chance explains some {expected:.0f}")] if beyond else []


def _renumbering(block: BundleInput, renumbered: OtherNumber) -> str:
    assert block.rays is not None
    points = block.point_ids
    image, own = block.image_ids[block.rays.image[renumbered.row]], points[block.rays.point[renumbered.row]]
    return f"{image}/{own} (fits {points[renumbered.point]})"


def _mostly_rejected(block: BundleInput, records: AllRecords, rejected: Bool, undecided: Bool) -> list[Note]:
    """Images and points most of whose observations are rejected.

    Undecided rays do not count at points: a single wrong one among them explains them all.
    """
    images = _most_of_rays(block, records, rejected, POSE) >= REJECTED_SHARE
    points = _most_of_rays(block, records, rejected & ~undecided, POINT) >= 0.5
    otherwise = _observed_otherwise(block, records, rejected)
    many = "points of which half of the rays or more are rejected"
    texts = (
        f"images of which {REJECTED_SHARE:.0%} or more of the image points are rejected: their number, interior "
        "orientation or camera may be wrong",
        f"{many}: more than one object may carry the number",
        f"{many} beside what else is given of them, control, distances, the frame of a body: either the rays are those "
        "of another object, or what is given is wrong",
    )
    named = (block.image_ids, images), (block.point_ids, points & ~otherwise), (block.point_ids, points & otherwise)
    return [
        Note("warning", text, tuple(np.asarray(ids)[wrong].tolist()))
        for text, (ids, wrong) in zip(texts, named)
        if wrong.any()
    ]


def _most_of_rays(block: BundleInput, records: AllRecords, rejected: Bool, group: str) -> Float:
    """Share of rejected rays of each image or point; 0 where too few are rejected to say anything."""
    n = len(block.image_ids if group == POSE else block.point_ids)
    total, rejected_count = np.zeros(n), np.zeros(n)
    for part, o in zip(records.parts, records.observed):
        touched = dict(o.records.touches)
        if POSE in touched and POINT in touched:
            native = records.native[part]
            total += np.bincount(touched[group][native], minlength=n)
            rejected_count += np.bincount(touched[group][native & rejected[part]], minlength=n)
    least = REJECTED_LEAST if group == POSE else 3
    return np.where(rejected_count >= least, rejected_count / np.maximum(total, 1), 0.0)


def _observed_otherwise(block: BundleInput, records: AllRecords, rejected: Bool) -> Bool:
    """Points of which something else than rays is observed, and not rejected."""
    otherwise = np.zeros(len(block.point_ids), dtype=bool)
    for part, o in zip(records.parts, records.observed):
        groups = [group for group, _ in o.records.touches]
        for group, rows in o.records.touches:
            if group == POINT and POSE not in groups:
                otherwise[rows[o.records.active & ~rejected[part]]] = True
    return otherwise
