"""Checks of fiducial marks against the camera: numbering, mirroring, scale.

The measured marks, brought to millimetres with x right and y up by the nominal pixel size and y direction, differ from
the calibrated ones by a motion and a film deformation of a few parts in a thousand. A scan may lie on its side, so
every rotation is in order; what is not:

- mirrored: the marks fit a similarity only with one axis reversed;
- scale: further than 2 % from nominal; 25.4 or 1000 tells which unit was meant;
- numbering: the marks fit with their numbers exchanged, but not as given. Marks and calibration, both reduced to their
  centroids (which no exchange of numbers moves), are compared under the four right-angle turns, without and with
  mirroring, each mark with its nearest.
"""

import numpy as np

from aatri.arrays import Float, Int

SCALE_TOLERANCE = 0.02
"""Largest difference from the nominal scale."""

MISFIT = 0.02
"""A residual above this share of the marks' extent is no measuring error but a wrong mark."""

KNOWN_SCALES = {
    25.4: "inches taken for millimetres",
    1 / 25.4: "millimetres taken for inches",
    1000.0: "metres taken for millimetres",
    1e-3: "micrometres taken for millimetres",
    10.0: "centimetres taken for millimetres",
}


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
            return f"the scale is {scale:.6g} instead of 1: {meaning}?"
    return f"the scale is {scale:.6g} instead of 1"


def is_misfit(residual_mm: Float, calibrated_mm: Float) -> bool:
    """Whether a residual is too large for a measuring error.

    Parameters
    ----------
    residual_mm, calibrated_mm : (m, 2) float64, mm
    """
    extent = float(np.ptp(calibrated_mm, axis=0).max())
    return bool(np.sqrt((residual_mm**2).sum(axis=1)).max() > MISFIT * extent)


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
        if len(set(nearest.tolist())) == len(nearest) and distance.min(axis=1).max() < 5 * MISFIT * extent:
            return np.asarray(nearest, dtype=np.int64)
    return None
