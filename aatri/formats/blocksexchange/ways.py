"""What the description of BlocksExchange leaves open, decided by the points that a file itself measures.

    AspectRatio a        fy = a f              or fy = f / a
    Skew s               u = f u' + s v' + cx  or u = f (u' + s v') + cx
    omega, phi, kappa    in the axes of CameraOrientation, as described, or x right, y up whatever these are
    yaw, pitch, roll     roll clockwise to whom the camera looks at, as described, or to whom stands behind it

A file that has one of them is read in each of the ways; the one that is taken projects the control and tie points of
posed photos to where they are measured, to `MOST_OFF_PX` in the median, and the next one `CLEARLY_BETTER` times as far
off. Where the points do not decide, angles are read as described, and a file with AspectRatio or Skew is refused. An
affinity of less than `MISFIT_PX` at the edge of the image is none, as much as a fitted distortion may differ.
"""

from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np

from aatri.arrays import Float
from aatri.formats.conventions.lens import Lens
from aatri.formats.limits import CLEARLY_BETTER, FEWEST_DECIDING, MISFIT_PX, MOST_OFF_PX
from aatri.formats.text.xml_tree import XmlElement


@dataclass(frozen=True)
class Way:
    """One way to read what is open."""

    aspect: Literal["a f", "f / a"] = "a f"
    skew: Literal["px", "of f"] = "px"
    angles: Literal["described", "other"] = "described"

    def __str__(self) -> str:
        skew = "in px" if self.skew == "px" else "as a part of f"
        angles = "" if self.angles == "described" else "not "
        return f"AspectRatio as fy = {self.aspect}, Skew {skew}, angles {angles}as the format describes them"


USUAL = Way()


@dataclass(frozen=True)
class Affinity:
    """AspectRatio and Skew of a camera; 1 and 0 where they are nothing at the edge of the image."""

    aspect: float
    skew: float

    def focal_px(self, f_px: float, way: Way) -> tuple[float, float]:
        """(fx, fy)."""
        return f_px, f_px * self.aspect if way.aspect == "a f" else f_px / self.aspect

    def shear(self, f_px: float, way: Way) -> float:
        """What of v' is added to u'."""
        return self.skew / f_px if way.skew == "px" else self.skew


def affinity(group: XmlElement, height_px: float, f_px: float) -> Affinity:
    """The affinity of a photogroup."""
    aspect, skew = group.number("AspectRatio", default=1.0), group.number("Skew", default=0.0)
    if aspect <= 0:
        raise group.one("AspectRatio").error(f"AspectRatio {aspect:g}", "it is positive, 1 of square pixels")
    edge_px = height_px / 2
    return Affinity(
        aspect if abs(aspect - 1) * edge_px > MISFIT_PX else 1.0,
        skew if abs(skew) * edge_px * max(1.0, 1 / f_px) > MISFIT_PX else 0.0,
    )


def ways_of(affinities: list[Affinity], *, has_angles: bool) -> list[Way]:
    """The ways in which a file can be read; one where nothing is open."""
    aspects = ("a f", "f / a") if any(affinity.aspect != 1 for affinity in affinities) else ("a f",)
    skews = ("px", "of f") if any(affinity.skew for affinity in affinities) else ("px",)
    angles = ("described", "other") if has_angles else ("described",)
    return [Way(a, s, o) for a, s, o in product(aspects, skews, angles)]  # type: ignore[arg-type]


def misfits_px(lens: Lens, ground_from_image: Float, position_m: Float, xyz_m: Float, xy_px: Float) -> Float:
    """How far points are measured from where a photo sees them (n,), px; pixels count from the centre of the first."""
    q = (xyz_m - position_m) @ ground_from_image
    ahead = q[:, 2] < 0
    off = np.full(len(q), np.inf)
    ideal = q[ahead, :2] / np.abs(q[ahead, 2:]) * (1.0, -1.0)
    measured = xy_px[ahead] - (np.array(lens.size_px) - 1) / 2
    off[ahead] = np.hypot(*(lens.projected(ideal) - measured).T)
    return off


def decided(medians_px: list[float], count: int) -> int | None:
    """Which way projects points to where they are measured; None where that is not clear."""
    order = np.argsort(medians_px)
    best = int(order[0])
    if (
        count < FEWEST_DECIDING
        or medians_px[best] > MOST_OFF_PX
        or medians_px[int(order[1])] < CLEARLY_BETTER * medians_px[best]
    ):
        return None
    return best
