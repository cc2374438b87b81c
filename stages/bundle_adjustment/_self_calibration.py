"""Options of self-calibration, and the unknowns and tables that follow from them."""

from __future__ import annotations

from typing import Literal

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.bundle_problem import film_parameters
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.self_calibration import (
    additional_parameters,
    camera_parameters,
    classical_table,
    parameter_table,
)
from aatri.artifacts.solution import Parameters
from aatri.camera.parameters.brown import BROWN_CONRADY
from aatri.camera.parameters.catalogue import parameter_set
from aatri.camera.parameters.parameter_set import ParameterSet
from aatri.camera.parameters.parameter_set import chosen as only
from aatri.camera.parameters.user import user_set
from aatri.errors import SpecError
from aatri.observations.poses import ADDITIONAL
from aatri.orientation.bundle import AdjustedParameters
from aatri.orientation.bundle_input import ParameterRows
from aatri.plugin import Field, InputPath, Options


class SelfCalibration(Options):
    """A set of additional parameters."""

    set: Literal["brown_conrady", "brown21", "ebner12", "gruen44", "bauer3", "fourier", "legendre", "user"] = Field(
        description="set of parameters"
    )
    per: Literal["camera", "session", "image"] = Field("camera", description="what shares a set")
    sigma_um: float | None = Field(
        50.0, gt=0, description="a-priori standard deviation of each parameter at the border, um; null leaves them free"
    )
    interior: bool = Field(
        False, description="c, x0 and y0 too: sets free of the exterior orientation need them with observed positions"
    )
    remove: bool = Field(
        False, description="leave out what is not determined, not separable or not significant, and adjust again"
    )
    user: InputPath | None = Field(None, description="Python file with `names` and `basis(x_mm, y_mm)`, for set: user")


def chosen_set(wanted: SelfCalibration | None) -> ParameterSet | None:
    """The set of the options."""
    if wanted is None:
        return None
    if wanted.set == "user" and wanted.user is None:
        raise SpecError("self_calibration with set: user needs a file", remedy="user: my_parameters.py")
    if wanted.user is not None and wanted.set == "user":
        chosen = user_set(wanted.user.read_text(encoding="utf-8"), str(wanted.user))
    else:
        chosen = parameter_set(wanted.set)
    return _with_interior(chosen) if wanted.interior else chosen


def _with_interior(chosen: ParameterSet) -> ParameterSet:
    """The set and c, x0, y0 of brown_conrady."""
    if "c" in chosen.parameters or "a21" in chosen.parameters:
        raise SpecError(f"{chosen.name} has the interior orientation already", remedy="interior: false")
    interior = only(BROWN_CONRADY, ("c", "x0", "y0"))
    return ParameterSet(
        f"{chosen.name} and interior",
        interior.parameters + chosen.parameters,
        interior.units + chosen.units,
        lambda xy, scale: np.concatenate([interior.basis(xy, scale), chosen.basis(xy, scale)], axis=2),
        lambda scale: np.concatenate([interior.classical_factors(scale), chosen.classical_factors(scale)]),
    )


def parameters_of(
    block: Block, image_points: ImagePoints, film: bool, wanted: SelfCalibration | None, chosen: ParameterSet | None
) -> tuple[ParameterRows, ...]:
    """Unknowns beside poses and points: film corrections, additional parameters, parameters of camera models."""
    groups = [film_parameters(block, image_points)] if film else []
    if chosen is not None and wanted is not None:
        sigma_mm = None if wanted.sigma_um is None else 1e-3 * wanted.sigma_um
        groups.append(additional_parameters(block, image_points, chosen, wanted.per, sigma_mm))
    camera = camera_parameters(block, image_points)
    return (*groups, camera) if camera is not None else tuple(groups)


def table_of(
    block: Block, p: AdjustedParameters, wanted: SelfCalibration | None, chosen: ParameterSet | None
) -> Parameters:
    """Adjusted parameters as a table."""
    if p.given.group == ADDITIONAL and chosen is not None and wanted is not None:
        return classical_table(block, p, chosen, wanted.per)
    return parameter_table(p)
