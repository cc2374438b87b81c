"""Least squares matching: a window of an image brought onto a template, with the standard deviation of its place.

    g(A u + p) + v = a t(u + s + B u) + b        unknowns: s, B (similarity: 2, affine: 4), gain a, offset b
    A <- A (I + B)^-1,   p <- p - A s            until s stands still

Gauss-Newton with the gradients of the template, which has less noise than the window; the window is resampled by cubic
splines. The residuals of neighbouring pixels are
not independent, because blur and resampling make them alike: the standard deviations are multiplied by `CORRELATED`.

Source: Ackermann 1984; Gruen 1985, South African Journal of Photogrammetry 14, 175.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

from aatri.arrays import Float

CORRELATED = 3.0
"""By this the standard deviations from residuals were too small, on real marks and rays of known place."""
SETTLED_PX = 1e-3
FAINTEST, LARGEST_CHANGE = 1e-3, 0.5
"""Contrast of the window by that of the template, of its whole range, and change of A, beyond which nothing matches."""
Model = Literal["similarity", "affine"]


@dataclass(frozen=True)
class Matched:
    """A place that matches a template."""

    xy_px: Float
    """(2,). Of the centre of the template, from the centre of the first pixel of the image."""
    sigma_px: Float
    """(2,)."""
    correlation: float
    linear: Float
    """(2, 2). A: pixels of the image by pixels of the template."""


def least_squares_match(
    image: Float,
    template: Float,
    start_px: Float,
    model: Model = "similarity",
    linear: Float | None = None,
    iterations: int = 20,
) -> Matched | None:
    """Match; None where it leaves the image or does not settle.

    Parameters
    ----------
    image, template : (h, w) float64
    start_px : (2,) float64, px
        Where the centre of the template is nearly.
    model : str
    linear : (2, 2) float64, optional
        Start of A.
    """
    rows, columns = template.shape
    at = np.indices(template.shape).reshape(2, -1)[::-1].T - [(columns - 1) / 2, (rows - 1) / 2]
    A, p = np.eye(2) if linear is None else np.array(linear, float), np.array(start_px, float)
    coefficients = spline_filter(np.asarray(image, float))
    D = np.column_stack([g.ravel() for g in np.gradient(template, axis=(1, 0))])
    if model == "similarity":
        shape = [(D * at).sum(axis=1), D[:, 1] * at[:, 0] - D[:, 0] * at[:, 1]]
    else:
        shape = [D[:, i] * at[:, j] for i in (0, 1) for j in (0, 1)]
    J = np.column_stack([*D.T, *shape, template.ravel(), np.ones(template.size)])
    try:
        Q = np.linalg.inv(J.T @ J)
    except np.linalg.LinAlgError:
        return None
    for _ in range(iterations):
        xy = at @ A.T + p
        if (xy < 0).any() or (xy > [image.shape[1] - 1, image.shape[0] - 1]).any():
            return None
        g = map_coordinates(coefficients, xy.T[::-1], order=3, prefilter=False)
        x = Q @ (J.T @ g)
        gain = x[-2]
        if abs(gain) < FAINTEST * np.ptp(g):
            return None
        d = x[:-2] / gain
        B = np.array([[d[2], -d[3]], [d[3], d[2]]]) if model == "similarity" else d[2:].reshape(2, 2)
        if np.linalg.norm(B) > LARGEST_CHANGE:
            return None
        A = A @ np.linalg.inv(np.eye(2) + B)
        p = p - A @ d[:2]
        if np.abs(d[:2]).max() < SETTLED_PX:
            v = J @ x - g
            variance = v @ v / (len(v) - J.shape[1]) / gain**2
            sigma = CORRELATED * np.sqrt(variance * np.diag(A @ Q[:2, :2] @ A.T))
            share = 1 - v @ v / max(float(((g - g.mean()) ** 2).sum()), 1e-12)
            return Matched(p, sigma, float(np.copysign(np.sqrt(max(0.0, share)), gain)), A)
    return None
