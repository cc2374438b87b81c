"""Least squares matching: a window of an image brought onto a template, with the standard deviation of its place.

    g(A u + p) + v = a t(u + s + B u) + b        unknowns: s, B (similarity: 2, affine: 4), gain a, offset b
    A <- A (I + B)^-1,   p <- p - A s            until s stands still

Gauss-Newton with the gradients of the template, which has less noise than the window; the window is resampled by cubic
splines. At the end Q = (J' K)^-1, K with the gradients of the resampled window, which tell how J' v changes with the
place: J' J would count the noise of gradients as detail, and differences of neighbours miss fine detail. Two things
make the residuals more than independent noise, and the standard deviations larger:

    C = Q (sum_l sum_i J_i v_i v_i+l J_i+l') Q   neighbouring pixels are alike: lags l of up to 2 px, of all directions
    C + c S, E(b_w b_w') = N_w S N_w + N0_w      relief within the patch is not affine: each of 3 x 3 parts has a shift
                                                 of its own, b_w = G_w' v_w, covariance S; N0_w: what noise alone gives

The centre of the patch is off the surface that fits the patch as its parts are; c = 1.45 for a curved one. S is weak of
one patch, and that of all patches of a pair of images, which see one relief from one base, is taken together.

Source: Ackermann 1984; Gruen 1985, South African Journal of Photogrammetry 14, 175; Conley, Journal of Econometrics 92
(1999) 1 (covariances of neighbours); Foerstner & Wrobel 2016, Photogrammetric Computer Vision (variance components).

Of the rays of one point every image point is brought onto the patch of the best one. The reference is the image point
with the median size of feature, or the most precise: its window is the template, and the windows of the others are
brought onto it by an affine transformation, gain and offset, from the turn and scale that two rays' orientations or
features say. A ray that correlates less than the limit, or moves farther than its standard deviation lets it, is not
measured anew.

Source: Gruen 1985, South African Journal of Photogrammetry 14, 175.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

from aatri.arrays import Float, Int
from aatri.artifacts.features import FoundMarks, ScanMarks
from aatri.pixels.limits import FAINTEST, LARGEST_CHANGE
from aatri.pixels.reading import Grey, check_content, grey_image

ALIKE_PX = 2
"""Largest distance, in x and in y, of pixels whose residuals are taken as alike: blur and resampling reach as far."""
PARTS = 3
"""Parts of a patch along each side."""
CURVED = 1.447
"""Variance of the centre by that of the parts, where curvature is the same in all directions: with E f_xx^2 = 3 k,
E f_xx f_yy = E f_xy^2 = k and half a side of 1, the centre lies off the mean by 2/9 k, the nine parts by 0.1536 k."""
SETTLED_PX = 1e-3
STEP_PX = 1e-3
"""Of the gradients of the resampled window."""
Model = Literal["similarity", "affine"]

AROUND = 2
"""Half side of the window that is searched, by that of the template."""


@dataclass(frozen=True)
class Matched:
    """A place that matches a template."""

    xy_px: Float
    """(2,). Of the centre of the template, from the centre of the first pixel of the image."""
    correlation: float
    linear: Float
    """(2, 2). A: pixels of the image by pixels of the template."""
    noise_px2: Float
    """(2, 2). Covariance of the place from noise alone, in the pixels of the template."""
    parts: tuple[Float, Float]
    """Sums (2, 2) and (4, 4) over its parts, of equal weight for every patch: what exceeds noise, and by which S is."""

    def sigma_px(self, shifts_px2: Float, share: float = 1.0) -> Float:
        """Standard deviations (2,) by the covariance (2, 2) of the shifts of parts and a share of the noise."""
        covariance = share * self.noise_px2 + CURVED * shifts_px2
        return np.asarray(np.sqrt(np.diag(self.linear @ covariance @ self.linear.T)))


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
    linear : (2, 2) float64, optional
        Start of A.
    """
    rows, columns = template.shape
    at = np.indices(template.shape).reshape(2, -1)[::-1].T - [(columns - 1) / 2, (rows - 1) / 2]
    A, p = np.eye(2) if linear is None else np.array(linear, float), np.array(start_px, float)
    coefficients = spline_filter(np.asarray(image, float))
    J = _design(list(np.gradient(template, axis=(1, 0))), at, template, model)
    try:
        Q = np.linalg.inv(J.T @ J)
    except np.linalg.LinAlgError:
        return None

    def resampled(xy: Float) -> Float:
        return np.asarray(map_coordinates(coefficients, xy.T[::-1], order=3, prefilter=False))

    for _ in range(iterations):
        xy = at @ A.T + p
        if (xy < 0).any() or (xy > [image.shape[1] - 1, image.shape[0] - 1]).any():
            return None
        g = resampled(xy)
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
            share = 1 - float(v @ v) / max(float(((g - g.mean()) ** 2).sum()), 1e-12)
            seen = (g.reshape(template.shape) - x[-1]) / gain
            xy = at @ A.T + p
            D = [
                (resampled(xy + STEP_PX * A[:, k]) - resampled(xy - STEP_PX * A[:, k])) / (2 * STEP_PX * gain)
                for k in (0, 1)
            ]
            noise, parts = _covariances(v / gain, J, _design(D, at, seen, model), template.shape)
            return Matched(p, float(np.copysign(max(0.0, share) ** 0.5, gain)), A, noise, parts)
    return None


def _design(gradient: Sequence[Float], at: Float, picture: Float, model: Model) -> Float:
    """Derivatives of grey values to the unknowns, (n, 6 or 8)."""
    D = np.column_stack([g.ravel() for g in gradient])
    if model == "similarity":
        shape = [(D * at).sum(axis=1), D[:, 1] * at[:, 0] - D[:, 0] * at[:, 1]]
    else:
        shape = [D[:, i] * at[:, j] for i in (0, 1) for j in (0, 1)]
    return np.column_stack([*D.T, *shape, picture.ravel(), np.ones(picture.size)])


def _covariances(v: Float, J: Float, K: Float, shape: tuple[int, ...]) -> tuple[Float, tuple[Float, Float]]:
    """Covariance (2, 2) of the place from noise, and what the parts of the patch say of other shifts."""
    v = np.asarray(v * np.sqrt(len(v) / (len(v) - J.shape[1])))
    Q, variance, (rows, columns) = np.linalg.inv(J.T @ K), float(v @ v) / len(v), shape
    E = (v[:, None] * (J @ Q[:2].T)).reshape(rows, columns, 2)  # what each residual does to the place
    independent: Float = np.tensordot(E, E, ((0, 1), (0, 1)))
    C = independent.copy()
    for down in range(ALIKE_PX + 1):
        for right in range(-ALIKE_PX if down else 1, ALIKE_PX + 1):
            here = E[: rows - down, max(0, -right) : columns - max(0, right)]
            there = E[down:, max(0, right) : columns - max(0, -right)]
            of_lag = np.tensordot(here, there, ((0, 1), (0, 1)))
            C += of_lag + of_lag.T
    factor = max(1.0, float(np.trace(C) / np.trace(independent)))
    noise = factor * independent
    row, column = np.indices(shape).reshape(2, -1)
    part = row * PARTS // rows * PARTS + column * PARTS // columns
    excess, response = np.zeros((2, 2)), np.zeros((4, 4))
    for w in range(PARTS**2):
        G, J_w, K_w, v_w = J[part == w, :2], J[part == w], K[part == w], v[part == w]
        b, N, fitted = G.T @ v_w, G.T @ K_w[:, :2], G.T @ K_w @ Q @ J_w.T @ G
        excess += np.outer(b, b) - factor * ((G.T * v_w**2) @ G - variance * (fitted + fitted.T) / 2)
        response += np.kron(N, N)
    return noise, (excess / variance**2, response / variance**2)


def part_shifts(matched: Sequence[Matched]) -> Float:
    """Covariance S (2, 2) of the shifts of parts that patches have in common, px^2 of the template."""
    if not matched:
        return np.zeros((2, 2))
    excess, response = (np.sum([m.parts[k] for m in matched], axis=0) for k in (0, 1))
    S = np.linalg.lstsq(response, excess.ravel(), rcond=None)[0].reshape(2, 2)
    values, axes = np.linalg.eigh((S + S.T) / 2)
    return np.asarray(axes * np.maximum(values, 0) @ axes.T)


def matched_rays(left: str, right: str, contents: list[str], half_px: int, places: list[list[float]]) -> ScanMarks:
    """Image points of the right image by the patches of the left one, then as many of the left one.

    Parameters
    ----------
    left, right : str
        Files.
    contents : list of str
        SHA-256 that the block has of both.
    half_px : int
        Half side of a patch.
    places : list of 8 float
        x, y in the left image, x, y nearly in the right one, px from the centre of the first; and the linear map
        (row by row) of pixels of the left image to those of the right one.

    Raises
    ------
    InputError
        If a file is not the one that the block was made with.
    """
    for path, content in zip((left, right), contents):
        check_content(content, path)
    a, b = grey_image(left), grey_image(right)
    rays = [_ray(a, b, half_px, np.array(place)) for place in places]
    shifts_px2 = part_shifts([match for match, _ in filter(None, rays)])
    half, lost = 0.5, (np.nan, np.nan, np.nan, np.nan, 0.0)
    rows = [(*ray[1], *ray[0].sigma_px(shifts_px2, half), ray[0].correlation) if ray else lost for ray in rays]
    rows += [
        (*place[:2], *np.sqrt(half * np.diag(ray[0].noise_px2)), ray[0].correlation) if ray else lost
        for place, ray in zip(places, rays)
    ]
    table = np.array(rows).reshape(-1, 5)
    return ScanMarks(
        width_px=b.shape[1],
        height_px=b.shape[0],
        marks=FoundMarks(
            xy_px=table[:, :2], sigma_px=table[:, 2:4], correlation=table[:, 4], second=np.zeros(len(table))
        ),
    )


def _ray(a: Grey, b: Grey, half: int, place: Float) -> tuple[Matched, Float] | None:
    """A match, and the place of the point by it."""
    from_a, near_b, linear = place[:2], place[2:4], place[4:].reshape(2, 2)
    template, centre = _patch(a, from_a, half + 1)
    if template is None:
        return None
    # the patch of the left image about the point itself: shifted by parts of a pixel on both sides alike
    offset = from_a - centre
    window, corner = _patch(b, near_b, AROUND * half)
    if window is None:
        return None
    reach = AROUND * half
    start = near_b - corner + reach - linear @ offset
    matched = least_squares_match(window, template[1:-1, 1:-1], start, "affine", linear)
    if matched is None:
        return None
    return matched, matched.xy_px + matched.linear @ offset + corner - reach


def _patch(image: Grey, centre: Float, half: int) -> tuple[Float | None, Int]:
    """The window about a whole pixel next to a place, and that pixel; None where it leaves the image."""
    at = np.round(centre).astype(np.int64)
    (x, y), (height, width) = at, image.shape
    if x < half or y < half or x + half >= width or y + half >= height:
        return None, at
    return image[y - half : y + half + 1, x - half : x + half + 1].astype(np.float64), at


def median_rows(point: Int, sigma: Float) -> Int:
    """Of each image point (n,) the row of that image point of its point which has the median standard deviation."""
    order = np.lexsort((sigma, point))
    ids, first, count = np.unique(point[order], return_index=True, return_counts=True)
    return np.asarray(order[first + (count - 1) // 2][np.searchsorted(ids, point)])


def medians_of_points(point: Int, sigma_px: Float, n_points: int) -> Float:
    """Median standard deviations (n_points, 2) of the image points (n, 2) of each point; NaN where there are none."""
    made = np.full((n_points, 2), np.nan)
    for axis in (0, 1):
        rows = median_rows(point, sigma_px[:, axis])
        made[point, axis] = sigma_px[rows, axis]
    return made
