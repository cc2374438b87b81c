"""Additional parameters that another block has determined, values and covariance: the test field of the textbook.

They are written in their classical units; with the scale of their camera they are the lengths in mm that an adjustment
works with. They correct the nominal camera, which must be the same in both blocks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.bundle.camera_parameters import Unit, Units, additional_parameters, camera_scale, units_of
from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale, correction
from aatri.errors import InputError
from aatri.ids import shown
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import ADDITIONAL

_SAME = 1e-6
"""Nominal values and formats of two blocks are the same within this, mm."""


@dataclass(frozen=True)
class Calibration:
    """Sets of additional parameters of another block.

    Attributes
    ----------
    set : str
    interior : bool
    per : str
    ids : (n,) str
        Cameras, or sessions of cameras.
    names : tuple of str
        The s parameters.
    scale : tuple of SetScale
    principal_point_mm : (n, 2) float64, mm
    classical : (n, s) float64
        Values in their classical units.
    classical_covariance : (n, s, s) float64
        NaN where the block was adjusted without standard deviations.
    """

    set: str
    interior: bool
    per: Unit
    ids: Text
    names: tuple[str, ...]
    scale: tuple[SetScale, ...]
    principal_point_mm: Float
    classical: Float
    classical_covariance: Float

    def in_mm(self, parameters: ParameterSet, unit: int) -> tuple[Float, Float]:
        """Values (s,) and covariance (s, s) of a unit as lengths, mm."""
        factors = parameters.classical_factors(self.scale[unit])
        return self.classical[unit] / factors, self.classical_covariance[unit] / np.outer(factors, factors)


def calibration_of(solution: Solution) -> Calibration:
    """Additional parameters of a finished adjustment, for another block.

    Raises
    ------
    InputError
        If it has none, or has them per image.
    """
    sets, covariances, p = solution.calibrated_sets, solution.parameter_covariances, solution.parameters
    if sets is None or covariances is None or not len(sets):
        raise InputError("the solution given as calibration has no additional parameters",
                         remedy="give one of bundle_adjustment with self_calibration")  # fmt: skip
    if sets.per[0] == "image":
        raise InputError("additional parameters per image belong to those images: they calibrate nothing else",
                         remedy="adjust the test field with `per: camera`")  # fmt: skip
    mine = np.flatnonzero(p.group == ADDITIONAL)
    n = len(sets)
    s = len(mine) // n
    start = mine[0] if len(mine) else 0
    covariance = np.full((n, s, s), np.nan)
    unit, i = np.divmod(covariances.first - start, s)
    j = (covariances.second - start) % s
    covariance[unit, i, j] = covariance[unit, j, i] = covariances.covariance
    scales = tuple(SetScale(float(c), (float(w), float(h)), float(b))
                   for c, (w, h), b in zip(sets.principal_distance_mm, sets.half_format_mm, sets.base_mm))  # fmt: skip
    per: Unit = "camera" if sets.per[0] == "camera" else "session"
    return Calibration(str(sets.set[0]), bool(sets.interior[0]), per, sets.object, tuple(p.name[mine[:s]].tolist()),
                       scales, sets.principal_point_mm, p.value[mine].reshape(n, s), covariance)  # fmt: skip


def calibrated_units(block: Block, calibration: Calibration) -> tuple[Units, Int]:
    """Units of a block and their rows in a calibration of the same cameras.

    Raises
    ------
    InputError
        If a camera or session was not calibrated, or its nominal values are others than in the test field.
    """
    units = units_of(block, calibration.per)
    row = {str(name): k for k, name in enumerate(calibration.ids)}
    missing = [name for name in units.id if str(name) not in row]
    if missing:
        raise InputError(
            f"the calibration does not have {shown(missing)}",
            where=f"block {block.name}",
            remedy=f"it has {shown(calibration.ids)}; ids of cameras must agree in both blocks",
        )
    rows = np.array([row[str(name)] for name in units.id], dtype=np.int64)
    for name, camera, k in zip(units.id, units.camera, rows):
        mine, theirs = camera_scale(block, int(camera)), calibration.scale[k]
        point = block.cameras.principal_point_mm[camera]
        here = np.array([mine.principal_distance_mm, *point, *mine.half_format_mm])
        there = np.array([theirs.principal_distance_mm, *calibration.principal_point_mm[k], *theirs.half_format_mm])
        if not np.allclose(here, there, rtol=0.0, atol=_SAME):
            raise InputError(
                f"{name} has other nominal values than in the calibration: c, x0, y0, half format "
                f"{_numbers(here)} mm, there {_numbers(there)} mm",
                where=f"block {block.name}",
                remedy="additional parameters correct the nominal camera: give both blocks the same one",
            )
    return units, rows


def calibrated_parameters(
    block: Block, image_points: ImagePoints, parameters: ParameterSet, calibration: Calibration
) -> ParameterRows:
    """Unknowns of a set of additional parameters, weighted by a calibration: its values, its whole covariance.

    Parameters of variance zero, those that were left out there, are held.

    Raises
    ------
    InputError
        If the calibration has no covariance, or is not of the cameras of the block.
    """
    rows = calibrated_units(block, calibration)[1]
    known = [calibration.in_mm(parameters, int(k)) for k in rows]
    value, covariance = (np.array(part) for part in zip(*known))
    if not np.isfinite(covariance).all():
        raise InputError("the solution given as calibration has no standard deviations",
                         remedy="adjust the test field with `standard_deviations: true`")  # fmt: skip
    free = additional_parameters(block, image_points, parameters, calibration.per, None)
    determined = np.einsum("nii->ni", covariance) > 0
    return replace(free, start=value, prior=value, covariance=covariance, free=determined, weighted=determined)


def calibrated_correction(
    block: Block, image_points: ImagePoints, parameters: ParameterSet, calibration: Calibration
) -> Float:
    """Correction K p of all measurements by a calibration, (n, 2) float64, mm; NaN where there is no measurement.

    Raises
    ------
    InputError
        If the calibration is not of the cameras of the block.
    """
    units, rows = calibrated_units(block, calibration)
    xy, unit = image_points.measurements.xy_mm, units.of_image[image_points.measurements.image]
    found = np.full(xy.shape, np.nan)
    for k, row in enumerate(rows):
        mine = unit == k
        scale, (value, _) = calibration.scale[row], calibration.in_mm(parameters, int(row))
        found[mine] = correction(parameters, scale, value, xy[mine])
    return found


def _numbers(values: Float) -> str:
    return ", ".join(f"{v:.4f}" for v in values)
