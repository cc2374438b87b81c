"""What a self-calibration leaves for the report and for other blocks: its sets, their covariances, the image errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adapters.bundle.camera_parameters import Unit, Units, camera_scale, units_of
from aatri.artifacts.block import Block
from aatri.artifacts.solution import CalibratedSets, ErrorFields, ParameterCovariances
from aatri.camera.parameters.error_field import image_error_field
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale, classical
from aatri.orientation.bundle.result import AdjustedParameters

GRID = 11
"""Grid points of an image-error field in each direction."""


@dataclass(frozen=True)
class CalibrationTables:
    """Tables of a Solution."""

    sets: CalibratedSets
    covariances: ParameterCovariances
    fields: ErrorFields


def calibration_tables(
    block: Block, adjusted: AdjustedParameters, parameters: ParameterSet, name: str, interior: bool, per: Unit,
    first_row: int,
) -> CalibrationTables:  # fmt: skip
    """Tables of an adjusted group of additional parameters; sets per image have no covariances and fields.

    Parameters
    ----------
    name : str
        Of the set, as in the options.
    interior : bool
        Whether c, x0, y0 were put before the set.
    first_row : int
        Row of the group's first parameter in the table of parameters.
    """
    units = units_of(block, per)
    scales = [camera_scale(block, int(k)) for k in units.camera]
    if per == "image":
        covariances, fields = ParameterCovariances.empty(), ErrorFields.empty()
    else:
        covariances = _covariances(adjusted, parameters, scales, first_row)
        fields = _fields(units, adjusted, parameters, scales)
    return CalibrationTables(_sets(block, units, name, interior, per, scales), covariances, fields)


def _sets(block: Block, units: Units, name: str, interior: bool, per: Unit, scales: list[SetScale]) -> CalibratedSets:
    n = len(units.id)
    return CalibratedSets(
        object=units.id,
        camera=block.cameras.id[units.camera],
        per=np.full(n, per),
        set=np.full(n, name),
        interior=np.full(n, interior),
        principal_distance_mm=np.array([s.principal_distance_mm for s in scales]),
        principal_point_mm=block.cameras.principal_point_mm[units.camera],
        half_format_mm=np.array([s.half_format_mm for s in scales]).reshape(n, 2),
        base_mm=np.array([s.base_mm for s in scales]),
    )


def _covariances(
    adjusted: AdjustedParameters, parameters: ParameterSet, scales: list[SetScale], first_row: int
) -> ParameterCovariances:
    s = len(parameters)
    i, j = np.triu_indices(s)
    found = [classical(parameters, scale, adjusted.value[k], adjusted.covariance[k])[1][i, j]
             for k, scale in enumerate(scales)]  # fmt: skip
    start = first_row + s * np.repeat(np.arange(len(scales)), len(i))
    return ParameterCovariances(
        first=(start + np.tile(i, len(scales))).astype(np.int32),
        second=(start + np.tile(j, len(scales))).astype(np.int32),
        covariance=np.concatenate(found),
    )


def _fields(
    units: Units, adjusted: AdjustedParameters, parameters: ParameterSet, scales: list[SetScale]
) -> ErrorFields:
    fields = [image_error_field(parameters, scale, adjusted.value[k], adjusted.covariance[k], GRID)
              for k, scale in enumerate(scales)]  # fmt: skip
    return ErrorFields(
        object=np.repeat(units.id, [len(f.xy_mm) for f in fields]),
        xy_mm=np.concatenate([f.xy_mm for f in fields]),
        error_um=1e3 * np.concatenate([f.error_mm for f in fields]),
        sigma_um=1e3 * np.concatenate([f.sigma_mm for f in fields]),
        shape_um=1e3 * np.concatenate([f.shape_mm for f in fields]),
    )
