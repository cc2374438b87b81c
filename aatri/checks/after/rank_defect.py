"""What to do about a rank defect, by what is open.

Seen: an adjustment that names what is open: a datum, a part, a set of directions, parameters that free each other.
Test: that of `adjustment.openness`: none is made here.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations as combinations_of
from itertools import pairwise

from aatri.adjustment.openness.open_directions import Move, OpenCombination, OpenError
from aatri.camera.parameters.advice import advise
from aatri.errors import GeometryError
from aatri.observations.carried_vectors import BORESIGHTS
from aatri.observations.drift import DRIFT
from aatri.observations.poses import CAMERA, POSE, is_additional
from aatri.observations.rigs import MOUNT

_SHARED = (
    *(f"{word} {axis}" for word in ("shift", "drift") for axis in "XYZ"),
    *(f"lever {axis}" for axis in "xyz"),
    "time offset",
)
"""Labels of what positions share."""

_POSE = ("X0", "Y0", "Z0")

_DATUM = (
    "of the three coordinates of three points off one line seven fix a block: give control, observed positions or, for "
    "the scale, a distance; or set `datum: minimal` or `datum: free`"
)
_SHIFTS = (
    "every group of positions has a shift of its own: give control, positions in no group (`drift_group` in "
    "exterior.csv, empty), or take the positions as they are by `positions: {drift: none}`"
)
_PART = (
    "too few points join it to the rest: measure more of them, or give control or positions in it "
    "(`use: observed` makes measured ones of start values)"
)
_TURN = "control on one line (or two points) leaves the turn about it open: give a height or a position away from it"
_SCALE = "no distance, no second control point and no positions give the size: observe one of them"
_SET = "no direction to a known point and no azimuth orients it: observe one"
_MOUNT = "a free mount takes up all that its exposures give: observe more of them, fix it or weight it (`sigmas`)"
_BORESIGHT = (
    "attitudes with a free boresight hold no azimuth; give a second control point in plan, or fix the boresight"
)

_FREE = (
    "the datum is free, so it is not control that lacks: look for gross errors that bend the block "
    "(`blunders: robust_snooping`), or measure more points that join its images"
)

_HARDLY_SEEN = (
    "a free datum leaves it to the control and positions there are, which hardly tell it: give such as do, "
    "or make them `approximate`"
)


def rank_advice(
    error: GeometryError,
    names: tuple[str, ...],
    kinds: Mapping[str, str],
    *,
    free_datum: bool = False,
    tied: bool = False,
) -> str:
    """The remedy for a rank defect, or an empty text where there is none of its own.

    Parameters
    ----------
    names : tuple of str
        Names of additional and camera parameters.
    kinds : mapping
        What the additional ones do.
    tied : bool
        There are control or positions.
    """
    combinations = error.combinations if isinstance(error, OpenError) else ()
    unknowns = [unknown for one in combinations for unknown in one.unknowns]
    labels, shifted = {label for label, _ in unknowns}, any(map(_shifted, combinations))
    of_camera = [name for name in names if (name, CAMERA) in unknowns]
    additional = {label for label, group in unknowns if is_additional(group)}
    open_ = [name for name in names if name in additional] + of_camera
    pose = [name for name in _POSE if (name, POSE) in unknowns]
    shared = [] if shifted else [label for label in _SHARED if label in labels]
    pairs = [(a, b, 1.0) for a in open_ for b in (pose or shared)] or [(a, b, 1.0) for a, b in pairwise(open_)]
    pairs += [(a, b, 1.0) for a, b in combinations_of(shared, 2)] or [(a, b, 1.0) for a in shared for b in pose]
    reasons = dict.fromkeys(a.reason for a in advise(pairs, kinds))
    if of_camera:
        reasons["fix or weight the parameters: `sigmas` of the camera"] = None
    elif open_:
        reasons["weight the parameters: `self_calibration.sigma_um`"] = None
    carried = [_MOUNT] * any(group == MOUNT for _, group in unknowns) + [_BORESIGHT] * (BORESIGHTS.labels[2] in labels)
    motions = _of_motions(combinations, shifted)
    if free_datum and motions and not (tied and motions == [_PART]):
        motions = [_HARDLY_SEEN if tied else _FREE]
    return "; ".join([*reasons, *carried, *(motions if motions != [_SET] or not carried else ())])


def _shifted(one: OpenCombination) -> bool:
    """Whether the whole block is shifted with what its groups of positions share."""
    with_group = any(group == DRIFT and label.startswith("shift") for label, group in one.unknowns)
    return one.of_whole and with_group and "shift" in one.moves


def _of_motions(combinations: Sequence[OpenCombination], shifted: bool) -> list[str]:
    """The remedy for what is open of the datum and of sets."""
    moves = {move for one in combinations for move in one.moves}
    if any(one.moves and not one.of_whole for one in combinations):
        return [_PART]
    if shifted:
        return [_SHIFTS]
    remedies: dict[Move, str] = {"shift": _DATUM, "tilt": _TURN, "scale": _SCALE, "azimuth": _SET}
    return [remedy for move, remedy in remedies.items() if move in moves][:1]
