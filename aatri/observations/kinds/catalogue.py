"""The kinds of observation there are, in the order of the tables of residuals. To add one: a file, and a line here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydantic import Field

from aatri.notes import Note
from aatri.observations import attitudes, control, image_points, positions, rigs
from aatri.observations.attitudes import AttitudeOptions
from aatri.observations.geodetic import covariances, directions, distances, zenith_angles
from aatri.observations.geodetic import differences as geodetic_differences
from aatri.observations.geodetic.distances import DistanceOptions
from aatri.observations.geodetic.zenith_angles import ZenithOptions
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.positions import PositionOptions
from aatri.observations.relative import angles, differences, lines, planes, round_shapes
from aatri.observations.rigs import RigOptions
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
    """A kind of observation."""

    observe: Callable[..., tuple[Observed, ...]]
    """Takes it from a block, given its options where it has such."""
    table: str = ""
    """Table of the Block that has its rows: where it is empty there are none."""
    options: Callable[[KindOptions], Options] | None = None
    """Its own among those of all kinds."""
    uses: tuple[str, ...] = ()
    """What it uses of the block, by the names of `artifacts.offers`."""


KINDS = (
    Kind(image_points.image_points, "image_points"),
    Kind(control.control, "ground_points", uses=control.USES),
    Kind(positions.positions, "exterior", lambda o: o.positions, uses=positions.USES),
    Kind(attitudes.attitudes, "exterior", lambda o: o.attitudes, uses=attitudes.USES),
    Kind(rigs.rigs, "rig_members", lambda o: o.rigs, uses=rigs.USES),
    Kind(distances.distances, "geodetic", lambda o: o.distances, uses=distances.USES),
    Kind(directions.directions, "geodetic", uses=directions.USES),
    Kind(zenith_angles.zenith_angles, "geodetic", lambda o: o.zenith_angles, uses=zenith_angles.USES),
    Kind(geodetic_differences.height_differences, "geodetic", uses=geodetic_differences.USES),
    Kind(geodetic_differences.coordinate_differences, "geodetic", uses=geodetic_differences.USES),
    Kind(differences.relative_differences, "relative_control", uses=differences.USES),
    Kind(angles.relative_angles, "relative_control", uses=angles.USES),
    Kind(planes.planes, "relative_control", uses=planes.USES),
    Kind(lines.lines, "relative_control", uses=lines.USES),
    Kind(round_shapes.round_shapes, "relative_control", uses=round_shapes.USES),
    Kind(differences.relative_distances, "relative_control", uses=differences.USES),
)

USES = tuple(sorted({*covariances.USES, *(name for kind in KINDS for name in kind.uses)}))
"""What the kinds use of a block, also where their options set them aside: then the user has said so."""


def observe(source: ObservationSource, options: KindOptions) -> tuple[Observed, ...]:
    """All observations of a block."""
    observed: list[Observed] = []
    for kind in KINDS:
        if not kind.table or len(getattr(source.block, kind.table)):
            observed += kind.observe(source) if kind.options is None else kind.observe(source, kind.options(options))
    if not len(source.block.geodetic_covariances):
        return tuple(observed)
    return covariances.with_geodetic_covariances(source.block, observed)


def options_without_data(block: Block, options: KindOptions) -> list[Note]:
    """Options of kinds that are set although the block offers nothing they are for."""
    stated = {name: own for name in KindOptions.model_fields if (own := dict(options)[name]).model_fields_set}
    offered = {offer.name for offer in block.offers()} if stated else set()
    notes = []
    for name, own in stated.items():
        kinds = [kind for kind in KINDS if kind.options is not None and kind.options(options) is own]
        uses = {use for kind in kinds for use in kind.uses if not use.startswith("camera")}
        if dict(own).get("use", True) and not uses & offered:
            notes.append(Note("warning", f"{name}: options are set, but the block has none of them"))
    return notes
