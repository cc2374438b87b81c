"""The centre of a mark: the point about which a picture looks the same when it is turned by half a circle.

    v(d) = f(p + d) - f(p - d),   sum w(d) v(d)^2 -> min,   w = exp(-2 |d|^2 / radius^2)

So crosses, dots, rings and crossings of black and white fields of any size have it, and no template is needed. p starts
where the correlation of f(p + d) and f(p - d) is largest among the pixels within the radius; Gauss-Newton does the
rest, with f by cubic splines. What looks the same only along an edge leaves p open and is no mark.

Where a fiducial mark lies in a scan, as other marks of it tell: z = a w + b, a similarity of complex numbers.

w is the calibrated place or, as y counts down in the scan, its conjugate: a film lies in a scanner on either side. Two
marks fit both; then it is taken to lie the right way up.
"""

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

from aatri.arrays import Float
from aatri.measuring.limits import ALIKE_HALVES, ONE_DIRECTION

BORDER = 3
"""Pixels beyond what is compared, for splines and their derivatives."""
SETTLED_PX, MOST_STEPS = 1e-3, 20
HALVES = 2.0
"""Every pair of pixels is compared twice, so that the cofactors are half too small."""


def centre_of_symmetry(picture: Float, start_px: Float, radius_px: int) -> tuple[Float, Float] | None:
    """The centre of a mark and its standard deviation, each (2,), px; None where there is none.

    Parameters
    ----------
    picture : (n, n) float64
        At least 2 radius_px + BORDER pixels on all sides of the start.
    start_px : (2,) float64, px
        x, y from the centre of the first pixel.
    radius_px : int
        Of the mark, and about the start within which its centre is looked for.
    """
    side = np.arange(-radius_px, radius_px + 1)
    d = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    d = d[(d**2).sum(axis=1) <= radius_px**2]
    w = np.exp(-2.0 * (d**2).sum(axis=1) / radius_px**2)
    first = np.round(start_px).astype(int)
    likeness = [
        _correlation(picture[tuple((first + c + d).T[::-1])], picture[tuple((first + c - d).T[::-1])], w) for c in d
    ]
    p = (first + d[int(np.argmax(likeness))]).astype(float)
    coefficients = spline_filter(picture)
    for _ in range(MOST_STEPS):
        if np.hypot(*(p - start_px)) > radius_px + 1.0:
            return None
        one, other = (_sampled(coefficients, p + sign * d) for sign in (1, -1))
        v, J = one[0] - other[0], one[1] - other[1]
        N = (w[:, None] * J).T @ J
        if not np.linalg.eigvalsh(N)[0] > ONE_DIRECTION * np.trace(N):
            return None
        step = -np.linalg.solve(N, (w * v) @ J)
        p = p + step
        if np.hypot(*step) < SETTLED_PX:
            if _correlation(one[0], other[0], w) < ALIKE_HALVES:
                return None
            variance = HALVES * (w * v) @ v / w.sum()
            return p, np.sqrt(variance * np.diag(np.linalg.inv(N)))
    return None


def _sampled(coefficients: Float, at: Float) -> tuple[Float, Float]:
    """Grey values (n,) and their derivatives (n, 2) to x and y, by central differences of half a pixel."""
    x, y = at.T
    f, right, left, below, above = (
        map_coordinates(coefficients, [y + j, x + i], order=3, prefilter=False)
        for i, j in ((0, 0), (0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5))
    )
    return f, np.stack([right - left, below - above], axis=1)


def _correlation(a: Float, b: Float, w: Float) -> float:
    """Weighted correlation of grey values; 0 where they are uniform."""
    a, b = a - w @ a / w.sum(), b - w @ b / w.sum()
    size = float(np.sqrt((w @ a**2) * (w @ b**2)))
    return float((w * a) @ b) / size if size > 0 else 0.0


def place_of_mark(film: complex, others: list[tuple[complex, complex]]) -> complex | None:
    """The place of a mark in the scan, px; None with fewer than two other marks.

    Parameters
    ----------
    film : complex
        Its calibrated place, mm, y up.
    others : list of (complex, complex)
        Calibrated places of other marks, and where they were measured, px, y down.
    """
    if len(others) < 2:
        return None
    w, z = np.array(others).T
    fits = []
    for side in (np.conj, np.asarray):
        A = np.column_stack([side(w), np.ones(len(w))])
        x = np.linalg.lstsq(A, z, rcond=None)[0]
        fits.append((float(np.abs(A @ x - z).max()), complex(x[0] * side(film) + x[1])))
    upright, mirrored = fits
    return mirrored[1] if len(others) > 2 and mirrored[0] < upright[0] else upright[1]
