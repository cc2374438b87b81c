"""Interior orientation: from the measured system (comparator or pixel) to the photo system of the fiducial marks.

One transformation of the plane for each image (`geometry.plane_transformations`), by weighted least squares over its
marks. (u, v) measured, (x, y) calibrated photo coordinates, mm. Residual v = transformed minus calibrated. With n marks
and k parameters the redundancy is 2 n - k. The standard deviations are those of the measurement on the image, in the
measured axes; they are turned into the photo axes by the transformation itself. Similarity, affine and bilinear
transformations are linear in their parameters; the projective one starts from its linear form, denominator times x, and
is iterated.

What the marks leave open is a small correction K d in the photo system; its a-priori covariance is (K'P K)^-1, K at the
marks.

A gross error of one mark is tested by sqrt(v'R^-1 v / 2), R the cofactor matrix of its two whitened residuals. With a
redundancy of 2 (four marks, affine) every mark has the same test statistic, and the image can only be flagged as a
whole. With five marks in the corners and the centre two opposite corners cannot be told apart either: a mark is
rejected only where it is the one that explains the residuals, and where a redundancy of 2 remains.

Source: Kraus, Photogrammetry 1, sec. 3.2; Baarda 1968 for the test.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.plane_transformations import PARAMETERS, basis_of, open_basis, plane_jacobian, transform_plane
from aatri.orientation.interior.limits import ILL_PLACED
from aatri.orientation.interior.mark_tests import located, tests_of_marks

ITERATIONS = 10
"""Of the projective transformation; film converges in three."""


@dataclass(frozen=True)
class FiducialFit:
    """Transformations of n images with up to m marks each."""

    model: str
    """One of `PARAMETERS`."""
    matrix: Float
    """(n, 2, 3), mm per unit and mm."""
    terms: Float
    """(n, 2). Photo from measured, see `geometry.plane_transformations`; NaN where not determined."""
    photo_from_nominal: Float
    """(n, 2, 2). Linear part at the centroid of the marks, from nominal millimetres; NaN where not determined."""
    covariance: Float
    """(n, 8, 8), mm and 1. A-priori covariance of d0 ... d7; NaN where not determined."""
    sigma0: Float
    """(n,). NaN without redundancy."""
    redundancy: Int
    """(n,) int64."""
    residual_mm: Float
    """(n, m, 2). Transformed minus calibrated, also of marks not used; NaN where there is no mark."""
    test: Float
    """(n, m). Test statistic of the marks used, in standard deviations; NaN where uncontrolled."""
    separable: Bool
    """(n, m). No other mark explains the residuals as well as this one."""
    used: Bool
    """(n, m)."""
    determined: Bool
    """(n,)."""


def fewest_marks(model: str) -> int:
    """Marks that a transformation needs."""
    return PARAMETERS[model] // 2


def fit_fiducials(
    model: str, measured: Float, calibrated_mm: Float, sigma_mm: Float, used: Bool, nominal: Float | None = None
) -> FiducialFit:
    """Transformations of many images at once.

    Parameters
    ----------
    model : str
        One of `PARAMETERS`.
    measured : (n, m, 2) float64, mm or px
    calibrated_mm : (n, m, 2) float64, mm, photo system
    sigma_mm : (n, m, 2) float64, mm
        Standard deviations on the image, along the measured axes.
    used : (n, m) bool
        Marks to use; the rest of a row is padding.
    nominal : (n, 2) float64, mm per unit, optional
        Signed size of the measured units: times this, the measurement counts in mm, x right, y up.
    """
    size = np.ones((len(measured), 2)) if nominal is None else nominal
    k = PARAMETERS[model]
    uv = np.where(used[..., None], measured * size[:, None], 0.0)
    xy = np.where(used[..., None], calibrated_mm, 0.0)
    centre, scale = _centred(uv, used)
    p = np.where(used[..., None], (uv - centre[:, None]) / scale[:, None, None], 0.0)
    equal = np.repeat(used[..., None], 2, axis=2).astype(float)
    determined = (used.sum(axis=1) >= fewest_marks(model)) & _well_placed(_basis(model, p)[..., :k], equal)
    xy_centre, xy_scale = _centred(xy, used)
    spread = np.where(used[..., None], (xy - xy_centre[:, None]) / xy_scale[:, None, None], 0.0)
    determined &= _well_placed(_basis(model, spread)[..., :k], equal)
    turn = _solve(_basis("similarity", p)[..., :4], xy, equal, determined)
    sigma_photo = _sigma_along_photo_axes(turn, np.where(used[..., None], sigma_mm, 1.0))
    weight = np.where(used[..., None], 1.0 / sigma_photo**2, 0.0)
    d = _fitted(model, p, xy, weight, determined)
    matrix, terms = _of_measured(model, d, centre, scale, size)
    matrix = np.where(determined[:, None, None], matrix, np.nan)

    residual = transform_plane(model, matrix, terms, measured) - calibrated_mm
    redundancy = np.where(determined, 2 * used.sum(axis=1) - k, 0)
    squares = np.nansum(weight * np.where(used[..., None], residual, 0.0) ** 2, axis=(1, 2))
    sigma0 = np.where(redundancy > 0, np.sqrt(squares / np.maximum(redundancy, 1)), np.nan)
    at_centre = plane_jacobian(model, matrix, terms, (centre / size)[:, None])[:, 0] / size[:, None, :]
    linear = np.where(determined[:, None, None], at_centre, np.eye(2))
    K = open_basis(model, xy, linear[:, None])[..., :k]
    test, separable = tests_of_marks(K, residual, np.sqrt(weight), used, redundancy, determined)
    covariance = np.zeros((len(xy), 8, 8))
    covariance[:, :k, :k] = np.linalg.inv(_safe(_normal(K, weight), determined))
    covariance[~determined] = np.nan
    linear = np.where(determined[:, None, None], linear, np.nan)
    return FiducialFit(
        model,
        matrix,
        terms,
        linear,
        covariance,
        sigma0,
        redundancy,
        residual,
        test,
        separable,
        used,
        determined,
    )


def snooped_fiducials(
    model: str,
    measured: Float,
    calibrated_mm: Float,
    sigma_mm: Float,
    used: Bool,
    nominal: Float | None = None,
    *,
    limit: float = 4.0,
) -> FiducialFit:
    """Transformations with rejection of gross errors, one mark of each image at a time.

    Parameters
    ----------
    model, measured, calibrated_mm, sigma_mm, used, nominal
        As for `fit_fiducials`.
    limit : float
        A mark with a larger test statistic is rejected if it can be located and a redundancy of 2 remains.

    Returns
    -------
    FiducialFit
        `used` tells what was rejected.
    """
    use = used.copy()
    fit = fit_fiducials(model, measured, calibrated_mm, sigma_mm, use, nominal)
    while True:
        worst = located(fit.test, fit.separable, fit.redundancy, limit)
        images = np.flatnonzero(worst >= 0)
        if not len(images):
            break
        use[images, worst[images]] = False
        fit = fit_fiducials(model, measured, calibrated_mm, sigma_mm, use, nominal)
    return fit


def _centred(points: Float, used: Bool) -> tuple[Float, Float]:
    """Centroid (n, 2) and extent (n,) of the marks used."""
    count = np.maximum(used.sum(axis=1), 1)
    centre = points.sum(axis=1) / count[:, None]
    shifted = np.where(used[..., None], points - centre[:, None], 0.0)
    scale = np.sqrt((shifted**2).sum(axis=(1, 2)) / count)
    return centre, np.where(scale > 0, scale, 1.0)


def _basis(model: str, p: Float) -> Float:
    return basis_of(model, p[..., 0], p[..., 1], p[..., 0] * p[..., 1])


def _normal(basis: Float, weight: Float) -> Float:
    return np.asarray(np.einsum("nmki,nmk,nmkj->nij", basis, weight, basis))


def _safe(normal: Float, determined: Bool) -> Float:
    return np.where(determined[:, None, None], normal, np.eye(normal.shape[-1]))


def _well_placed(basis: Float, weight: Float) -> Bool:
    values = np.linalg.eigvalsh(_normal(basis, weight))
    return np.asarray(values[:, 0] > ILL_PLACED * values[:, -1])


def _solve(basis: Float, xy: Float, weight: Float, determined: Bool) -> Float:
    right = np.einsum("nmki,nmk,nmk->ni", basis, weight, xy)
    return np.asarray(np.linalg.solve(_safe(_normal(basis, weight), determined), right[..., None])[..., 0])


def _fitted(model: str, p: Float, xy: Float, weight: Float, determined: Bool) -> Float:
    """Parameters in the reduced system, (n, 8)."""
    d = np.zeros((len(p), 8))
    if model != "projective":
        basis = _basis(model, p)[..., : PARAMETERS[model]]
        d[:, : PARAMETERS[model]] = _solve(basis, xy, weight, determined)
        return d
    linear = _basis("affine", p)
    linear[..., 6:] = -xy[..., :, None] * p[..., None, :]
    d = _solve(linear, xy, weight, determined)
    for _ in range(ITERATIONS):
        w = 1.0 + np.einsum("nmi,ni->nm", p, d[:, 6:])
        computed = np.einsum("nmki,ni->nmk", _basis("affine", p)[..., :6], d[:, :6]) / w[..., None]
        J = _basis("affine", p)
        J[..., 6:] = -computed[..., :, None] * p[..., None, :]
        step = _solve(J / w[..., None, None], np.where(weight > 0, xy - computed, 0.0), weight, determined)
        d = d + step
        if np.abs(step).max(initial=0.0) < 1e-15 * np.abs(d).max(initial=1.0):
            break
    return d


def _of_measured(model: str, d: Float, centre: Float, scale: Float, size: Float) -> tuple[Float, Float]:
    """Matrix and terms of the measured coordinates from the parameters of the reduced ones."""
    reduce = np.zeros((len(d), 3, 3))
    reduce[:, 0, 0], reduce[:, 1, 1], reduce[:, 2, 2] = size[:, 0] / scale, size[:, 1] / scale, 1.0
    reduce[:, :2, 2] = -centre / scale[:, None]
    H = np.zeros((len(d), 3, 3))
    H[:, 2, 2] = 1.0
    if model == "similarity":
        H[:, 0] = np.stack([d[:, 1], -d[:, 2], d[:, 0]], axis=1)
        H[:, 1] = np.stack([d[:, 2], d[:, 1], d[:, 3]], axis=1)
    else:
        H[:, 0], H[:, 1] = d[:, [1, 2, 0]], d[:, [4, 5, 3]]
    if model == "projective":
        H[:, 2, :2] = d[:, 6:]
    H = H @ reduce
    if model == "projective":
        H = H / H[:, 2:, 2:]
        return H[:, :2], H[:, 2, :2]
    if model != "bilinear":
        return H[:, :2], np.zeros((len(d), 2))
    (a, c), (b, e) = (reduce[:, 0, 0], reduce[:, 0, 2]), (reduce[:, 1, 1], reduce[:, 1, 2])
    product = np.stack([a * e, b * c, c * e], axis=1)  # (a u + c) (b v + e) without its term in u v
    return H[:, :2] + d[:, 6:, None] * product[:, None], d[:, 6:] * (a * b)[:, None]


def _sigma_along_photo_axes(similarity: Float, sigma_mm: Float) -> Float:
    """Turn standard deviations along the measured axes into the photo axes (correlation left out)."""
    a, b = similarity[:, 1] ** 2, similarity[:, 2] ** 2
    total = np.where(a + b > 0, a + b, 1.0)
    cos, sin = np.where(a + b > 0, a / total, 1.0), b / total
    share = np.stack([np.stack([cos, sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)
    return np.asarray(np.sqrt(np.einsum("nkj,nmj->nmk", share, sigma_mm**2)))
