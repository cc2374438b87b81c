"""Options of self-calibration, and the unknowns and tables that follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from pydantic import field_validator

from aatri.adapters.cameras.calibration import (
    Calibration,
    calibrated_cameras,
    calibrated_parameters,
    calibration_of,
    has_camera_models,
)
from aatri.adapters.cameras.image_parameters import film_parameters
from aatri.adapters.cameras.tables import ParameterTables, parameter_tables
from aatri.adapters.cameras.unknowns import (
    SHARINGS,
    SetPart,
    Sharing,
    additional_parameters,
    camera_parameters,
    camera_scale,
    names_of_parts,
    parts_of_set,
)
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.camera.parameters.catalogue import INTERIOR, SETS, holds_interior, parameter_set, with_interior
from aatri.camera.parameters.parameter_set import ParameterSet
from aatri.camera.parameters.user import user_set
from aatri.errors import SpecError
from aatri.formats.text.text_file import read_lines
from aatri.ids import did_you_mean
from aatri.notes import Note
from aatri.observations.parameters import ParameterRows
from aatri.orientation.bundle.result import BundleResult
from aatri.plugin import CodePath, Field, Options

if TYPE_CHECKING:
    SetName = str
else:
    SetName = Literal[(*SETS, "user")]  # those of the catalogue: a set that comes in there is an option at once


class SelfCalibration(Options):
    """A set of additional parameters."""

    set: SetName = Field(description="set of parameters")
    per: Sharing | dict[Sharing, list[str]] = Field(
        "camera",
        description="what shares a set: camera, flight, session, image; or which of its parameters each of them shares",
    )
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
    balance_radius_mm: float | None = Field(
        None,
        gt=0,
        description="r0 of aicon and bauer3, mm, where the radial terms vanish; null: 2/3 of half the "
        "diagonal (aicon), or orthogonal to c over the format (bauer3)",
    )
    orders: tuple[int, int] | None = Field(
        None, description="orders in x and y of fourier (null: 1, 1), degrees of legendre (null: 4, 4)"
    )
    user: CodePath | None = Field(
        None, description="Python file with `names` and `basis(x_mm, y_mm)`, for set: user; needs --local-plugins"
    )

    @field_validator("per", mode="before")
    @classmethod
    def _units(cls, value: object) -> object:
        requested = (
            f"one of {', '.join(SHARINGS)}, or a mapping from them to names: {{camera: [k1, k2], image: [x0, y0]}}"
        )
        if isinstance(value, Mapping):
            unknown = [str(unit) for unit in value if unit not in SHARINGS]
            if unknown:
                raise ValueError(f"{unknown[0]} shares no parameters{did_you_mean(unknown[0], SHARINGS)}: {requested}")
            if not all(isinstance(names, list) for names in value.values()):
                raise ValueError(f"names stand in a list: {requested}")
        elif value not in SHARINGS:
            raise ValueError(f"{value} shares no parameters{did_you_mean(str(value), SHARINGS)}: {requested}")
        return value


def units_named(requested: SelfCalibration | None) -> tuple[str, ...]:
    """What the options say to share parameters."""
    if requested is None:
        return ()
    return (requested.per,) if isinstance(requested.per, str) else tuple(requested.per)


@dataclass(frozen=True)
class ChosenSet:
    """The set of an adjustment in its parts; `calibration` weights those that another block has determined.

    `unnamed` are the parameters of the set that `per` does not name.
    """

    name: str
    interior: bool
    sigma_mm: float | None
    parts: tuple[SetPart, ...]
    calibration: Calibration | None = None
    unnamed: tuple[str, ...] = ()


def chosen_set(
    block: Block, requested: SelfCalibration | None, observed_positions: bool, solution: Solution | None = None
) -> ChosenSet | None:
    """The set of the options, or of a finished block that calibrates this one."""
    if solution is not None and (solution.calibrated_sets is not None or not has_camera_models(solution)):
        return _calibrated(requested, calibration_of(solution))
    if requested is None:
        return None
    chosen = _wanted_set(requested)
    has_it = holds_interior(chosen, camera_scale(block, 0))
    if requested.interior and has_it:
        raise SpecError(f"{chosen.name} has the interior orientation already", remedy="interior: false")
    if isinstance(requested.per, str):
        interior = requested.interior if requested.interior is not None else observed_positions and not has_it
    else:
        in_parts = {name for names in requested.per.values() for name in names}
        interior = not has_it and bool(in_parts & set(INTERIOR.parameters))
    full = with_interior(chosen) if interior else chosen
    parts = parts_of_set(full, requested.per)
    in_parts = {name for part in parts for name in part.parameters.parameters}
    unnamed = tuple(name for name in full.parameters if name not in in_parts)
    return ChosenSet(chosen.name, interior, _sigma_mm(requested), parts, unnamed=unnamed)


def _sigma_mm(requested: SelfCalibration) -> float | None:
    return None if requested.sigma_um is None else 1e-3 * requested.sigma_um


def _calibrated(requested: SelfCalibration | None, calibration: Calibration) -> ChosenSet:
    if calibration.set == "user":
        chosen = _wanted_set(
            requested if requested is not None and requested.set == "user" else SelfCalibration(set="user")
        )
    else:
        chosen = parameter_set(calibration.set)
    chosen = with_interior(chosen) if calibration.interior else chosen
    parts = parts_of_set(chosen, calibration.per)
    if requested is not None:
        same = _wanted_set(requested).name == calibration.set
        of_set = names_of_parts(parts_of_set(chosen, requested.per)) if same else ""
        if of_set != names_of_parts(parts):
            per = of_set or (f"per {requested.per}" if isinstance(requested.per, str) else str(requested.per))
            raise SpecError(
                f"self_calibration is {requested.set} {per}, the calibration {calibration.set} {names_of_parts(parts)}",
                remedy="leave self_calibration out, or set it as in the block that calibrates",
            )
    if requested is not None and requested.remove:
        raise SpecError("self_calibration.remove with a calibration: its parameters are known", remedy="remove: false")
    return ChosenSet(
        calibration.set,
        calibration.interior,
        _sigma_mm(requested or SelfCalibration(set="brown_conrady")),
        parts,
        calibration,
    )


def _wanted_set(requested: SelfCalibration) -> ParameterSet:
    if requested.set != "user":
        return parameter_set(requested.set, orders=requested.orders, balance_radius_mm=requested.balance_radius_mm)
    if requested.user is None:
        raise SpecError("self_calibration with set: user needs a file", remedy="user: my_parameters.py")
    return user_set("\n".join(read_lines(requested.user)), str(requested.user))


def parameters_of(
    block: Block,
    image_points: ImagePoints | None,
    film: bool,
    chosen: ChosenSet | None,
    solution: Solution | None = None,
) -> tuple[ParameterRows, ...]:
    """Unknowns beside poses and points: film corrections, additional parameters, parameters of camera models."""
    if image_points is None:
        return ()
    groups = []
    if film and (corrections := film_parameters(block, image_points)) is not None:
        groups.append(corrections)
    for k, part in enumerate(chosen.parts if chosen is not None else ()):
        assert chosen is not None
        if chosen.calibration is not None and part.per != "image":
            groups.append(calibrated_parameters(block, image_points, part, chosen.calibration.parts[k]))
        else:
            groups.append(
                additional_parameters(block, image_points, part.parameters, part.per, chosen.sigma_mm, part.group)
            )
    calibrated = solution is not None and has_camera_models(solution)
    camera = camera_parameters(block, image_points, calibrated=calibrated)
    if camera is not None and solution is not None and calibrated:
        camera = calibrated_cameras(block, camera, solution)
    return (*groups, camera) if camera is not None else tuple(groups)


def camera_tables(
    block: Block, result: BundleResult, chosen: ChosenSet | None
) -> tuple[ParameterTables, tuple[Note, ...]]:
    """Adjusted parameters with their covariances, and what is to be said of them."""
    if chosen is None:
        return parameter_tables(block, result)
    tables, notes = parameter_tables(block, result, chosen.parts, chosen.name, chosen.interior)
    notes = (*notes, *_units_without_names(block, chosen), *_left_out_by_name(chosen))
    if not {part.group for part in chosen.parts} & {p.given.group for p in result.parameters}:
        notes = (Note("warning", "`self_calibration`: there are no image points, so nothing is estimated"), *notes)
    return tables, notes


def _left_out_by_name(chosen: ChosenSet) -> list[Note]:
    """Parameters of the set that no unit of `per` names: not adjusted."""
    if not chosen.unnamed:
        return []
    return [
        Note(
            "note",
            f"self_calibration.per names no unit for some parameters of {chosen.name}, which stay zero: "
            f"{', '.join(chosen.unnamed)}",
        )
    ]


def _units_without_names(block: Block, chosen: ChosenSet) -> list[Note]:
    """Warnings of flights and sessions that the block does not name: then a camera is one."""
    names = {"flight": block.images.flight, "session": block.images.session}
    return [
        Note(
            "warning",
            f"`self_calibration`: no image has a {part.per} (images.csv): all images of a camera share "
            f"{', '.join(part.parameters.parameters)}",
        )
        for part in chosen.parts
        if part.per in names and not (names[part.per] != "").any()
    ]
