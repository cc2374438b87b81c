"""The kinds of observation there are, in the order of the tables of residuals. To add one: a file, and a line here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydantic import Field

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


class KindOptions(Options):
    """Options of the kinds of observation, for every stage that adjusts."""

    positions: PositionOptions = Field(
        PositionOptions(), description="observed positions of the block that have no unknowns of their own"
    )
    attitudes: AttitudeOptions = Field(AttitudeOptions(), description="observed attitudes of the images")
    rigs: RigOptions = Field(RigOptions(), description="images of one exposure of a rig")
    distances: DistanceOptions = Field(DistanceOptions(), description="distances of the geodetic observations")
    zenith_angles: ZenithOptions = Field(ZenithOptions(), description="zenith angles of the geodetic observations")


@dataclass(frozen=True)
class Kind:
    """A kind of observation.

    Attributes
    ----------
    observe : callable
        Takes it from a block, given its options where it has such.
    table : str, optional
        Table of the Block that has its rows: where it is empty there are none.
    options : callable, optional
        Its own among those of all kinds.
    uses : tuple of str
        What it uses of the block, by the names of `artifacts.offers`.
    """

    observe: Callable[..., tuple[Observed, ...]]
    table: str = ""
    options: Callable[[KindOptions], Options] | None = None
    uses: tuple[str, ...] = ()


KINDS = (
    Kind(image_points),
    Kind(control, "ground_points", uses=OF_CONTROL),
    Kind(positions, "exterior", lambda o: o.positions, uses=OF_POSITIONS),
    Kind(drift, "exterior", lambda o: o.positions, uses=OF_DRIFT),
    Kind(attitudes, "exterior", lambda o: o.attitudes, uses=OF_ATTITUDES),
    Kind(rigs, "rig_members", lambda o: o.rigs, uses=OF_RIGS),
    Kind(distances, "geodetic", lambda o: o.distances, uses=OF_DISTANCES),
    Kind(directions, "geodetic", uses=OF_DIRECTIONS),
    Kind(zenith_angles, "geodetic", lambda o: o.zenith_angles, uses=OF_ZENITH_ANGLES),
    Kind(height_differences, "geodetic", uses=OF_HEIGHT_DIFFERENCES),
    Kind(coordinate_differences, "geodetic", uses=OF_COORDINATE_DIFFERENCES),
    Kind(relative_differences, "relative_control", uses=OF_RELATIVE_DIFFERENCES),
    Kind(relative_angles, "relative_control", uses=OF_RELATIVE_ANGLES),
    Kind(planes, "relative_control", uses=OF_PLANES),
    Kind(lines, "relative_control", uses=OF_LINES),
    Kind(round_shapes, "relative_control", uses=OF_ROUND_SHAPES),
    Kind(relative_distances, "relative_control", uses=OF_RELATIVE_DISTANCES),
)

USES = tuple(sorted({*OF_COVARIANCES, *(name for kind in KINDS for name in kind.uses)}))
"""What the kinds use of a block, also where their options set them aside: then the user has said so."""


def observe(given: Given, options: KindOptions) -> tuple[Observed, ...]:
    """All observations of a block."""
    found: list[Observed] = []
    for kind in KINDS:
        if not kind.table or len(getattr(given.block, kind.table)):
            found += kind.observe(given) if kind.options is None else kind.observe(given, kind.options(options))
    return with_geodetic_covariances(given.block, found)


def options_without_data(block: Block, options: KindOptions) -> list[Note]:
    """Options of kinds that are set although the block offers nothing they are for."""
    stated = {name: own for name in KindOptions.model_fields if (own := dict(options)[name]) != type(own)()}
    offered = {offer.name for offer in block.offers()} if stated else set()
    notes = []
    for name, own in stated.items():
        kinds = [kind for kind in KINDS if kind.options is not None and kind.options(options) is own]
        uses = {use for kind in kinds for use in kind.uses if not use.startswith("camera")}
        if dict(own).get("use", True) and not uses & offered:
            notes.append(Note("warning", f"{name}: options are set, but the block has none of them"))
    return notes
