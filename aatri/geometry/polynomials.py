"""General polynomials of plan coordinates, as corrections of a strip's points, in axes of the strip.

    degree 0: 1        degree 1: 1, U, V        degree 2: 1, U, V, U^2, U V

the same terms for each of the three corrections dU, dV, dW. U runs along the strip, V across, W up; U and V are centred
and divided by half their range, so that they lie in [-1, 1] and the terms are about equally large.

Source: strip polynomials of second degree with five coefficients per coordinate; Kraus, Photogrammetry, strip
adjustment; docs/formulas.md 4.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float

TERMS = ("1", "U", "V", "UU", "UV")
"""Names of the terms, in order."""

COUNT = {-1: 0, 0: 1, 1: 3, 2: 5}
"""Number of terms of each degree; -1 is no correction."""


@dataclass(frozen=True)
class StripAxes:
    """Axes of a strip: U along it, V across, W up.

    Attributes
    ----------
    origin_m : (3,) float64, m
        Centre of the points' range in U and V, at their mean height.
    half_range_m : (2,) float64, m
        Half the range of U and V.
    ground_from_axes : (3, 3) float64
        Rotation about the vertical.
    """

    origin_m: Float
    half_range_m: Float
    ground_from_axes: Float


def polynomial_rows(u: Float, v: Float, degree: int = 2) -> Float:
    """The terms of a polynomial.

    Parameters
    ----------
    u, v : (n,) float64
        Centred and scaled.
    degree : int
        0, 1 or 2.

    Returns
    -------
    (n, 1), (n, 3) or (n, 5) float64
    """
    return np.stack([np.ones_like(u), u, v, u * u, u * v], axis=1)[:, : COUNT[degree]]


def strip_axes(points_m: Float, centres_m: Float) -> StripAxes:
    """Axes of a strip from its points and its projection centres.

    U is the principal direction of the projection centres in plan, from the first to the last.

    Parameters
    ----------
    points_m : (n, 3) float64, m
        On the ground, Z up.
    centres_m : (k, 3) float64, m
        Projection centres, in order along the strip.
    """
    plan = centres_m[:, :2] - centres_m[:, :2].mean(0)
    along = np.linalg.svd(plan, full_matrices=True)[2][0] if len(plan) > 1 else np.array([1.0, 0.0])
    along = along * (np.sign(along @ (centres_m[-1, :2] - centres_m[0, :2])) or 1.0)
    rotation = np.array([[along[0], -along[1], 0.0], [along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
    local = points_m @ rotation
    low, high = local[:, :2].min(0), local[:, :2].max(0)
    middle = np.append((low + high) / 2, local[:, 2].mean())
    half = np.maximum((high - low) / 2, 1e-6 * max(float((high - low).max()), 1e-3))
    return StripAxes(rotation @ middle, half, rotation)


def correction_design(axes: StripAxes, points_m: Float) -> Float:
    """Derivatives of the correction of ground points by the strip's 15 coefficients of second degree.

    The correction is expressed in the strip's axes and turned to the ground: dX = G (a'p, b'p, c'p), with the terms p
    of `polynomial_rows` and the coefficients a of dU, b of dV, c of dW, in this order.

    Parameters
    ----------
    points_m : (n, 3) float64, m

    Returns
    -------
    (n, 3, 15) float64
    """
    local = (points_m - axes.origin_m) @ axes.ground_from_axes
    rows = polynomial_rows(local[:, 0] / axes.half_range_m[0], local[:, 1] / axes.half_range_m[1])
    design = axes.ground_from_axes[None, :, :, None] * rows[:, None, None, :]
    return np.asarray(design.reshape(len(points_m), 3, 15))
