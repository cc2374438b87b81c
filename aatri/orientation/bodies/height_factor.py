"""Heights of control that vary more or less than those of the model, by a factor: feet, or downwards.

A model levelled and scaled by its control in plan has heights z in metres. With heights of control in another unit

    Z = f z + a + b X + c Y + v,

where a, b, c take up height, tilt, and what a wrong tilt took from the relief; heights weigh by their standard
deviations, and f is known no better than these allow. f is 1 in a good block; with heights in feet 3.2808, with heights
that count downwards -1. A principal distance wrong by f has the same effect: it stretches the model upwards. Over flat
ground f is not determined, and nothing is said.

It is said where the residuals v fall to a share of those with f = 1 and f is known well, which takes relief. Errors of
the model make f too near to zero by a few hundredths; a known factor is met within a tenth, or three standard
deviations. An f beyond 2 or below 1/2 is certain: no principal distance to be calibrated is so far off. Source: the
affinity of heights in Kraus, Photogrammetry, deformation of models.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float
from aatri.orientation.bodies.limits import (
    FACTOR_LEAVES,
    FACTOR_SIGMA,
    FLAT_RELIEF,
    NEAR_FACTOR,
    NO_LENS_FACTOR,
    SPARE_HEIGHTS,
)
from aatri.units import FOOT_M, LENGTH_M

KNOWN = {
    1 / FOOT_M: ("they are in feet (3.28)", "convert them to metres"),
    FOOT_M: ("they are metres divided by 3.28 (0.305)", "give them in metres"),
    1 / LENGTH_M["mm"]: ("they are in mm (1000)", "give them in metres"),
    -1.0: ("they count downwards (-1)", "turn their sign"),
}
"""Factors whose cause is known: what it is, and what to do."""

UNKNOWN = (
    "their unit or the principal distance is wrong",
    "check the unit of the heights, and principal distance and pixel size, both in mm",
)
"""Cause and remedy of any other factor."""

LEVEL = (
    "are all alike, and those of the model are not",
    "give them as measured, or X and Y alone; over flat ground calibrate the camera",
)
"""Heights without relief, of which the factor is 0: of no other unit."""


@dataclass(frozen=True)
class HeightFactor:
    """How much more heights of control vary than those of the model."""

    factor: float
    """0: of control that is all of one height."""
    sigma: float
    cause: str
    remedy: str
    """Of a factor that is known; else what else it may be."""

    @property
    def certain(self) -> bool:
        """Whether this is no matter of a calibration."""
        return self.factor != 0.0 and not 1 / NO_LENS_FACTOR <= self.factor <= NO_LENS_FACTOR

    def __str__(self) -> str:
        if self.factor == 0.0:
            return f"heights of control {self.cause}"
        return (
            f"heights of control vary {self.factor:.2f} (+- {self.sigma:.2f}) times as much as those of the model: "
            f"{self.cause}"
        )


def height_factor(
    model_m: Float, given_m: Float, has_coordinate: Bool, sigma_m: Float | None = None
) -> HeightFactor | None:
    """The factor by which heights of control differ from those of an oriented model.

    Parameters
    ----------
    model_m : (n, 3) float64, m
        Points of the model on the ground, by a similarity that may have suffered from the heights.
    given_m : (n, 3) float64, m
        Control.
    has_coordinate : (n, 3) bool
        Coordinates that are known.
    sigma_m : (n,) float64, m, optional
        Standard deviations of the heights; 0 exact, None: all equal and unknown.

    Returns
    -------
    HeightFactor or None
        None where the heights fit, or do not tell.
    """
    plan, heights = has_coordinate[:, :2].all(axis=1), has_coordinate[:, 2]
    if plan.sum() < 2 or heights.sum() < 4 + SPARE_HEIGHTS:
        return None
    scale = _scale_in_plan(model_m[plan], given_m[plan])
    x = (model_m[heights] - model_m[heights].mean(axis=0)) * scale
    sigma_Z = np.zeros(len(x)) if sigma_m is None else sigma_m[heights]
    least = float(np.median(sigma_Z)) or 1.0  # better heights weigh no more than most: a model is deformed
    weight = least / np.maximum(sigma_Z, least)
    Z, z = weight * given_m[heights, 2], weight * x[:, 2]
    tilt = weight[:, None] * np.column_stack([np.ones(len(x)), x[:, :2]])
    at_one, flat_m = _residuals(tilt, Z - z), FLAT_RELIEF * np.ptp(x[:, :2], axis=0).max()
    if np.abs(at_one).max() < flat_m:
        return None
    if np.ptp(given_m[heights, 2]) < flat_m:  # of no unit; nobody has measured them, or the model is bent
        return None if sigma_Z.any() else HeightFactor(0.0, 0.0, *LEVEL)
    left = _residuals(np.column_stack([z, tilt]), Z)
    if not np.linalg.norm(left) < FACTOR_LEAVES * np.linalg.norm(at_one):
        return None
    relief = _residuals(tilt, z)
    factor = float(relief @ Z / (relief @ relief))
    error = np.hypot(np.linalg.norm(left) / np.sqrt(len(x) - 4), np.median(weight * sigma_Z))
    sigma = float(error / np.linalg.norm(relief))
    if sigma > FACTOR_SIGMA * abs(factor) or abs(factor - 1) < 10 * sigma:
        return None
    near = min(KNOWN, key=lambda of_unit: abs(factor - of_unit))
    met = abs(factor - near) <= max(3 * sigma, NEAR_FACTOR * abs(near))
    return HeightFactor(factor, sigma, *(KNOWN[near] if met else UNKNOWN))


def _scale_in_plan(model: Float, ground: Float) -> float:
    """Scale of the similarity in plan: the median ratio of distances from the middle, which one wrong point leaves."""
    a, b = (np.linalg.norm((xyz - np.median(xyz, axis=0))[:, :2], axis=1) for xyz in (model, ground))
    both = (a > 0) & (b > 0)
    return float(np.median(b[both] / a[both])) if both.any() else 1.0


def _residuals(design: Float, observed: Float) -> Float:
    return np.asarray(observed - design @ np.linalg.lstsq(design, observed, rcond=None)[0])
