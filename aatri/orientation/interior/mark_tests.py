"""Test of single fiducial marks for gross errors, and whether the worst of them can be located.

    R_i = I - K_i N^-1 K_i',   gross error R_i^-1 v_i,   statistic sqrt(v_i' R_i^-1 v_i / 2)

with everything whitened. Two marks cannot be told apart where their residuals span the same space: the largest
canonical correlation of R_i^-1/2 R_ij R_j^-1/2 is near 1.

Source: Baarda 1968; Foerstner 1983 for the separability of two errors.

Marks are also held against the camera: numbering, mirroring, scale. The measured marks, brought to millimetres with x
right and y up by the nominal pixel size and y direction, differ from the calibrated ones by a motion and a film
deformation of a few parts in a thousand. A scan may lie on its side, so every rotation is in order; what is not:

- mirrored: the marks fit a similarity only with one axis reversed;
- scale: further than 2 % from nominal; 25.4 or 1000 tells which unit was meant;
- numbering: the marks fit with their numbers exchanged, but not as given. Marks and calibration, both reduced to their
  centroids (which no exchange of numbers moves), are compared under the four right-angle turns, without and with
  mirroring, each mark with its nearest.
"""

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.orientation.interior.limits import INSEPARABLE_MARKS, SCALE_TOLERANCE, UNCONTROLLED, WRONG_MARK

KNOWN_SCALES = {
    25.4: "inches taken for millimetres",
    1 / 25.4: "millimetres taken for inches",
    1000.0: "metres taken for millimetres",
    1e-3: "micrometres taken for millimetres",
    10.0: "centimetres taken for millimetres",
}


def tests_of_marks(
    K: Float, residual_mm: Float, root_weight: Float, used: Bool, redundancy: Int, determined: Bool
) -> tuple[Float, Bool]:
    """Tests of all marks of n images with up to m marks; NaN where uncontrolled.

    Parameters
    ----------
    K : (n, m, 2, k) float64
        Derivatives of the transformed marks to the parameters.
    residual_mm, root_weight : (n, m, 2) float64, mm and 1/mm
        Root weight 0 where a mark is not used.
    used : (n, m) bool
    redundancy : (n,) int64
    determined : (n,) bool

    Returns
    -------
    test : (n, m) float64
    separable : (n, m) bool
        No other mark explains the residuals as well.
    """
    n, m = used.shape
    design = K * root_weight[..., None]
    rows = design.reshape(n, 2 * m, K.shape[-1])
    q, _ = np.linalg.qr(np.where(determined[:, None, None], rows, 0.0))
    projector = -np.einsum("nai,nbi->nab", q, q)
    projector += np.eye(2 * m)
    blocks = projector.reshape(n, m, 2, m, 2).transpose(0, 1, 3, 2, 4)
    own = blocks[:, np.arange(m), np.arange(m)]
    values, vectors = np.linalg.eigh(own)
    controlled = used & determined[:, None] & (redundancy > 0)[:, None] & (values > UNCONTROLLED).all(axis=2)
    safe = np.where(controlled[..., None], np.maximum(values, UNCONTROLLED), 1.0)
    v = np.where(used[..., None], residual_mm * root_weight, 0.0)
    along = np.einsum("nmij,nmi->nmj", vectors, v)
    test = np.sqrt((along**2 / safe).sum(axis=2) / 2)
    root = np.einsum("nmij,nmj,nmkj->nmik", vectors, 1.0 / np.sqrt(safe), vectors)
    between = np.einsum("nmab,nmkbc,nkcd->nmkad", root, blocks, root)
    correlation = np.linalg.svd(between, compute_uv=False)[..., 0]
    both = controlled[:, :, None] & controlled[:, None, :] & ~np.eye(m, dtype=bool)
    separable = np.asarray(~(both & (correlation > INSEPARABLE_MARKS)).any(axis=2))
    return np.where(controlled, test, np.nan), separable


def located(test: Float, separable: Bool, redundancy: Int, limit: float) -> Int:
    """Per image the mark to reject, or -1: the largest test statistic, if no other mark explains it as well."""
    size = np.where(np.isnan(test), -1.0, test)
    worst = size.argmax(axis=1) if size.shape[1] else np.zeros(len(size), dtype=np.int64)
    rows = np.arange(len(size))
    good = (size[rows, worst] > limit) & (redundancy >= 4) & separable[rows, worst]
    return np.where(good, worst, -1)


def scale_problem(matrix_from_nominal: Float) -> str:
    """What is wrong with the scale of a transformation photo from nominal millimetres; empty if nothing.

    Parameters
    ----------
    matrix_from_nominal : (2, 2) float64
    """
    scale = float(np.sqrt(abs(np.linalg.det(matrix_from_nominal))))
    if abs(scale - 1.0) <= SCALE_TOLERANCE:
        return ""
    for usual, meaning in KNOWN_SCALES.items():
        if abs(scale / usual - 1.0) <= SCALE_TOLERANCE:
            return f"the scale is {usual:.3g} instead of 1: {meaning}?"
    return f"the scale is {scale:.3g} instead of 1"


def is_misfit(residual_mm: Float, calibrated_mm: Float) -> bool:
    """Whether a residual is too large for a measuring error.

    Parameters
    ----------
    residual_mm, calibrated_mm : (m, 2) float64, mm
    """
    extent = float(np.ptp(calibrated_mm, axis=0).max())
    return bool(np.sqrt((residual_mm**2).sum(axis=1)).max() > WRONG_MARK * extent)


def renumbering(nominal_mm: Float, calibrated_mm: Float) -> Int | None:
    """The numbering under which the marks fit, without mirroring.

    Parameters
    ----------
    nominal_mm : (m, 2) float64, mm
        Measured marks, y up, nominal scale, any origin.
    calibrated_mm : (m, 2) float64, mm
        Their calibrated coordinates, as numbered.

    Returns
    -------
    (m,) int64 or None
        Measured mark k is the mark of calibrated row `result[k]`; None if no exchange of numbers makes them fit.
    """
    measured = nominal_mm - nominal_mm.mean(axis=0)
    calibrated = calibrated_mm - calibrated_mm.mean(axis=0)
    extent = float(np.ptp(calibrated, axis=0).max())
    for quarter in range(4):
        turned = measured @ np.linalg.matrix_power(np.array([[0.0, 1.0], [-1.0, 0.0]]), quarter)
        distance = np.sqrt(((turned[:, None] - calibrated) ** 2).sum(axis=2))
        nearest = distance.argmin(axis=1)
        if len(set(nearest.tolist())) == len(nearest) and distance.min(axis=1).max() < 5 * WRONG_MARK * extent:
            return np.asarray(nearest, dtype=np.int64)
    return None
