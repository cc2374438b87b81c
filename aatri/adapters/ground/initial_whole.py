"""A component to the ground by all that a block observes of it, where control and positions leave something open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adapters.frame.adjustment_frame import frame_of, geodesy_of, level_of
from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.geometry.similarity import Similarity
from aatri.observations.kinds.catalogue import KindOptions, observe
from aatri.observations.observed import Given, Observed
from aatri.observations.poses import POINT, POSE, Poses
from aatri.orientation.graph.component import ImageComponent
from aatri.orientation.graph.whole_body import brought_to_ground

NEARLY_M = 1e-3
"""Standard deviation of exact control: of a start it need not hold to the last digit."""


def by_all_kinds(
    as_given: Block, origin_m: Float, component: ImageComponent, up: Float, *, use_positions: bool
) -> Similarity:
    """The similarity that brings a component to the ground, reduced to its origin.

    Parameters
    ----------
    as_given : Block
        In its own frame.
    origin_m : (3,) float64, m
        In the frame of the adjustment.
    component : ImageComponent
    up : (3,) float64
        Direction against the mean viewing direction, in the component.
    use_positions : bool

    Raises
    ------
    GeometryError
        If something of the seven is left open.
    ConvergenceError
    """
    frame, geodesy = frame_of(as_given), geodesy_of(as_given)
    as_given = _without_exact_control(as_given)
    options = KindOptions.model_validate({"positions": {"use": use_positions, "drift": "none"}})

    def observed(poses: Poses, xyz: Float) -> tuple[Observed, ...]:
        start = {POSE: poses, POINT: xyz}
        level = level_of(frame, geodesy, origin_m)
        return observe(Given(as_given, None, origin_m, start, (), level, frame, geodesy), options)

    return brought_to_ground(observed, component.poses, component.xyz, up)


def _without_exact_control(block: Block) -> Block:
    covariance = block.ground_points.covariance_m2.copy()
    row, axis = np.nonzero(np.einsum("nii->ni", covariance) == 0)
    covariance[row, axis, axis] = NEARLY_M**2
    return replace(block, ground_points=replace(block.ground_points, covariance_m2=covariance))
