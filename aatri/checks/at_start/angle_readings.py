"""Angles in the conventions that are in use, and the one in which they agree with the orientations of images.

Another system, opposite signs, the transposed matrix, another unit, two angles exchanged: R_obs is made of the same
three numbers in each of them. A reading agrees where it is much nearer to the orientations than the one declared, and
than R_obs = I of all: thousandths of any angles hardly turn, and would agree with all images that are turned alike.
"""

import itertools
from collections.abc import Callable, Iterator

import numpy as np

from aatri.arrays import Float
from aatri.checks.limits import AGREEING_READING, SAME_READING, UNLIKELY_SIGMAS
from aatri.geometry.rotations import ENU_FROM_NED, angle_axes, body_from_mount

UNITS = {
    "gon, declared as degrees": 0.9,
    "degrees, declared as gon": 1 / 0.9,
    "radians, declared as degrees": 180 / np.pi,
    "radians, declared as gon": 200 / np.pi,
    "thousandths of the unit declared": 1e-3,
}
"""What angles may be in instead, and their factor."""

HEADINGS: dict[str, Callable[[Float], Float]] = {
    "south": lambda angles: angles + np.array([0.0, 0.0, np.pi]),
    "east, counter-clockwise": lambda angles: angles * [1, 1, -1] + np.array([0.0, 0.0, np.pi / 2]),
}
"""What headings may count from instead of north, and roll, pitch, heading as they are then."""


def agreeing_reading(
    angles_rad: Float, declared: Float, disagreement: Callable[[Float], float], system: str = "omega-phi-kappa"
) -> tuple[str, Float] | None:
    """The simplest reading of angles that agrees, its name and R_obs; None if none does.

    Parameters
    ----------
    angles_rad : (n, 3) float64, rad
    declared : (n, 3, 3) float64
        R_obs as declared.
    disagreement : callable
        Of R_obs (n, 3, 3), rad.
    system : str
        As declared.
    """
    readings = [(disagreement(R), what, R) for what, R in readings_of(angles_rad, system)]
    least = min(value for value, *_ in readings)
    best, what, R = next(reading for reading in readings if reading[0] <= SAME_READING * least)
    alike = np.broadcast_to(np.eye(3), declared.shape)
    return (what, R) if best <= AGREEING_READING * min(disagreement(declared), disagreement(alike)) else None


def unlikely_turns(differences_rad: Float, sigma_rad: Float) -> Float:
    """Turns by what differences of angles exceed what their standard deviations allow, (...), rad.

    Parameters
    ----------
    differences_rad, sigma_rad : (..., 3) float64, rad
        Standard deviations: 0 exact, NaN not stated, which allow nothing.
    """
    allowed = UNLIKELY_SIGMAS * np.nan_to_num(sigma_rad)
    return np.asarray(np.linalg.norm(np.maximum(np.abs(differences_rad) - allowed, 0.0), axis=-1))


def readings_of(angles: Float, declared: str) -> Iterator[tuple[str, Float]]:
    """The same angles in other conventions than declared: what it is called, and R_obs; the simplest first."""
    names = {
        "omega-phi-kappa": ("omega", "phi", "kappa"),
        "phi-omega-kappa": ("phi", "omega", "kappa"),
        "roll-pitch-heading": ("roll", "pitch", "heading"),
    }

    def observed(angles_rad: Float, system: str, *, transposed: bool = False) -> Float:
        R, _ = angle_axes(angles_rad, system)
        R = R.swapaxes(1, 2) if transposed else R
        return ENU_FROM_NED @ R @ body_from_mount(np.zeros(len(R))) if system == "roll-pitch-heading" else R

    for what, turn in HEADINGS.items() if declared == "roll-pitch-heading" else ():
        yield f"roll-pitch-heading with heading counted from {what}", observed(turn(angles), "roll-pitch-heading")
    flips = sorted(itertools.product((1, -1), repeat=3), key=lambda s: -sum(s))
    for transposed, signs, system in itertools.product((False, True), flips, names):
        turned = [name for name, sign in zip(names[system], signs) if sign < 0]
        what = system + (f" with {', '.join(turned)} of opposite sign" if turned else "")
        what += ", the transposed matrix (image from ground)" if transposed else ""
        yield what, observed(angles * np.array(signs), system, transposed=transposed)
    for unit, factor in UNITS.items():
        yield from ((f"{system} in {unit}", observed(factor * angles, system)) for system in names)
    for a, b in ((0, 1), (1, 2), (0, 2)):
        order = [0, 1, 2]
        order[a], order[b] = order[b], order[a]
        for system in names:
            yield f"{system} with a{a + 1} and a{b + 1} exchanged", observed(angles[:, order], system)
