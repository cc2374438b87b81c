"""Radial lens distortion as a table of the calibration report: correction added outwards to the measured coordinate.

Linear between the entries; 0 at the symmetry point; beyond the last entry its correction stays. Radii are from the
symmetry point, and outwards is away from it.
"""

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.errors import InputError


def table_correction(
    xy_mm: Float, radius_mm: Float, correction_mm: Float, symmetry_point_mm: npt.ArrayLike = (0.0, 0.0)
) -> Float:
    """Correction to add to the measured photo coordinates.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
    radius_mm, correction_mm : (m,) float64, mm
        The table, radii from the symmetry point, ascending.
    symmetry_point_mm : (2,) float64, mm, from the principal point

    Returns
    -------
    (n, 2) float64, mm

    Raises
    ------
    InputError
        If the table is empty, its radii do not ascend, or its correction folds the image.
    """
    nodes, values = _checked(radius_mm, correction_mm)
    offset = xy_mm - np.asarray(symmetry_point_mm)
    r = np.sqrt((offset**2).sum(axis=1))
    outwards = np.interp(r, nodes, values)
    return np.asarray(offset * np.divide(outwards, r, out=np.zeros_like(r), where=r > 0)[:, None])


def _checked(radius_mm: Float, correction_mm: Float) -> tuple[Float, Float]:
    nodes, values = np.asarray(radius_mm, dtype=np.float64), np.asarray(correction_mm, dtype=np.float64)
    if len(nodes) and nodes[0] > 0:
        nodes, values = np.concatenate([[0.0], nodes]), np.concatenate([[0.0], values])
    if len(nodes) < 2 or nodes[0] != 0 or (np.diff(nodes) <= 0).any():
        raise InputError(
            f"the distortion table has the radii {nodes.tolist()}", remedy="give at least one; they must ascend from 0"
        )
    if (np.diff(nodes + values) <= 0).any():
        raise InputError(
            "the distortion table folds the image: corrected radii do not ascend",
            remedy="corrections are in micrometres, added outwards to the measured coordinate",
        )
    return nodes, values
