"""Whether an Information fits a block: one frame, the same cameras and sets, nothing eliminated that the block has.

Observations that stand in the Information and in the block are the same by kind, names and values; they count once.
"""

import numpy as np

from aatri.adapters.bundle.information_observed import other_set
from aatri.adapters.bundle.information_of import camera_digests, counted_rows, frame_text
from aatri.arrays import Bool
from aatri.artifacts.block import Block
from aatri.artifacts.information import Information
from aatri.artifacts.solution import CalibratedSets
from aatri.errors import ArtifactError, Faults, raise_all
from aatri.ids import printable, shown
from aatri.observations.poses import CAMERA, POINT, POSE, is_additional
from aatri.orientation.bundle.block import BundleInput

GIVEN_ONCE = ("control", "position", "attitude")
"""Kinds of which a point or image has one: another value is a contradiction."""


def check_frame(information: Information, block: Block) -> None:
    """Raise if the coordinates of the two mean other things.

    Raises
    ------
    ArtifactError
    """
    own = frame_text(block)
    if information.frame != own:
        raise ArtifactError(
            f"the Information of block {information.block} is in the frame ({information.frame}), the block in ({own})",
            remedy="adjust both in one frame",
        )


def check_unknowns(information: Information, block: Block, inputs: BundleInput) -> None:
    """Raise if cameras or their parameters are others, or the Information has eliminated what the block has.

    Raises
    ------
    ArtifactError
    """
    faults, of = Faults(ArtifactError), information.block
    digests = dict(zip(information.cameras.id.tolist(), information.cameras.digest.tolist()))
    own = camera_digests(block)
    common = [name for name in own.id.tolist() if name in digests]
    for name, digest in zip(own.id.tolist(), own.digest.tolist()):
        if digests.get(name, digest) != digest:
            what = f"camera {printable(name)} is another in block {of}: its figures differ"
            faults.add(what, remedy="give it another id, or the same figures in both")
    eliminated = information.eliminated_objects
    for group, ids in ((POSE, inputs.image_ids), (POINT, inputs.point_ids)):
        both = np.intersect1d(eliminated.object[eliminated.group == group], np.asarray(ids, dtype=np.str_))
        if len(both):
            what = f"{group}s {shown(both.tolist())} of this block were eliminated in the Information of block {of}"
            faults.add(what, remedy="keep them there (`keep`), or give what is something else another id")
    here = {u.name: u.labels for o in inputs.observed for u in o.unknowns if u.free.any()}
    there = {str(group) for group in np.unique(information.unknowns.group)}
    for group in sorted({*here, *there} if common else ()):
        if (is_additional(group) or group == CAMERA) and (group not in here or group not in there):
            rows = information.unknowns.group == group
            names = list(dict.fromkeys(information.unknowns.name[rows].tolist()))
            faults.append(other_set(group, shown(common), names, here.get(group, ())))
    raise_all(faults)


def check_sets(information: Information, sets: CalibratedSets | None) -> None:
    """Raise if a set of additional parameters that both have is scaled otherwise.

    Raises
    ------
    ArtifactError
    """
    if information.calibrated_sets is None or sets is None:
        return
    there = information.calibrated_sets
    for k, name in enumerate(sets.object.tolist()):
        for i in np.flatnonzero((there.object == name) & (there.camera == sets.camera[k])).tolist():
            for column in ("set", "per", "principal_distance_mm", "half_format_mm", "base_mm"):
                values = [getattr(table, column)[row] for table, row in ((there, i), (sets, k))]
                if not np.array_equal(*values):
                    raise ArtifactError(
                        f"self-calibration of {printable(name)}: {column} is {values[0]} in block {information.block}, "
                        f"{values[1]} here",
                        remedy="use the same set in both, one that the photo base does not scale: brown, brown_conrady",
                    )


def standing_in(information: Information, block: Block, inputs: BundleInput) -> tuple[Bool, ...]:
    """Which rows of each observation of the block stand in the Information.

    Raises
    ------
    ArtifactError
        If control, a position or an attitude has another value there.
    """
    c, unknowns, faults = information.counted, information.unknowns, Faults(ArtifactError)
    there: dict[tuple[str, str, str], set[int]] = {}
    for kind, image, point, digest in zip(c.kind.tolist(), c.image.tolist(), c.point.tolist(), c.digest.tolist()):
        there.setdefault((kind, image, point), set()).add(digest)
    keep = {
        group: np.isin(np.asarray(ids, dtype=np.str_), unknowns.object[unknowns.group == group])
        for group, ids in ((POSE, inputs.image_ids), (POINT, inputs.point_ids))
    }
    twice = []
    for o in inputs.observed:
        same = np.zeros(len(o), dtype=bool)
        for row, key, digest in counted_rows(block, o, o.records.active, keep):
            digests = there.get(key, set())
            same[row] = digest in digests
            if digests and not same[row] and o.kind in GIVEN_ONCE:
                name = "/".join(map(printable, filter(None, key[1:])))
                what = f"{o.kind} {name} has another value in the Information of block {information.block}"
                faults.add(what, remedy="correct one, or give it another id")
        twice.append(same)
    raise_all(faults)
    return tuple(twice)
