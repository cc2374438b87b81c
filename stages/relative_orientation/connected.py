"""Dependent relative orientation with the condition of model connection: scales are carried along the strip.

The first model of a strip is oriented as in relative_orientation/dependent. In every following one the scale in units
of the model before is a sixth unknown: a point of both models gives two equations,

    Q: the rays are coplanar with the base,   P: log r_a = s + log r_b,

r its distance from the common projection centre in the model before and in this one; other points give Q alone. Both
have the weights that the image coordinates give them; the error of the model before's own orientation is a latent
unknown with its covariance. Points whose P does not fit are rejected there and listed as suspects of kind model_tie.

phi2, omega2, kappa2, by/bx, bz/bx and `scale` stand in the table `elements`; strip_formation/connected takes the scales
from there. A model without three good connection points keeps its dependent orientation, has no scale, and is told.

Source: docs/formulas.md 3.5, errata E08; see aatri/orientation/relative/connected.py.
"""

from typing import Literal

from aatri.adapters.pairs.image_pairs import pair_names
from aatri.adapters.pairs.models import models_of, refuse_misfits, with_connections, with_elements
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.checks.after.models import findings_of_models
from aatri.checks.finding import report
from aatri.ids import several
from aatri.notes import Note
from aatri.orientation.relative.connected_pairs import classical_model_points, connected_pairs
from aatri.orientation.relative.image_scale import limit_of, with_sigmas
from aatri.plugin import SILENT, Context, Field, stage

from ._pairs import PairOptions, checked_image_points, oriented_pairs


class ConnectedOptions(PairOptions):
    """Options of the connected relative orientation."""

    coordinates: Literal["intersection", "coefficients"] = Field(
        "intersection",
        description="of the model points: rigorous intersection; or by the point projection coefficients, connection "
        "points from the right image with the height of the model before",
    )


@stage(version=1, uses=("images.strip", "cameras.distortion"))
def connected(
    block: Block,
    image_points: ImagePoints,
    *,
    options: ConnectedOptions = ConnectedOptions(),
    context: Context = SILENT,
) -> Models:
    """Orient the consecutive images of every strip, each model connected with the one before."""
    image_points = checked_image_points(block, image_points, context)
    pairs, orients, orientations = oriented_pairs(block, image_points, options, context)
    refuse_misfits(orientations, options.max_sigma0, with_sigmas(pairs.rays, 1.0 / orientations.scale))
    connections, loose = connected_pairs(pairs, orientations, limit_of(pairs.rays, options.snooping_limit), orients)
    if options.coordinates == "coefficients":
        orientations.xyz[:] = classical_model_points(pairs, orientations, connections)
    notes = []
    if loose:
        text = "models without connection to the one before: fewer than three points of both fit, their scale is open"
        notes.append(Note("warning", text, tuple(pair_names(block, pairs)[list(loose)].tolist())))
    wrong = sum(int((~c.orientation.connects).sum()) for c in connections)
    points = several(wrong, "connection point", "is", "are")
    notes.append(Note("note", f"{several(len(connections), 'connection')}; {points} rejected there"))
    models = with_elements(models_of(block, image_points, pairs, orientations), "dependent")
    models = with_connections(block, models, orientations, connections)
    context.progress(len(pairs.left), len(pairs.left), "models")
    report([*notes, *findings_of_models(block, image_points, pairs, orientations, models)], context)
    return models
