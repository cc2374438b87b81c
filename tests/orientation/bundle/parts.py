"""A bundle adjustment put together from its parts, for tests that change one of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.adapters.bundle.block_start import start_origin
from aatri.adjustment.problem import SolverSettings
from aatri.observations.control import Control, observed_control
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.image_points import observed_image_points
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import Poses
from aatri.observations.positions import Positions, observed_positions
from aatri.orientation.bundle import adjust, from_afar
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.settings import BundleSettings


@dataclass(frozen=True)
class Parts:
    """Image points, start values, control, positions, parameters; coordinates as a map has them."""

    image_ids: Any
    point_ids: Any
    rays: ImagePointRows
    poses: Poses
    xyz_m: np.ndarray
    control: Control
    positions: Positions
    parameters: tuple[ParameterRows, ...] = ()
    marked: np.ndarray | None = None

    def together(self) -> BundleInput:
        """The input of the adjustment."""
        origin = start_origin(self.poses, self.xyz_m)
        images, points = np.asarray(self.image_ids), np.asarray(self.point_ids)

        def names(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return images[self.rays.image[rows]], points[self.rays.point[rows]]

        observed = (
            *observed_image_points(self.rays, self.parameters, names),
            *observed_control(self.control, origin, points[self.control.point]),
            *observed_positions(self.positions, origin, images[self.positions.image]),
        )
        poses = Poses(self.poses.position_m - origin, self.poses.ground_from_image)
        return BundleInput(
            images, points, observed, poses, self.xyz_m - origin, origin, self.rays, self.parameters, marked=self.marked
        )


def adjust_bundle(parts: Parts, **options: Any) -> BundleResult:
    return adjust.adjust_bundle(parts.together(), settings(**options))


def adjust_bundle_from_afar(parts: Parts, **options: Any) -> BundleResult:
    return from_afar.adjust_bundle_from_afar(parts.together(), settings(**options))


def settings(**options: Any) -> BundleSettings:
    """SolverSettings of the bundle, and of its solution, by name."""
    own = {name: options.pop(name) for name in tuple(options) if name in BundleSettings.__dataclass_fields__}
    return BundleSettings(**own, solution=SolverSettings(**options))
