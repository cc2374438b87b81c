"""What to do about a rank defect, by what its message names.

Seen: an adjustment that names what is open: a datum, a part, a set of directions, parameters that free each other.
Test: that of `adjustment.openness`: none is made here.
"""

from collections.abc import Mapping
from itertools import combinations, pairwise

from aatri.camera.parameters.advice import advise
from aatri.observations.poses import ADDITIONAL, CAMERA, POSE

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
_PART = "too few points join it to the rest: measure more of them, or give control or positions in it"
_TURN = "control on one line (or two points) leaves the turn about it open: give a height away from it, or positions"
_SCALE = "no distance, no second control point and no positions give the size: observe one of them"
_SET = "no direction to a known point and no azimuth orients it: observe one"
_MOUNT = "a free mount takes up all that its exposures give: observe more of them, fix it or weight it (`sigmas`)"
_BORESIGHT = (
    "attitudes with a free boresight hold no azimuth; give a second control point in plan, or fix the boresight"
)


def rank_advice(what: str, names: tuple[str, ...], kinds: Mapping[str, str]) -> str:
    """The remedy for a rank defect, or an empty text where there is none of its own.

    Parameters
    ----------
    what : str
        The message.
    names : tuple of str
        Names of additional and camera parameters.
    kinds : mapping
        What the additional ones do.
    """
    text = f" {what}"
    of_camera = [name for name in names if f" {name} of {CAMERA}" in text]
    open_ = [name for name in names if f" {name} of {ADDITIONAL}" in text] + of_camera
    pose = [name for name in _POSE if f" {name} of {POSE}" in text]
    shared = [label for label in _SHARED if f" {label} of " in text] if not _shifted(text) else []
    pairs = [(a, b, 1.0) for a in open_ for b in (pose or shared)] or [(a, b, 1.0) for a, b in pairwise(open_)]
    pairs += [(a, b, 1.0) for a, b in combinations(shared, 2)] or [(a, b, 1.0) for a in shared for b in pose]
    reasons = dict.fromkeys(a.text.split("; ", 1)[1] for a in advise(pairs, kinds))
    if of_camera:
        reasons["fix or weight the parameters: `sigmas` of the camera"] = None
    elif open_:
        reasons["weight the parameters: `self_calibration.sigma_um`"] = None
    return "; ".join([*reasons, *_of_motions(text)])


def _shifted(text: str) -> bool:
    """Whether the whole block is shifted with what its groups of positions share."""
    motion, whole, others = text.partition(" of the whole block with ")
    return bool(whole) and " shift " in motion and "shift" in others and " of drift " in others


def _of_motions(text: str) -> list[str]:
    """The remedy for what is open of the datum, of sets and mounts."""
    advice = [advice for word, advice in ((" mount ", _MOUNT), (" boresight z ", _BORESIGHT)) if word in text]
    if " of the whole block" not in text and " of a part " not in text:
        return advice
    if " of a part " in text:
        return [*advice, _PART]
    if _shifted(text):
        return [*advice, _SHIFTS]
    if "shift" in text:
        return [*advice, _DATUM]
    if "rotation about the axis" in text or "rotation about X" in text or "rotation about Y" in text:
        return [*advice, _TURN]
    if "scale" in text:
        return [*advice, _SCALE]
    return advice or ([_SET] if "rotation about Z" in text else [])
