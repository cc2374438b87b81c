"""Whether the matrices of a list map image to ground or ground to image, where its format does not say.

In a flight an axis of the image lies along the line, or across it. With h the direction of flight and a that of the
image x axis on the ground, the columns of R, cos 4(h - a) is about 1 for the true sense; for the other one a has the
other sign, and cos 4(h + a) scatters, unless the lines run along the axes of the ground system. There both senses are
the same but for small angles, and as start values one is as good as the other.
"""

from typing import Literal, NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError

Sense = Literal["ground_from_image", "image_from_ground"]
SENSES: tuple[Sense, Sense] = ("ground_from_image", "image_from_ground")
ALONG = 0.9
"""Mean of cos 4(h - a) that a flight has: images turned against it by up to 6 degrees."""
APART = 0.1
"""What the other sense must be worse by, to be told from it: 4 degrees of azimuth."""
FEWEST = 3
"""Fewest pairs of neighbours that decide."""
LONG = 2.0
"""A step longer than so many times the median leads to another line."""


class MatrixSense(NamedTuple):
    """The sense that a flight shows; None: it shows none. `decided`: the other one does not fit."""

    sense: Sense | None
    decided: bool


def sense_of(matrices: Float, position_m: Float, usual: Sense = "ground_from_image") -> MatrixSense:
    """The sense of some matrices.

    Parameters
    ----------
    matrices : (n, 3, 3) float64
        As stated; image axes photogrammetric (x right, y up).
    position_m : (n, 3) float64, m
        East, north, up, in the order of the flight.
    usual : str
        Taken where both senses fit.
    """
    step = np.diff(position_m[:, :2], axis=0)
    length = np.linalg.norm(step, axis=1)
    median = float(np.median(length[length > 0])) if (length > 0).any() else 0.0
    pairs = np.flatnonzero((length > 0) & (length <= LONG * median))
    if len(pairs) < FEWEST:
        return MatrixSense(None, decided=False)
    heading = np.arctan2(step[pairs, 1], step[pairs, 0])
    fits: dict[Sense, float] = {}
    for sense, R in zip(SENSES, (matrices, matrices.swapaxes(1, 2))):
        axis = np.arctan2(R[pairs, 1, 0], R[pairs, 0, 0])
        fits[sense] = float(np.cos(4 * (heading - axis)).mean())
    best = max(fits, key=lambda sense: fits[sense])
    if fits[best] < ALONG:
        return MatrixSense(None, decided=False)
    decided = fits[best] - min(fits.values()) > APART
    return MatrixSense(best if decided else usual, decided)


def as_ground_from_image(
    stated: Float, position_m: Float, maps: Sense | None, where: str, usual: Sense = "ground_from_image"
) -> tuple[Float, str]:
    """Matrices (n, 3, 3) as image to ground, and by what that is known, in words.

    Parameters
    ----------
    stated, position_m, usual
        As `sense_of` takes them; matrices that are not known are NaN.
    maps : str, optional
        The sense, if the user says it.
    where : str
        Place of the list.

    Raises
    ------
    InputError
        If neither the user nor the flight says it.
    """
    sense, reason = maps, "as `maps` says"
    if sense is None:
        known = np.isfinite(stated).all(axis=(1, 2)) & np.isfinite(position_m).all(axis=1)
        shown = sense_of(stated[known], position_m[known], usual)
        sense, reason = shown.sense, "as the lines of the flight show"
        if sense is not None and not shown.decided:
            reason = "as usual: with lines along the axes of the ground system both senses are alike"
    if sense is None:
        what = "nothing says which way the rotation matrices map, and the positions are no lines that would show it"
        raise InputError(
            what, where=where, remedy=f"say which, `--set maps=...` or in a pipeline `maps`: {' or '.join(SENSES)}"
        )
    R = stated if sense == "ground_from_image" else stated.swapaxes(1, 2)
    return R, f"matrices are read as {sense.replace('_', ' ')}, {reason}"
