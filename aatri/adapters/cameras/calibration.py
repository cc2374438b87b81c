"""Camera parameters that another block has determined, values and covariance: the test field of the textbook.

    v = p - p_calibration,    covariance that of the calibration, of all parameters of a camera together

Additional parameters are written in their classical units; with the scale of their camera they are the lengths in mm
that an adjustment works with. They correct the nominal camera, which must be the same in both blocks.
"""

from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.cameras.unknowns import (
    PRINCIPAL_POINT,
    Per,
    SetPart,
    Sharing,
    SharingUnits,
    additional_parameters,
    camera_scale,
    nominal_point_mm,
    parts_of_set,
    units_of,
)
from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import ParameterCovariances, Solution
from aatri.camera.limits import SAME_NOMINAL_MM
from aatri.camera.models.calibration import PARAMETERS
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale, correction
from aatri.errors import InputError
from aatri.ids import shown
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import ADDITIONAL, CAMERA


@dataclass(frozen=True)
class CalibratedPart:
    """Parameters of a set that share their unit, as another block has determined them."""

    per: Sharing
    ids: Text
    """(n,) str. Cameras, flights or sessions of cameras."""
    names: tuple[str, ...]
    """The s parameters."""
    scale: tuple[SetScale, ...]
    principal_point_mm: Float
    """(n, 2), mm."""
    classical: Float
    """(n, s). Values in their classical units."""
    classical_covariance: Float
    """(n, s, s). NaN where the block was adjusted without standard deviations."""

    def in_mm(self, parameters: ParameterSet, unit: int) -> tuple[Float, Float]:
        """Values (s,) and covariance (s, s) of a unit as lengths, mm."""
        factors = parameters.classical_factors(self.scale[unit])
        return self.classical[unit] / factors, self.classical_covariance[unit] / np.outer(factors, factors)


@dataclass(frozen=True)
class Calibration:
    """A set of additional parameters of another block, in parts by what shares them."""

    set: str
    interior: bool
    parts: tuple[CalibratedPart, ...]

    @property
    def per(self) -> Per:
        """As in the options."""
        if len(self.parts) == 1:
            return self.parts[0].per
        return {part.per: part.names for part in self.parts}


def calibration_of(solution: Solution) -> Calibration:
    """Additional parameters of a finished adjustment, for another block.

    Raises
    ------
    InputError
        If it has none, or has them all per image.
    """
    sets, covariances, p = solution.calibrated_sets, solution.parameter_covariances, solution.parameters
    if sets is None or covariances is None or not len(sets):
        raise InputError(
            "the solution given as calibration has no additional parameters",
            remedy="give one of bundle_adjustment with self_calibration",
        )
    if (sets.per == "image").all():
        raise InputError(
            "additional parameters per image belong to those images: they calibrate nothing else",
            remedy="adjust the test field with `per: camera`",
        )
    rows = np.split(np.flatnonzero(p.group == ADDITIONAL), np.cumsum(sets.parameters)[:-1])
    parts = []
    for per in dict.fromkeys(sets.per.tolist()):
        units = np.flatnonzero(sets.per == per)
        values = np.array([p.value[rows[k]] for k in units])
        covariance = np.array([_among(rows[k], covariances, np.nan) for k in units])
        scales = tuple(
            SetScale(float(sets.principal_distance_mm[k]), (float(w), float(h)), float(sets.base_mm[k]))
            for k, (w, h) in zip(units, sets.half_format_mm[units])
        )
        names, points = tuple(p.name[rows[units[0]]].tolist()), sets.principal_point_mm[units]
        parts.append(CalibratedPart(per, sets.object[units], names, scales, points, values, covariance))
    return Calibration(str(sets.set[0]), bool(sets.interior[0]), tuple(parts))


def calibrated_units(block: Block, calibration: CalibratedPart) -> tuple[SharingUnits, Int]:
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
        own, theirs = camera_scale(block, int(camera)), calibration.scale[k]
        point = block.cameras.principal_point_mm[camera]
        here = np.array([own.principal_distance_mm, *point, *own.half_format_mm])
        there = np.array([theirs.principal_distance_mm, *calibration.principal_point_mm[k], *theirs.half_format_mm])
        if not np.allclose(here, there, rtol=0.0, atol=SAME_NOMINAL_MM):
            raise InputError(
                f"{name} has other nominal values than in the calibration: c, x0, y0, half format "
                f"{_numbers(here)} mm, there {_numbers(there)} mm",
                where=f"block {block.name}",
                remedy="additional parameters correct the nominal camera: give both blocks the same one",
            )
    return units, rows


def calibrated_parameters(
    block: Block, image_points: ImagePoints, part: SetPart, calibration: CalibratedPart
) -> ParameterRows:
    """Unknowns of additional parameters, weighted by a calibration: its values, its whole covariance.

    Raises
    ------
    InputError
        If the calibration has no covariance, or is not of the cameras of the block.
    """
    rows = calibrated_units(block, calibration)[1]
    value, covariance = zip(*(calibration.in_mm(part.parameters, int(k)) for k in rows))
    free = additional_parameters(block, image_points, part.parameters, part.per, None, part.group)
    return _weighted(free, np.array(value), np.array(covariance))


def has_camera_models(solution: Solution) -> bool:
    """Whether a finished adjustment has estimated parameters of camera models."""
    p = solution.parameters
    return bool(((p.group == CAMERA) & (p.sigma != 0)).any())


def calibrated_cameras(block: Block, rows: ParameterRows, solution: Solution) -> ParameterRows:
    """Unknowns of camera models, weighted by a calibration: its values, its whole covariance.

    The adjustment has principal points from the nominal ones; the nominal points of the two blocks may differ.

    Parameters
    ----------
    rows : ParameterRows
        Of the cameras as the block has them.
    solution : Solution
        The calibration.

    Raises
    ------
    InputError
        If a camera is not in the calibration, has another model there, or the calibration has no covariances.
    """
    p = solution.parameters
    of_cameras = p.group == CAMERA
    missing = [name for name in rows.ids if not (of_cameras & (p.object == name)).any()]
    if missing:
        remedy = f"it has {shown(np.unique(p.object[of_cameras]))}; ids of cameras must agree in both blocks"
        raise InputError(f"the calibration does not have {shown(missing)}", where=f"block {block.name}", remedy=remedy)
    value, C = np.zeros_like(rows.start), np.zeros_like(rows.covariance)
    for k, (name, model) in enumerate(zip(rows.ids, rows.model)):
        at = np.flatnonzero(of_cameras & (p.object == name))
        names = PARAMETERS[model]
        if tuple(p.name[at].tolist()) != names:
            raise InputError(
                f"camera {name} has the parameters {', '.join(names)}, in the calibration {', '.join(p.name[at])}",
                where=f"block {block.name}",
                remedy="give the camera the distortion model of its calibration",
            )
        nominal = dict(zip(PRINCIPAL_POINT, nominal_point_mm(block.cameras, str(name)).tolist()))
        value[k, : len(at)] = p.value[at] - np.array([nominal.get(parameter, 0.0) for parameter in names])
        own = _among(at, solution.parameter_covariances, 0.0)
        unchanged = np.allclose(np.diag(own), p.sigma[at] ** 2, rtol=1e-6, atol=0.0)
        C[k, : len(at), : len(at)] = own if unchanged else np.nan
    return _weighted(rows, value, C)


def _weighted(rows: ParameterRows, value: Float, covariance: Float) -> ParameterRows:
    """Unknowns weighted by what another block has determined; what it has held, variance zero, is held."""
    if not np.isfinite(covariance).all():
        raise InputError(
            "the solution given as calibration has no standard deviations",
            remedy="adjust the test field with `standard_deviations: true`",
        )
    free = np.einsum("nii->ni", covariance) > 0
    return replace(rows, start=value, prior=value, covariance=covariance, free=free, weighted=free, calibrated=True)


def _among(rows: Int, covariances: ParameterCovariances | None, missing: float) -> Float:
    """Covariance matrix of some rows of the parameters, of which not every pair is told."""
    C = np.full((len(rows), len(rows)), missing)
    if covariances is not None:
        place = {int(row): k for k, row in enumerate(rows)}
        for k in np.flatnonzero(np.isin(covariances.first, rows) & np.isin(covariances.second, rows)):
            i, j = place[int(covariances.first[k])], place[int(covariances.second[k])]
            C[i, j] = C[j, i] = covariances.covariance[k]
    return C


def calibrated_correction(
    block: Block, image_points: ImagePoints, parameters: ParameterSet, calibration: Calibration
) -> Float:
    """Correction K p of all measurements by what a calibration tells of cameras, flights and sessions.

    Returns
    -------
    (n, 2) float64, mm
        NaN where there is no measurement.

    Raises
    ------
    InputError
        If the calibration is not of the cameras of the block.
    """
    xy = image_points.measurements.xy_mm
    total = np.where(np.isfinite(xy), 0.0, np.nan)
    for part, calibrated in zip(parts_of_set(parameters, calibration.per), calibration.parts):
        if part.per == "image":
            continue
        units, rows = calibrated_units(block, calibrated)
        unit = units.of_image[image_points.measurements.image]
        for k, row in enumerate(rows):
            of_unit, scale, (value, _) = unit == k, calibrated.scale[row], calibrated.in_mm(part.parameters, int(row))
            total[of_unit] += correction(part.parameters, scale, value, xy[of_unit])
    return total


def _numbers(values: Float) -> str:
    return ", ".join(f"{v:.4f}" for v in values)
