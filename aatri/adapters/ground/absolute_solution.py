"""Strips on the ground as a Solution."""

from __future__ import annotations

import numpy as np

from aatri.adapters.ground import absolute_tables as tables
from aatri.adapters.ground.absolute_datum import free_images
from aatri.adapters.ground.absolute_orientation import OrientedStrips
from aatri.adapters.solution import stacked
from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips.tied_tables import components_of, tests_of
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Parameters, Residuals, Solution, StripTransformations
from aatri.geometry.similarity import compose, transform
from aatri.notes import Note


def absolute_solution(
    oriented: OrientedStrips, image_points: ImagePoints, method: str, *, tests: bool = False
) -> tuple[Solution, list[Note]]:
    """The Solution of oriented components, and which images are left out."""
    block, strips, parts = oriented.of.block, oriented.of.strips, oriented.parts
    origin_m = oriented.of.ground.origin_m
    position, rotation = np.full((len(block.images), 3), np.nan), np.full((len(block.images), 3, 3), np.nan)
    points = np.full((len(block.points), 3), np.nan)
    transformations, parameters, residuals = [StripTransformations.empty()], [Parameters.empty()], [Residuals.empty()]
    suspects = [tables.carried(block, strips, oriented.of.rays, parts)]
    for part in parts:
        to_ground, component = part.result.ground_from_body, part.component
        centres, rotations, image = free_images(strips, component)
        position[image] = transform(to_ground, centres) + origin_m
        rotation[image] = to_ground.rotation @ rotations
        points[component.point] = transform(to_ground, component.xyz) + origin_m
        for strip, pose in zip(component.strips, component.component_from_strip):
            name = str(strips.strips.id[strip])
            transformations.append(pieces.similarity_rows(name, compose(to_ground, pose), origin_m))
        parameters += tables.precisions(strips, part)
        residuals += tables.residual_tables(part)
        suspects += tables.suspect_tables(strips, part)
    counts, sigma0 = tables.pooled(parts)
    uncontrolled = tables.uncontrolled_tables(block, strips, parts)
    solution = pieces.solution_of(
        block,
        image_points,
        pieces.Placed(position, rotation, points),
        method=method,
        counts=counts,
        sigma0=sigma0,
        iterations=sum(tied.iterations for part in parts for _, tied in part.adjusted()),
        transformations=stacked(transformations),
        parameters=stacked(parameters),
        residuals=stacked(residuals),
        suspects=stacked(suspects),
        uncontrolled=uncontrolled,
        tests=stacked([tests_of(tied) for part in parts for _, tied in part.adjusted()]) if tests else None,
        components=stacked([components_of(tied) for part in parts for _, tied in part.adjusted()]) if tests else None,
    )
    return solution, pieces.left_out(block, np.isfinite(position).all(1))
