"""Interior orientation: from the measured system (comparator or pixel) to the photo system of the fiducial marks.

Affine transformation of each image, by weighted least squares over its fiducial marks:

    x = a0 u + a1 v + a2,   y = b0 u + b1 v + b2,   matrix = [[a0, a1, a2], [b0, b1, b2]]

(u, v) measured, (x, y) calibrated photo coordinates, mm. Residual v = transformed minus calibrated. With n marks the
redundancy is 2 n - 6. The standard deviations are those of the measurement on the image, in the measured axes; they
are turned into the photo axes by the transformation itself.

What the marks leave open is a small affine correction in the photo system, dx = d0 + d1 x + d2 y and
dy = d3 + d4 x + d5 y; its a-priori covariance is (B'P B)^-1 with B = [1, x, y] at the marks.

A gross error of one mark is tested by sqrt(v'R^-1 v / 2), R the cofactor matrix of its two whitened residuals. Four
marks leave a redundancy of 2: every mark then has the same test statistic, and the image can only be flagged as a
whole. With five marks in the corners and the centre two opposite corners cannot be told apart either: a mark is
rejected only where it is the one that explains the residuals, and where four remain.

Source: Kraus, Photogrammetry 1, sec. 3.2; Baarda 1968 for the test.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int

FEWEST_MARKS = 3
"""An affine transformation needs three marks that are not on one line."""

COLLINEAR = 1e-3
"""Marks count as on one line if they lie this near to it, as a share of their extent."""

ALIKE = 0.99
"""Two marks whose residuals correlate by more cannot be told apart."""


@dataclass(frozen=True)
class AffineFit:
    """Affine transformations of n images with up to m marks each.

    Attributes
    ----------
    matrix : (n, 2, 3) float64, 1 and mm
        Photo from measured; NaN where not determined.
    covariance : (n, 6, 6) float64, mm and 1
        A-priori covariance of d0 ... d5; NaN where not determined.
    sigma0 : (n,) float64
        NaN without redundancy.
    redundancy : (n,) int64
    residual_mm : (n, m, 2) float64
        Transformed minus calibrated, also of marks not used; NaN where there is no mark.
    gross_error_mm : (n, m, 2) float64
        Estimated error of the measured mark; NaN where uncontrolled.
    test : (n, m) float64
        Test statistic of the marks used, in standard deviations; NaN where uncontrolled.
    used : (n, m) bool
    determined : (n,) bool
    """

    matrix: Float
    covariance: Float
    sigma0: Float
    redundancy: Int
    residual_mm: Float
    gross_error_mm: Float
    test: Float
    used: Bool
    determined: Bool


def affine_from_fiducials(measured: Float, calibrated_mm: Float, sigma_mm: Float, used: Bool) -> AffineFit:
    """Affine transformations of many images at once.

    Parameters
    ----------
    measured : (n, m, 2) float64, mm or px
    calibrated_mm : (n, m, 2) float64, mm, photo system
    sigma_mm : (n, m, 2) float64, mm
        Standard deviations on the image, along the measured axes.
    used : (n, m) bool
        Marks to use; the rest of a row is padding.

    Returns
    -------
    AffineFit
    """
    uv = np.where(used[..., None], measured, 0.0)
    xy = np.where(used[..., None], calibrated_mm, 0.0)
    basis, reduce = _reduced_basis(uv, used)
    determined = _spread_in_two_directions(basis, used) & _spread_in_two_directions(_reduced_basis(xy, used)[0], used)
    first = _solve(basis, xy, np.repeat(used[..., None], 2, axis=2).astype(float), determined)[0]
    sigma_photo = _sigma_along_photo_axes(first, np.where(used[..., None], sigma_mm, 1.0))
    weight = np.where(used[..., None], 1.0 / sigma_photo**2, 0.0)
    solution, cofactor = _solve(basis, xy, weight, determined)
    matrix = np.where(determined[:, None, None], solution @ reduce, np.nan)

    residual = transform(matrix, measured) - calibrated_mm
    redundancy = np.where(determined, 2 * used.sum(axis=1) - 6, 0)
    squares = np.nansum(weight * np.where(used[..., None], residual, 0.0) ** 2, axis=(1, 2))
    sigma0 = np.where(redundancy > 0, np.sqrt(squares / np.maximum(redundancy, 1)), np.nan)
    leverage = weight * np.einsum("nmi,nkij,nmj->nmk", basis, cofactor, basis)
    gross_error, test = _test_of_marks(residual, sigma_photo, 1.0 - leverage, used, redundancy)
    covariance = _correction_covariance(xy, weight, determined)
    return AffineFit(matrix, covariance, sigma0, redundancy, residual, gross_error, test, used, determined)


def snooped_affine(
    measured: Float, calibrated_mm: Float, sigma_mm: Float, used: Bool, *, limit: float = 4.0
) -> AffineFit:
    """Affine transformations with rejection of gross errors, one mark of each image at a time.

    Parameters
    ----------
    measured, calibrated_mm, sigma_mm, used
        As for `affine_from_fiducials`.
    limit : float
        A mark with a larger test statistic is rejected if it can be located and four marks remain.

    Returns
    -------
    AffineFit
        `used` tells what was rejected.
    """
    use = used.copy()
    fit = affine_from_fiducials(measured, calibrated_mm, sigma_mm, use)
    while True:
        worst = _located_blunders(fit, calibrated_mm, limit)
        images = np.flatnonzero(worst >= 0)
        if not len(images):
            break
        use[images, worst[images]] = False
        fit = affine_from_fiducials(measured, calibrated_mm, sigma_mm, use)
    return fit


def transform(matrix: Float, uv: Float) -> Float:
    """Apply affine transformations: (..., 2, 3) to points (..., m, 2)."""
    return np.asarray(uv @ matrix[..., :2].swapaxes(-1, -2) + matrix[..., None, :, 2])


def _reduced_basis(points: Float, used: Bool) -> tuple[Float, Float]:
    """[1, u', v'] with u', v' centred and scaled, zero for unused marks; and the matrix that maps (u, v, 1) to it."""
    count = np.maximum(used.sum(axis=1), 1)
    centre = points.sum(axis=1) / count[:, None]
    shifted = np.where(used[..., None], points - centre[:, None], 0.0)
    scale = np.sqrt((shifted**2).sum(axis=(1, 2)) / count)
    scale = np.where(scale > 0, scale, 1.0)
    basis = np.concatenate([used[..., None].astype(float), shifted / scale[:, None, None]], axis=2)
    reduce = np.zeros((len(points), 3, 3))
    reduce[:, 0, 2] = 1.0
    reduce[:, 1, 0] = reduce[:, 2, 1] = 1.0 / scale
    reduce[:, 1:, 2] = -centre / scale[:, None]
    return basis, reduce


def _spread_in_two_directions(basis: Float, used: Bool) -> Bool:
    scatter = np.einsum("nmi,nmj->nij", basis[..., 1:], basis[..., 1:])
    values = np.linalg.eigvalsh(scatter)
    return np.asarray((used.sum(axis=1) >= FEWEST_MARKS) & (values[:, 0] > COLLINEAR**2 * values[:, 1]))


def _solve(basis: Float, xy: Float, weight: Float, determined: Bool) -> tuple[Float, Float]:
    """Parameters (n, 2, 3) in the reduced basis, and their cofactor matrices (n, 2, 3, 3)."""
    normal = np.einsum("nmi,nmk,nmj->nkij", basis, weight, basis)
    normal = np.where(determined[:, None, None, None], normal, np.eye(3))
    right = np.einsum("nmi,nmk,nmk->nki", basis, weight, xy)
    cofactor = np.linalg.inv(normal)
    return np.linalg.solve(normal, right[..., None])[..., 0], cofactor


def _sigma_along_photo_axes(parameters: Float, sigma_mm: Float) -> Float:
    """Turn standard deviations along the measured axes into the photo axes (correlation left out)."""
    squares = parameters[:, :, 1:] ** 2
    total = squares.sum(axis=2, keepdims=True)
    share = np.where(total > 0, squares / np.where(total > 0, total, 1.0), np.eye(2))
    return np.asarray(np.sqrt(np.einsum("nkj,nmj->nmk", share, sigma_mm**2)))


def _test_of_marks(
    residual: Float, sigma: Float, redundancy_number: Float, used: Bool, redundancy: Int
) -> tuple[Float, Float]:
    controlled = used & (redundancy > 0)[:, None] & (redundancy_number > 1e-6).all(axis=2)
    safe = np.where(controlled[..., None], redundancy_number, 1.0)
    gross_error = np.where(controlled[..., None], residual / safe, np.nan)
    test = np.sqrt(((residual / sigma) ** 2 / safe).sum(axis=2) / 2)
    return gross_error, np.where(controlled, test, np.nan)


def _correction_covariance(xy: Float, weight: Float, determined: Bool) -> Float:
    basis = np.concatenate([np.ones((*xy.shape[:2], 1)), xy], axis=2)
    normal = np.einsum("nmi,nmk,nmj->nkij", basis, weight, basis)
    cofactor = np.linalg.inv(np.where(determined[:, None, None, None], normal, np.eye(3)))
    covariance = np.zeros((len(xy), 6, 6))
    covariance[:, :3, :3], covariance[:, 3:, 3:] = cofactor[:, 0], cofactor[:, 1]
    return np.where(determined[:, None, None], covariance, np.nan)


def _located_blunders(fit: AffineFit, calibrated_mm: Float, limit: float) -> Int:
    """Per image the mark to reject, or -1: the largest test statistic, if no other mark explains it as well."""
    test = np.where(np.isnan(fit.test), -1.0, fit.test)
    worst = np.where((test.max(axis=1) > limit) & (fit.redundancy >= 4), test.argmax(axis=1), -1)
    for image in np.flatnonzero(worst >= 0):
        rows = np.flatnonzero(fit.used[image])
        correlation = residual_correlation(calibrated_mm[image, rows])[rows == worst[image]][0]
        if np.sum(np.abs(correlation) > ALIKE) > 1:
            worst[image] = -1
    return worst


def residual_correlation(calibrated_mm: Float) -> Float:
    """Correlation between the residuals of an affine transformation with marks at these places, equal weights.

    Parameters
    ----------
    calibrated_mm : (m, 2) float64, mm

    Returns
    -------
    (m, m) float64
    """
    basis = np.column_stack([np.ones(len(calibrated_mm)), calibrated_mm / np.abs(calibrated_mm).max()])
    projector = np.eye(len(basis)) - basis @ np.linalg.pinv(basis)
    scale = np.sqrt(np.maximum(np.diag(projector), 1e-12))
    return np.asarray(projector / np.outer(scale, scale))
