"""What components on the ground tell of one that has too little of its own: the images and points they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from aatri.adapters.ground.initial_datum import angle_precision, precision
from aatri.adapters.ground.initial_observed import Ground, SeenAttitudes
from aatri.arrays import Bool, Float
from aatri.geometry.vectors import finite_rows
from aatri.observations.control import Control
from aatri.observations.image_points import ImagePointRows
from aatri.observations.positions import Positions
from aatri.orientation.graph.component import ImageComponent

T = TypeVar("T", Control, Positions, SeenAttitudes)


def ground_of_neighbours(
    ground: Ground, neighbours: Sequence[ImageComponent], component: ImageComponent, rays: ImagePointRows
) -> Ground | None:
    """The ground with the images and points that a component shares with others; None where it shares nothing.

    Parameters
    ----------
    neighbours : sequence of ImageComponent
        On the ground, reduced to its origin.
    component : ImageComponent
        In a frame of its own.
    """
    images, points = component.images, finite_rows(component.xyz)
    shares = False
    for other in neighbours:
        of_image, of_point = np.flatnonzero(images & other.images), np.flatnonzero(points & finite_rows(other.xyz))
        images, points = images & ~other.images, points & ~finite_rows(other.xyz)
        shares |= bool(len(of_image) or len(of_point))
        spread, turn = precision(other, rays) ** 2 * np.eye(3), angle_precision(other, rays) ** 2 * np.eye(3)
        seen = of_image[~np.isin(of_image, ground.positions.image)]
        known = of_point[~np.isin(of_point, ground.control.point)]
        n, m, k = len(seen), len(known), len(of_image)
        all_: Bool = np.ones((m, 3), dtype=bool)
        zero: Float = np.zeros((n, 3))
        ground = replace(
            ground,
            control=_with(
                ground.control,
                Control(
                    _none(m),
                    known.astype(np.int32),
                    other.xyz[known] + ground.origin_m,
                    np.tile(spread, (m, 1, 1)),
                    all_,
                    ~all_,
                ),
            ),
            positions=_with(
                ground.positions,
                Positions(
                    _none(n),
                    seen.astype(np.int32),
                    other.poses.position_m[seen] + ground.origin_m,
                    np.tile(spread, (n, 1, 1)),
                    zero,
                ),
            ),
            attitudes=_with(
                ground.attitudes,
                SeenAttitudes(
                    _none(k),
                    of_image.astype(np.int32),
                    other.poses.ground_from_image[of_image],
                    np.tile(np.eye(3), (k, 1, 1)),
                    np.tile(turn, (k, 1, 1)),
                ),
            ),
        )
    return ground if shares else None


def _none(n: int) -> Any:
    """Rows of no table."""
    return np.full(n, -1, dtype=np.int32)


def _with(table: T, more: T) -> T:
    return type(table)(*(np.concatenate([getattr(table, f.name), getattr(more, f.name)]) for f in fields(table)))
