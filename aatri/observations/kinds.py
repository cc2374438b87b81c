"""The kinds of observation there are, in the order of the tables of residuals. To add one: a file, and a line here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from pydantic import Field, create_model

from aatri.notes import Note
from aatri.observations.attitudes import USES as OF_ATTITUDES
from aatri.observations.attitudes import AttitudeOptions, attitudes
from aatri.observations.control import USES as OF_CONTROL
from aatri.observations.control import control
from aatri.observations.drift import USES as OF_DRIFT
from aatri.observations.drift import drift
from aatri.observations.geodetic.coordinate_differences import USES as OF_COORDINATE_DIFFERENCES
from aatri.observations.geodetic.coordinate_differences import coordinate_differences
from aatri.observations.geodetic.covariances import USES as OF_COVARIANCES
from aatri.observations.geodetic.covariances import with_geodetic_covariances
from aatri.observations.geodetic.directions import USES as OF_DIRECTIONS
from aatri.observations.geodetic.directions import directions
from aatri.observations.geodetic.distances import USES as OF_DISTANCES
from aatri.observations.geodetic.distances import DistanceOptions, distances
from aatri.observations.geodetic.height_differences import USES as OF_HEIGHT_DIFFERENCES
from aatri.observations.geodetic.height_differences import height_differences
from aatri.observations.geodetic.zenith_angles import USES as OF_ZENITH_ANGLES
from aatri.observations.geodetic.zenith_angles import ZenithOptions, zenith_angles
from aatri.observations.image_points import image_points
from aatri.observations.observed import Given, Observed
from aatri.observations.positions import USES as OF_POSITIONS
from aatri.observations.positions import PositionOptions, positions
from aatri.observations.relative.angles import USES as OF_RELATIVE_ANGLES
from aatri.observations.relative.angles import relative_angles
from aatri.observations.relative.differences import USES as OF_RELATIVE_DIFFERENCES
from aatri.observations.relative.differences import relative_differences
from aatri.observations.relative.distances import USES as OF_RELATIVE_DISTANCES
from aatri.observations.relative.distances import relative_distances
from aatri.observations.relative.lines import USES as OF_LINES
from aatri.observations.relative.lines import lines
from aatri.observations.relative.planes import USES as OF_PLANES
from aatri.observations.relative.planes import planes
from aatri.observations.relative.round_shapes import USES as OF_ROUND_SHAPES
from aatri.observations.relative.round_shapes import round_shapes
from aatri.observations.rigs import USES as OF_RIGS
from aatri.observations.rigs import RigOptions, rigs
from aatri.options import Options

if TYPE_CHECKING:
    from aatri.artifacts.block import Block


@dataclass(frozen=True)
class Kind:
    """A kind of observation.

    Attributes
    ----------
    observe : callable
        Takes it from a block.
    options : type of Options, optional
    under : str
        Name of its options, where it is not that of the function.
    uses : tuple of str
        What it uses of the block, by the names of `artifacts.offers`.
    """

    observe: Callable[..., tuple[Observed, ...]]
    options: type[Options] | None = None
    under: str = ""
    uses: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of its options."""
        return self.under or self.observe.__name__

    @property
    def about(self) -> str:
        """First line of its docstring, as description of its options."""
        first = (self.observe.__doc__ or "").splitlines()[0].rstrip(".")
        return first[:1].lower() + first[1:]


KINDS = (
    Kind(image_points),
    Kind(control, uses=OF_CONTROL),
    Kind(positions, PositionOptions, uses=OF_POSITIONS),
    Kind(drift, PositionOptions, under="positions", uses=OF_DRIFT),
    Kind(attitudes, AttitudeOptions, uses=OF_ATTITUDES),
    Kind(rigs, RigOptions, uses=OF_RIGS),
    Kind(distances, DistanceOptions, uses=OF_DISTANCES),
    Kind(directions, uses=OF_DIRECTIONS),
    Kind(zenith_angles, ZenithOptions, uses=OF_ZENITH_ANGLES),
    Kind(height_differences, uses=OF_HEIGHT_DIFFERENCES),
    Kind(coordinate_differences, uses=OF_COORDINATE_DIFFERENCES),
    Kind(relative_differences, uses=OF_RELATIVE_DIFFERENCES),
    Kind(relative_angles, uses=OF_RELATIVE_ANGLES),
    Kind(planes, uses=OF_PLANES),
    Kind(lines, uses=OF_LINES),
    Kind(round_shapes, uses=OF_ROUND_SHAPES),
    Kind(relative_distances, uses=OF_RELATIVE_DISTANCES),
)

USES = tuple(sorted({*OF_COVARIANCES, *(name for kind in KINDS for name in kind.uses)}))
"""What the kinds use of a block, also where their options set them aside: then the user has said so."""


def observe(given: Given, options: object) -> tuple[Observed, ...]:
    """All observations of a block; `options` has the options of each kind under its name."""
    found: list[Observed] = []
    for kind in KINDS:
        found += kind.observe(given, getattr(options, kind.name)) if kind.options else kind.observe(given)
    return with_geodetic_covariances(given.block, found)


def options_without_data(block: Block, options: Options) -> list[Note]:
    """Options of kinds that are set although the block offers nothing they are for."""
    offered, notes = {offer.name for offer in block.offers()}, []
    for name in dict.fromkeys(kind.name for kind in KINDS if kind.options):
        given = getattr(options, name)
        uses = {use for kind in KINDS if kind.name == name for use in kind.uses if not use.startswith("camera")}
        if given != type(given)() and getattr(given, "use", True) and not uses & offered:
            notes.append(Note("warning", f"{name}: options are set, but the block has none of them"))
    return notes


T = TypeVar("T", bound=Options)


def with_kinds(model: type[T]) -> type[T]:
    """The options of a stage that adjusts, with those of all kinds under their names."""
    fields: dict[str, Any] = {}
    for kind in KINDS:
        if kind.options is not None and kind.name not in fields:
            fields[kind.name] = (kind.options, Field(kind.options(), description=kind.about))
    return create_model(model.__name__, __base__=model, __module__=model.__module__, __doc__=model.__doc__, **fields)
