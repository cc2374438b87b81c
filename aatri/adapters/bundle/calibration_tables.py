"""What a self-calibration leaves for the report and for other blocks: its sets and the image errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adapters.bundle.camera_parameters import Unit, Units, camera_scale, units_of
from aatri.adapters.bundle.set_parts import SetPart
from aatri.adapters.solution import stacked
from aatri.artifacts.block import Block
from aatri.artifacts.solution import CalibratedSets, ErrorFields
from aatri.camera.parameters.error_field import image_error_field
from aatri.camera.parameters.parameter_set import SetScale
from aatri.orientation.bundle.result import AdjustedParameters

GRID = 11
"""Grid points of an image-error field in each direction."""


@dataclass(frozen=True)
class CalibrationTables:
    """Tables of a Solution."""

    sets: CalibratedSets
    fields: ErrorFields


def calibration_tables(
    block: Block, adjusted: Sequence[AdjustedParameters], parts: Sequence[SetPart], name: str, interior: bool
) -> CalibrationTables:
    """Tables of adjusted additional parameters; parts per image have no fields.

    Parameters
    ----------
    adjusted : sequence of AdjustedParameters
        Of each part.
    name : str
        Of the set, as in the options.
    interior : bool
        Whether c, x0, y0 were put before the set.
    """
    sets, fields = [CalibratedSets.empty()], [ErrorFields.empty()]
    for a, part in zip(adjusted, parts):
        units = units_of(block, part.per)
        scales = [camera_scale(block, int(k)) for k in units.camera]
        sets.append(_sets(block, units, name, interior, part.per, len(part.parameters), scales))
        if part.per != "image":
            fields.append(_fields(units, a, part, scales))
    return CalibrationTables(stacked(sets), stacked(fields))


def _sets(
    block: Block, units: Units, name: str, interior: bool, per: Unit, parameters: int, scales: list[SetScale]
) -> CalibratedSets:
    n = len(units.id)
    return CalibratedSets(
        object=units.id,
        camera=block.cameras.id[units.camera],
        per=np.full(n, per),
        set=np.full(n, name),
        parameters=np.full(n, parameters, dtype=np.int32),
        interior=np.full(n, interior),
        principal_distance_mm=np.array([s.principal_distance_mm for s in scales]),
        principal_point_mm=block.cameras.principal_point_mm[units.camera],
        half_format_mm=np.array([s.half_format_mm for s in scales]).reshape(n, 2),
        base_mm=np.array([s.base_mm for s in scales]),
    )


def _fields(units: Units, adjusted: AdjustedParameters, part: SetPart, scales: list[SetScale]) -> ErrorFields:
    fields = [image_error_field(part.parameters, scale, adjusted.value[k], adjusted.covariance[k], GRID)
              for k, scale in enumerate(scales)]  # fmt: skip
    return ErrorFields(
        object=np.repeat(units.id, [len(f.xy_mm) for f in fields]),
        xy_mm=np.concatenate([f.xy_mm for f in fields]),
        error_um=1e3 * np.concatenate([f.error_mm for f in fields]),
        sigma_um=1e3 * np.concatenate([f.sigma_mm for f in fields]),
        shape_um=1e3 * np.concatenate([f.shape_mm for f in fields]),
    )
