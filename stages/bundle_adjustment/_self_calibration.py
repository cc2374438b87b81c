"""Options of self-calibration, and the unknowns and tables that follow from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from aatri.adapters.bundle.bundle_input import film_parameters
from aatri.adapters.bundle.calibration import Calibration, calibrated_parameters, calibration_of
from aatri.adapters.bundle.calibration_tables import CalibrationTables, calibration_tables
from aatri.adapters.bundle.camera_parameters import (
    Unit,
    additional_parameters,
    camera_parameters,
    camera_scale,
    classical_table,
    parameter_table,
)
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Parameters, Solution
from aatri.camera.parameters.catalogue import holds_interior, parameter_set, with_interior
from aatri.camera.parameters.parameter_set import ParameterSet
from aatri.camera.parameters.user import user_set
from aatri.errors import SpecError
from aatri.formats.text.text_file import read_lines
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import ADDITIONAL
from aatri.orientation.bundle.result import AdjustedParameters
from aatri.plugin import CodePath, Field, Options


class SelfCalibration(Options):
    """A set of additional parameters."""

    set: Literal["brown_conrady", "brown21", "ebner12", "gruen44", "bauer3", "fourier", "legendre", "user"] = Field(
        description="set of parameters"
    )
    per: Literal["camera", "session", "image"] = Field("camera", description="what shares a set")
    sigma_um: float | None = Field(
        50.0, gt=0, description="a-priori standard deviation of each parameter at the border, um; null leaves them free"
    )
    interior: bool | None = Field(
        None,
        description="c, x0 and y0 before the set; null: where projection centres are observed and the set has none",
    )
    remove: bool = Field(
        False, description="leave out what is not determined, not separable or not significant, and adjust again"
    )
    user: CodePath | None = Field(
        None, description="Python file with `names` and `basis(x_mm, y_mm)`, for set: user; needs --local-plugins"
    )


@dataclass(frozen=True)
class ChosenSet:
    """The set of an adjustment; `calibration` weights it where another block has determined it."""

    name: str
    interior: bool
    per: Unit
    sigma_mm: float | None
    parameters: ParameterSet
    calibration: Calibration | None = None


def chosen_set(
    block: Block, wanted: SelfCalibration | None, observed_positions: bool, solution: Solution | None = None
) -> ChosenSet | None:
    """The set of the options, or of a finished block that calibrates this one."""
    if solution is not None:
        return _calibrated(wanted, calibration_of(solution))
    if wanted is None:
        return None
    chosen = _set_by_name(wanted.set, wanted)
    has_it = holds_interior(chosen, camera_scale(block, 0))
    if wanted.interior and has_it:
        raise SpecError(f"{chosen.name} has the interior orientation already", remedy="interior: false")
    interior = wanted.interior if wanted.interior is not None else observed_positions and not has_it
    sigma_mm = None if wanted.sigma_um is None else 1e-3 * wanted.sigma_um
    return ChosenSet(wanted.set, interior, wanted.per, sigma_mm, with_interior(chosen) if interior else chosen)


def _calibrated(wanted: SelfCalibration | None, calibration: Calibration) -> ChosenSet:
    if wanted is not None and (wanted.set, wanted.per) != (calibration.set, calibration.per):
        raise SpecError(
            f"self_calibration is {wanted.set} per {wanted.per}, the calibration {calibration.set} per "
            f"{calibration.per}",
            remedy="leave self_calibration out, or set it as in the block that calibrates",
        )
    if wanted is not None and wanted.remove:
        raise SpecError("self_calibration.remove with a calibration: its parameters are known", remedy="remove: false")
    chosen = _set_by_name(calibration.set, wanted)
    chosen = with_interior(chosen) if calibration.interior else chosen
    return ChosenSet(calibration.set, calibration.interior, calibration.per, None, chosen, calibration)


def _set_by_name(name: str, wanted: SelfCalibration | None) -> ParameterSet:
    if name != "user":
        return parameter_set(name)
    if wanted is None or wanted.user is None:
        raise SpecError("self_calibration with set: user needs a file", remedy="user: my_parameters.py")
    return user_set("\n".join(read_lines(wanted.user)), str(wanted.user))


def parameters_of(
    block: Block, image_points: ImagePoints, film: bool, chosen: ChosenSet | None
) -> tuple[ParameterRows, ...]:
    """Unknowns beside poses and points: film corrections, additional parameters, parameters of camera models."""
    groups = []
    if film and (corrections := film_parameters(block, image_points)) is not None:
        groups.append(corrections)
    if chosen is not None and chosen.calibration is not None:
        groups.append(calibrated_parameters(block, image_points, chosen.parameters, chosen.calibration))
    elif chosen is not None:
        groups.append(additional_parameters(block, image_points, chosen.parameters, chosen.per, chosen.sigma_mm))
    camera = camera_parameters(block, image_points)
    return (*groups, camera) if camera is not None else tuple(groups)


def tables_of(
    block: Block, adjusted: tuple[AdjustedParameters, ...], chosen: ChosenSet | None
) -> tuple[list[Parameters], CalibrationTables | None]:
    """Adjusted parameters as tables, and what a self-calibration leaves for reports and other blocks."""
    tables: list[Parameters] = []
    calibration = None
    for p in adjusted:
        if p.given.group != ADDITIONAL or chosen is None:
            tables.append(parameter_table(p))
            continue
        first = int(np.sum([len(t) for t in tables]))
        calibration = calibration_tables(
            block, p, chosen.parameters, chosen.name, chosen.interior, chosen.per, first_row=first
        )
        tables.append(classical_table(block, p, chosen.parameters, chosen.per))
    return tables, calibration
