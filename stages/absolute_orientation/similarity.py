"""Absolute orientation by similarities: free strips to each other, then each component to the ground.

    component: X_c = T_j + s_j R_j x_j   for every strip j, by common points
    ground:    X   = T + s R X_c         by all control of the component together

Strips are first joined by common points to free components (orientation.free_block); each component then gets one
robust similarity from all its control points - full, plan only, height only - and observed positions of its projection
centres (orientation.absolute). So a block with four corner points, where no strip has three, is oriented. What control
leaves open is named.

sigma0 is the ratio to the a priori standard deviations of strip points and control: how much more the strips are
deformed than the precision of their points explains. The deformation itself, in metres, is the parameter tau_m.

Source: Horn 1987, Umeyama 1991; Kraus, Photogrammetry, block adjustment with independent models.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adapters import strips as pieces
from aatri.observations.control import control_of
from aatri.observations.positions import Positions, positions_of
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Parameters, Residuals, Solution, StripTransformations
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects
from aatri.errors import GeometryError
from aatri.geometry.similarity import compose, transform
from aatri.ids import shown
from aatri.orientation.free_block.absolute import Datum, orient_component
from aatri.orientation.free_block.components import Component, FreeBlock, join_strips, strip_names
from aatri.plugin import SILENT, Context, Field, Options, stage

from ._results import (
    ROLE_NAME,
    Given,
    OrientedPart,
    control_counts,
    precisions,
    residual_tables,
    suspect_tables,
)

EXTRAPOLATION_WARNED = 3.0


class SimilarityOptions(Options):
    """Options of the absolute orientation."""

    components: Literal["all", "largest"] = Field(
        "all",
        description="all: an error if a component cannot be oriented; largest: orient what can be, list the rest",
    )
    tie_limit: float = Field(6.0, gt=0, description="test statistic of a wrong tie between strips, in sigma")
    control_limit: float = Field(5.0, gt=0, description="test statistic of wrong control, in sigma")
    use_positions: bool = Field(True, description="use observed positions of the projection centres")


@stage(
    version=1,
    uses=("images.strip", "ground_points.xyz_m", "ground_points.covariance_m2", "exterior.position_m",
          "cameras.lever_arm_m"),
)  # fmt: skip
def similarity(
    block: Block,
    strips: Strips,
    image_points: ImagePoints,
    *,
    options: SimilarityOptions = SimilarityOptions(),
    context: Context = SILENT,
) -> Solution:
    """Orient free strips to the ground."""
    assemble.check_same_block(block, strips.images.id, "strips")
    assemble.check_same_block(block, image_points.images.id, "image_points")
    control, positions = control_of(block), positions_of(block)
    if not options.use_positions:
        positions = Positions(*(getattr(positions, n)[:0] for n in Positions.__dataclass_fields__))
    given = Given(block, strips, control, positions, pieces.origin_of(control, positions))
    free = join_strips(pieces.strip_points_of(strips), strips.strips.id.tolist(), limit=options.tie_limit)
    for text in free.unjoined:
        context.warn(f"not joined: {text}")
    oriented = _orient_all(given, free, options, context)
    return _solution(given, image_points, oriented, context)


def _orient_all(given: Given, free: FreeBlock, options: SimilarityOptions, context: Context) -> list[OrientedPart]:
    """Orient every component; components without a datum are an error or a warning, as the option says."""
    if not free.components:
        raise GeometryError("there are no strips to orient", remedy="see the gaps of the strip formation")
    oriented, failed = [], []
    for number, component in enumerate(free.components, 1):
        what = f"component {number} ({strip_names(component, given.strips.strips.id.tolist())})"
        try:
            found = _orient(given, component, what, options.control_limit)
        except GeometryError as error:
            failed.append(error)
            continue
        oriented.append(found)
        factor = found.result.analysis.extrapolation
        context.log(f"{what}: {len(found.control)} control points, {len(found.positions)} positions, "
                    f"errors of control magnified up to {factor:.2g} times")  # fmt: skip
        if factor > EXTRAPOLATION_WARNED:
            context.warn(f"{what}: control is in one part of it; its errors are magnified up to {factor:.1f} times")
    if failed and (options.components == "all" or not oriented):
        raise _all_of(failed, free)
    for failure in failed:
        context.warn(f"not oriented: {failure.what}")
    return oriented


def _all_of(failed: list[GeometryError], free: FreeBlock) -> GeometryError:
    texts = [error.what for error in failed] + [f"not joined: {text}" for text in free.unjoined[:10]]
    remedies = [failed[0].remedy]
    if len(free.components) > 1:
        remedies.append("or measure at least 3 points common to the strips, not on a line")
    if len(failed) < len(free.components):
        remedies.append("or set `components: largest` to orient the rest")
    return GeometryError("; ".join(texts), remedy="; ".join(remedies))


def _orient(given: Given, component: Component, what: str, limit: float) -> OrientedPart:
    centres, rotations, image = _free_images(given.strips, component)
    row_of = np.full(len(given.block.images), -1)
    row_of[image] = np.arange(len(image))
    held = np.flatnonzero(np.isin(given.control.point, component.point))
    at = np.searchsorted(component.point, given.control.point[held])
    seen = np.flatnonzero((row_of[given.positions.image] >= 0) & np.isfinite(given.positions.covariance_m2).all((1, 2)))
    station = row_of[given.positions.image[seen]]
    # A projection centre is about as uncertain as a typical point of the component.
    typical = float(np.median(np.einsum("nii->n", component.covariance))) / 3
    ids = given.block.points.id[given.control.point[held]], given.block.images.id[given.positions.image[seen]]
    datum = Datum(
        name=tuple(f"point {p}" for p in ids[0]) + tuple(f"image {i}" for i in ids[1]),
        x=np.concatenate([component.xyz[at], centres[station]]),
        covariance=np.concatenate([component.covariance[at], np.tile(typical * np.eye(3), (len(seen), 1, 1))]),
        offset_m=np.concatenate(
            [np.zeros((len(held), 3)),
             np.einsum("nij,nj->ni", rotations[station], given.positions.lever_arm_m[seen])]
        ),
        xyz_m=np.concatenate([given.control.xyz_m[held], given.positions.position_m[seen]]) - given.origin,
        covariance_m2=np.concatenate([given.control.covariance_m2[held], given.positions.covariance_m2[seen]]),
        given=np.concatenate([given.control.given[held], np.ones((len(seen), 3), dtype=bool)]),
    )  # fmt: skip
    body = np.concatenate([component.xyz, centres])
    result = orient_component(datum, body, rotations[:, :, 2].mean(0), what=what, limit=limit)
    return OrientedPart(component, held, seen, result)


def _free_images(strips: Strips, component: Component) -> tuple[Float, Float, Int]:
    """Projection centres and rotations of a component's images, in its frame; rows in images."""
    table = strips.strip_images
    rows = np.flatnonzero(np.isin(table.strip, component.strips))
    centres, rotations = np.empty((len(rows), 3)), np.empty((len(rows), 3, 3))
    for strip, pose in zip(component.strips, component.component_from_strip):
        of = table.strip[rows] == strip
        centres[of] = transform(pose, table.position[rows[of]])
        rotations[of] = pose.rotation @ table.strip_from_image[rows[of]]
    return centres, rotations, table.image[rows].astype(np.int64)


def _solution(given: Given, image_points: ImagePoints, oriented: list[OrientedPart], context: Context) -> Solution:
    block = given.block
    position, rotation = np.full((len(block.images), 3), np.nan), np.full((len(block.images), 3, 3), np.nan)
    points = np.full((len(block.points), 3), np.nan)
    transformations, parameters, residuals = [StripTransformations.empty()], [Parameters.empty()], [Residuals.empty()]
    suspects: list[Suspects] = [given.strips.suspects]
    counts, squares, iterations = np.zeros(2, dtype=int), 0.0, 0
    for found in oriented:
        to_ground, component = found.result.ground_from_component, found.component
        centres, rotations, image = _free_images(given.strips, component)
        position[image] = transform(to_ground, centres) + given.origin
        rotation[image] = to_ground.rotation @ rotations
        points[component.point] = transform(to_ground, component.xyz) + given.origin
        for strip, pose in zip(component.strips, component.component_from_strip):
            name = str(given.strips.strips.id[strip])
            transformations.append(pieces.similarity_rows(name, compose(to_ground, pose), given.origin))
        parameters += precisions(given, found)
        residuals += residual_tables(given, found)
        suspects += suspect_tables(given, found)
        for adjusted, n in ((found.result.tied, control_counts(found)), (component.tied, None)):
            if adjusted is None:
                continue
            counts += n if n is not None else np.array([adjusted.observations, adjusted.unknowns])
            redundancy = adjusted.observations - adjusted.unknowns
            squares += adjusted.sigma0**2 * redundancy if redundancy > 0 else 0.0
            iterations += adjusted.iterations
    redundancy = int(counts[0] - counts[1])
    _report(block, position, context)
    return pieces.solution_of(
        block=block,
        image_points=image_points,
        method=f"{ROLE_NAME}/similarity",
        position_m=position,
        ground_from_image=rotation,
        point_m=points,
        counts=(int(counts[0]), int(counts[1])),
        sigma0=float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan"),
        iterations=iterations,
        transformations=assemble.stacked(transformations),
        parameters=assemble.stacked(parameters),
        residuals=assemble.stacked(residuals),
        suspects=assemble.stacked(suspects),
    )


def _report(block: Block, position: Float, context: Context) -> None:
    left = np.flatnonzero(np.isnan(position).any(1) & block.images.active)
    if len(left):
        context.warn(f"not oriented ({len(left)} of {len(block.images)} images): {shown(block.images.id[left])}")
