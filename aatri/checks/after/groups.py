"""Groups of observations that are wrong together: by how much, what it does, and what to do about it.

Seen: positions off by a constant, heights that count from another surface, a camera with another constant, distances of
a map: errors that single tests cannot find, and that spread over good observations.
Test: `orientation.bundle.groups`: score tests of all causes of all groups, at 0.1 % for the block. The result
contradicts its own tests where a group that is kept moves a coordinate x_i by more standard deviations (Baarda's
external reliability) than the root of chi-square of its k parameters g at 1 %: one test for all coordinates, as all
move by the same g, |dx_i| / sigma(dx_i) <= sqrt(g' C_g^-1 g) by Cauchy and Schwarz (docs/methods/gross_errors.md).
So it does where a camera asks for another calibration, and has left that of block.yaml by ten standard deviations.
"""

from collections.abc import Callable, Container, Iterator, Mapping
from itertools import product

import numpy as np
from scipy.special import chdtri

from aatri.adjustment.statistics.limits import FALSE_ALARM
from aatri.arrays import Float
from aatri.checks.finding import Finding
from aatri.checks.limits import OTHER_LEVER_ARM, SHORTEST_ARM_M
from aatri.observations.carried_vectors import BORESIGHT, LEVER_ARM
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.orientation.bundle.block import LINE, STRIP
from aatri.orientation.bundle.groups.candidates import ALL, IMAGE, MARK, NEIGHBOURHOOD
from aatri.orientation.bundle.groups.frame_marks import COORDINATES
from aatri.orientation.bundle.groups.group import Group
from aatri.orientation.bundle.groups.search import AcceptedGroup
from aatri.units import FOOT_M, about, decimals, digits

LENGTHS = {"": 1.0, " in mm": 1e-3, " in cm": 1e-2, " in dm": 0.1, " in feet": FOOT_M}
BLOCK_SHIFT = "positions: {drift: shift, per: block}"
DRIFT = "`positions: {drift: %s, per: %s}` estimates it"
SHRINKS = "`interior_orientation: affine` for film that shrinks"
RADIAL = (
    "estimate it (`self_calibration: {set: brown_conrady, per: {camera: [k1]}}`) or calibrate the lens; height control "
    "inside the block, observed positions or oblique images hold the bend"
)
OTHER_CAMERA = (
    "give its images a camera of their own (`camera` of images.csv); another lens, a rolling shutter (`readout_s`) and "
    "shadows, leaves, water that move (`mask`) look alike"
)
MOVED = "is it a rolling shutter (`readout_s`), or did shadows, leaves, water move (`mask` of images.csv)?"


def contradicts(accepted: AcceptedGroup, moved_cameras: Container[str] = ()) -> bool:
    """Whether the result cannot be right beyond its standard deviations: the model is wrong, not only the sigmas.

    Points of a neighbourhood or of one image, and marks of a frame, are wrong measurements, like single ones that are
    kept: no error of the model, which is what images have in common.
    """
    g = accepted.group
    if g.per in (NEIGHBOURHOOD, IMAGE, MARK):
        return False
    if g.kind == IMAGE_POINT and g.per == "camera" and g.unit in moved_cameras and not accepted.left_out:
        return True  # calibration or block: who knows
    of_datum = g.kind == "position" and g.per == ALL  # positions or control: who knows
    return g.harm > float(np.sqrt(chdtri(len(g.value), FALSE_ALARM))) and (of_datum or not accepted.left_out)


def wrong_groups(
    groups: tuple[AcceptedGroup, ...],
    lever_arms_m: Mapping[str, Float],
    boresights_rad: Mapping[str, Float],
    moved_cameras: Container[str],
) -> list[Finding]:
    """A warning for each group, contradictions first; lever arms and boresights are those given, by camera."""
    findings = [_finding(accepted, lever_arms_m, boresights_rad, moved_cameras) for accepted in groups]
    return sorted(findings, key=lambda finding: not finding.contradicts)


def _finding(
    accepted: AcceptedGroup, arms_m: Mapping[str, Float], boresights_rad: Mapping[str, Float], moved: Container[str]
) -> Finding:
    g = accepted.group
    text, remedy = _TEXTS[g.kind, g.cause](g)
    if g.cause == LEVER_ARM and arms_m[g.unit].any():
        remedy = _other_lever_arm(g, arms_m[g.unit]) or remedy
    if g.cause == BORESIGHT and boresights_rad[g.unit].any():
        remedy += _other_boresight(g, boresights_rad[g.unit])
    if g.moved:
        text += f"; it moves {g.moved} by {about(g.change_m)} (up to {g.harm:.3g} standard deviations)"
    others = tuple(_alternative(*one) for one in g.or_else[:3])
    if accepted.left_out and g.per == MARK:
        without = "the other control is used with its covariances" if g.cause == COORDINATES else "its frame is used"
        text += f"; {without} without it"
    elif not accepted.left_out:
        text += f"; all {len(g.rows)} are kept, and nothing is rejected in their stead"
    else:
        text += f"; all {len(g.rows) + len(g.undecided)} are left out"
    # of a set of correlated points g.rows is the set
    rows, wrong = {} if g.cause == COORDINATES else {g.kind: g.rows}, contradicts(accepted, moved)
    return Finding(
        "groups", "warning", text, remedy, rows=rows, alternatives=others, statistic=g.harm, contradicts=wrong
    )


def _alternative(per: str, unit: str, cause: str) -> str:
    of_unit = "" if per == ALL else f" of {per} {'of ' if per == NEIGHBOURHOOD else ''}{unit}"
    return f"{cause}{of_unit}"


def _values(value: Float, sigma: Float) -> str:
    return ", ".join("{} (+- {})".format(*map(digits(decimals(s)), (v, s))) for v, s in zip(value, sigma))


def _whose(g: Group) -> str:
    return "" if g.per == ALL else f" of {g.per} {g.unit}"


def _shift_of_positions(g: Group) -> tuple[str, str]:
    values = _values(g.value, g.sigma)
    if g.per != ALL:
        return f"observed positions{_whose(g)} are off together by {values} m in X, Y, Z", DRIFT % ("shift", g.per)
    text = f"positions and control differ by a constant: positions less control {values} m in X, Y, Z"
    return f"{text}; with it sigma0 is {g.sigma0:.3g}", f"declare the frames of both, or leave it open: {BLOCK_SHIFT}"


def _height_of_positions(g: Group) -> tuple[str, str]:
    text = "heights of positions and control count from different surfaces by a constant: positions less control "
    return (
        f"{text}{_values(g.value, g.sigma)} m; with it sigma0 is {g.sigma0:.3g}",
        f"declare `vertical` of the frames, or `undulation`, or leave it open: {BLOCK_SHIFT}",
    )


def _drift_of_positions(g: Group) -> tuple[str, str]:
    shift, drift = _values(g.value[:3], g.sigma[:3]), _values(g.value[3:], g.sigma[3:])
    text = f"observed positions{_whose(g)} are off together, by {shift} m in X, Y, Z in the middle and by "
    return f"{text}{drift} m more at the end", DRIFT % ("linear", g.per)


def _lever_arm(g: Group) -> tuple[str, str]:
    values = _values(g.value, g.sigma)
    return (
        f"observed positions{_whose(g)} are shifted by {values} m along the axes of the camera",
        "is the lever arm (`lever_arm`) or the clock wrong?",
    )


def _other_lever_arm(g: Group, given_m: Float) -> str:
    """How the lever arm that was given is to be read to explain the shift; empty where no reading does."""
    if _agree(g.value, g.sigma):  # as it is
        return ""
    fitting_m, without = given_m + g.value, ""
    if _agree(fitting_m, g.sigma):  # as one in mm may, too
        without = "the positions fit those of the projection centres: leave out `lever_arm`, or `refers_to: antenna`"
    for reading, read_m in _readings(given_m, LENGTHS):
        if _agree(fitting_m - read_m, g.sigma) and np.linalg.norm(read_m) >= SHORTEST_ARM_M:
            arm = ", ".join(f"{m:.6g}" for m in read_m + 0.0)
            text = f"the lever arm given fits read{reading}: {arm} m; give `lever_arm` so, in m"
            return f"{without}; or {text}" if without else text
    return without


def _other_boresight(g: Group, given_rad: Float) -> str:
    """How the boresight that was given is to be read to explain the offset; empty where no reading does.

    Small turns of angles b and v together are b + v, but for |b| |v| / 2, which counts as uncertain.
    """
    fitting, sigma = given_rad + g.value[:3], g.sigma[:3]
    sigma = np.hypot(sigma, 0.5 * np.linalg.norm(given_rad) * np.linalg.norm(g.value[:3]))
    for reading, read in _readings(given_rad, {"": 1.0}):
        if _agree(fitting - read, sigma) and not _agree(given_rad - read, sigma):
            turns = ", ".join(f"{angle:.6g}" for angle in np.degrees(read) + 0.0)
            return f"; the boresight given fits read{reading}: give `boresight` so, {turns} deg"
    return ""


def _agree(difference: Float, sigma: Float) -> bool:
    return float(((difference / sigma) ** 2).sum()) <= float(chdtri(3, OTHER_LEVER_ARM))


def _readings(stated: Float, units: Mapping[str, float]) -> Iterator[tuple[str, Float]]:
    """Readings of three values in other units and with opposite signs, in words and the values; the simplest first."""
    for unit, factor in units.items():
        for signs in sorted(product((1.0, -1.0), repeat=3), key=lambda signs: (sum(signs) % 3 != 0, -sum(signs))):
            turned = [axis for axis, sign, value in zip("xyz", signs, stated) if sign < 0 and value]
            yield (
                unit + f" with the opposite sign of {', '.join(turned)}" * bool(turned),
                factor * np.array(signs) * stated,
            )


def _shift_of_attitudes(g: Group) -> tuple[str, str]:
    text = f"observed attitudes{_whose(g)} are off together, by {_degrees(g, slice(0, 3))} deg"
    return text, "`attitudes: {drift: shift}` estimates it, with `drift_group` in exterior.csv"


def _drift_of_attitudes(g: Group) -> tuple[str, str]:
    text = f"{_shift_of_attitudes(g)[0]} in the middle and by {_degrees(g, slice(3, 6))} deg more at the end"
    return text, "`attitudes: {drift: linear}` estimates it, with `drift_group` in exterior.csv"


def _degrees(g: Group, axes: slice) -> str:
    return _values(np.degrees(g.value[axes]), np.degrees(g.sigma[axes]))


def _boresight(g: Group) -> tuple[str, str]:
    text = f"attitudes of camera {g.unit} have a common offset of {_degrees(g, slice(0, 3))} deg about its axes"
    return f"{text}, but its boresight is fixed", "let it free (sigmas: {boresight: .inf}), or give it"


def _principal_distance(g: Group) -> tuple[str, str]:
    c, sigma = f"{g.c_mm / g.factor:.3f}", f"{float(g.sigma[0]) / g.factor**2:.2g}"
    return f"{_ask(g)} a principal distance of {c} (+- {sigma}) mm instead of {g.c_mm:.3f} mm", _lens(g)


def _ask(g: Group) -> str:
    return f"image points{_whose(g)} ask for"


def _lens(g: Group) -> str:
    if g.per in (STRIP, LINE):
        return OTHER_CAMERA
    if g.loosens:
        return "check it, or give it a larger standard deviation, by which it is estimated"
    return "check it, or estimate it (`self_calibration`)"


def _principal_point(g: Group) -> tuple[str, str]:
    return f"{_ask(g)} a principal point that lies {_values(g.value, g.sigma)} mm off in x, y", _lens(g)


def _radial(g: Group) -> tuple[str, str]:
    text = f"{_ask(g)} a radial distortion of {1e3 * g.value[0]:.3g} um (+- {1e3 * g.sigma[0]:.2g} um)"
    return f"{text} at the corner of the format", RADIAL if g.per == "camera" else _lens(g)


def _affinity(g: Group) -> tuple[str, str]:
    a, b = (f"{1e3 * v:.3g} (+- {1e3 * s:.2g}) um" for v, s in zip(g.value, g.sigma))
    text = f"{_ask(g)} an affinity: x longer and y shorter by {a} at the corner of the format, axes turned by {b}"
    if g.per not in (STRIP, LINE, IMAGE):
        return text, f"{SHRINKS}; are both scales of comparator or pixels right?"
    other = f"was the film or scanner of this {g.per} another, or are its marks those of another image? {SHRINKS}"
    return text, f"{other}; without film: {MOVED}"


def _camera(g: Group) -> tuple[str, str]:
    names = ("principal distance", "principal point x", "y", "radial distortion at the corner", "affinity", "shear")
    values = ", ".join(f"{name} {v:+.4f} (+- {s:.4f})" for name, v, s in zip(names, g.value, g.sigma))
    return f"{_ask(g)} another interior orientation: {values} mm", _lens(g)


def _neighbourhood(g: Group) -> tuple[str, str]:
    values = ", ".join(f"{1e3 * v:.3g} (+- {1e3 * s:.2g})" for v, s in zip(g.value, g.sigma))
    text = f"neighbourhood of {g.unit}: {len(g.rows)} image points are moved together by {values} um in x, y"
    return text, "a repetitive texture, or another object: measure them again"


def _scale(g: Group) -> tuple[str, str]:
    ppm, sigma = 1e6 * float(g.value[0]), 1e6 * float(g.sigma[0])
    sense = "long" if ppm > 0 else "short"
    return (
        f"distances are {abs(ppm):.0f} ppm (+- {sigma:.0f}) too {sense} for the rest of the block",
        "were they reduced to a map or to another height?",
    )


def _mark(g: Group) -> tuple[str, str]:
    off, size = float(np.abs(g.effect).max()), float(np.sqrt(g.gain))
    text = f"distances of mark {g.unit} in its portable frame are wrong, by up to {about(off)}"
    text += f" ({size:.3g} standard deviations together)"
    return text, "measure the mark again in the frame; or is it another point in the images?"


def _coordinates(g: Group) -> tuple[str, str]:
    text = f"control point {g.unit} is off by {_values(g.value, g.sigma)} m in the coordinates given"
    return text, "look at the point and its number, in the images and in the list"


def _relief(g: Group) -> tuple[str, str]:
    times = f"{1 + g.value[0]:.3g} (+- {g.sigma[0]:.2g}) times"
    return (
        f"heights of {len(g.rows)} control points fit the images with {times} their relief",
        "are they in feet (0.305), do they count downwards or are two axes exchanged (-1), or is the principal "
        "distance wrong?",
    )


_TEXTS: dict[tuple[str, str], Callable[[Group], tuple[str, str]]] = {
    ("position", "height"): _height_of_positions,
    ("position", "shift"): _shift_of_positions,
    ("position", "drift"): _drift_of_positions,
    ("position", LEVER_ARM): _lever_arm,
    ("attitude", "shift"): _shift_of_attitudes,
    ("attitude", "drift"): _drift_of_attitudes,
    ("attitude", BORESIGHT): _boresight,
    ("image_point", "principal distance"): _principal_distance,
    ("image_point", "principal point"): _principal_point,
    ("image_point", "radial distortion"): _radial,
    ("image_point", "affinity"): _affinity,
    ("image_point", "camera"): _camera,
    ("image_point", "shift"): _neighbourhood,
    ("distance", "scale"): _scale,
    ("distance", "place in its frame"): _mark,
    ("control", "relief"): _relief,
    ("control", COORDINATES): _coordinates,
}
