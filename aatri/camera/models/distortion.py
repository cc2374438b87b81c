"""Lens distortion: from measured photo coordinates to those of a perfect central projection.

`brown` and `table` are corrections added to the measured coordinate; `dbat3` is brown without b1 and b2 at
((1 + as) x, y): the aspect comes first. `opencv`, `polynomial`, `fisheye` and `bal` are forward models, ideal to
distorted, in normalised coordinates: the measured coordinate divided by c is the distorted one, and is inverted by
iteration. Their origin is the principal point; the v axis of the first two points down, the photo's y axis up.

Radial lens distortion as a table of the calibration report: correction added outwards to the measured coordinate.

Linear between the entries; 0 at the symmetry point; beyond the last entry its correction stays. Radii are from the
symmetry point, and outwards is away from it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.camera.models import forward_models
from aatri.camera.models.brown import PARAMETERS as BROWN_PARAMETERS
from aatri.camera.models.brown import brown_correction, brown_derivative
from aatri.camera.models.inversion import first_folded, invert
from aatri.errors import InputError
from aatri.ids import did_you_mean

MODELS = ("none", "brown", "table", "opencv", "polynomial", "fisheye", "bal", "dbat3")
"""The models of distortion."""

ASPECT = "as"
"""What the pixels are wider than high, in `dbat3`."""


@dataclass(frozen=True)
class Distortion:
    """Lens distortion of one camera."""

    model: str
    """One of `MODELS`."""
    principal_distance_mm: float
    parameters: Mapping[str, float] = field(default_factory=dict)
    """Values by the names of the model."""
    symmetry_point_mm: tuple[float, float] = (0.0, 0.0)
    """(2,) float, mm, from the principal point."""
    radius_mm: Float = field(default_factory=lambda: np.zeros(0))
    correction_mm: Float = field(default_factory=lambda: np.zeros(0))
    """(m,), mm. The table of the model `table`."""


def corrected(distortion: Distortion, xy_mm: Float) -> Float:
    """Photo coordinates freed from lens distortion.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
        Measured.

    Returns
    -------
    (n, 2) float64, mm, from the principal point

    Raises
    ------
    InputError
        If the model or a parameter is unknown, or the model folds at one of the points.
    ConvergenceError
        If a forward model cannot be inverted.
    """
    _check_names(distortion)
    if distortion.model == "none":
        return xy_mm.copy()
    if distortion.model == "dbat3":
        others = {name: value for name, value in distortion.parameters.items() if name != ASPECT}
        square = xy_mm * np.array([1.0 + distortion.parameters.get(ASPECT, 0.0), 1.0])
        return corrected(replace(distortion, model="brown", parameters=others), square)
    if distortion.model == "brown":
        _refuse_folded_brown(distortion, xy_mm)
        return np.asarray(xy_mm + brown_correction(xy_mm, distortion.parameters, distortion.symmetry_point_mm))
    if distortion.model == "table":
        table = (distortion.radius_mm, distortion.correction_mm)
        return np.asarray(xy_mm + table_correction(xy_mm, *table, distortion.symmetry_point_mm))
    forward = forward_models.MODELS[distortion.model]
    c = distortion.principal_distance_mm
    y_down = np.array([1.0, -1.0])
    distorted = xy_mm * y_down / c
    ideal = invert(lambda uv: forward(uv, distortion.parameters), distorted, what=distortion.model)
    return np.asarray(ideal * y_down * c)


def corner_points(half_format_mm: Float) -> Float:
    """Points on the diagonals of the format, from the centre to the corners: where a distortion is checked.

    Parameters
    ----------
    half_format_mm : (2,) float64, mm

    Returns
    -------
    (84, 2) float64, mm
    """
    signs = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    steps = np.linspace(0.0, 1.0, 21)
    return np.asarray((steps[:, None, None] * signs * half_format_mm).reshape(-1, 2))


def _check_names(distortion: Distortion) -> None:
    parameters_of: dict[str, tuple[str, ...]] = {"none": (), "table": (), "brown": BROWN_PARAMETERS}
    parameters_of |= forward_models.PARAMETERS | {"dbat3": (ASPECT, *BROWN_PARAMETERS[:5])}
    if distortion.model not in parameters_of:
        raise InputError(
            f"distortion model {distortion.model!r} is unknown{did_you_mean(distortion.model, MODELS)}",
            remedy=f"one of {', '.join(MODELS)}",
        )
    names = parameters_of[distortion.model]
    for name, value in distortion.parameters.items():
        if name not in names:
            raise InputError(
                f"distortion model {distortion.model} has no parameter {name!r}{did_you_mean(name, names)}",
                remedy=f"its parameters are {', '.join(names)}" if names else "it has no parameters",
            )
        if not np.isfinite(value):
            raise InputError(f"distortion parameter {name} is {value}", remedy="give a number")


def _refuse_folded_brown(distortion: Distortion, xy_mm: Float) -> None:
    def derivative(xy: Float) -> Float:
        return np.asarray(np.eye(2) + brown_derivative(xy, distortion.parameters, distortion.symmetry_point_mm))

    row = first_folded(derivative, xy_mm)
    if row is not None:
        raise InputError(
            f"brown distortion folds inside the format, on the way to ({xy_mm[row, 0]:.3f}, {xy_mm[row, 1]:.3f}) mm",
            remedy="check k1 (mm^-2), k2 (mm^-4), k3 (mm^-6) and their sign: they are added to the measurement; or "
            "`format` and pixel size, if no image point lies so far out",
        )


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

    Examples
    --------
    >>> table_correction(np.array([[0.0, 60.0]]), np.array([0.0, 40.0, 80.0]), np.array([0.0, 0.002, 0.004])).round(9)
    array([[0.   , 0.003]])
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
