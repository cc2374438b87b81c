"""What is known of a free component on the ground: control, positions, distances, attitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.geometry.vectors import finite_rows
from aatri.observations.control import KIND as CONTROL
from aatri.observations.poses import Poses
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bodies.given_relations import GivenAttitudes, Lengths


@dataclass(frozen=True)
class FreeBody:
    """A component of images and points in a frame of its own; rows are those of all images and points of the block.

    Attributes
    ----------
    poses : Poses
        NaN where it has no image.
    xyz : (n_points, 3) float64
        NaN where it has no point.
    covariance : (n_points, 3, 3) float64
        Of the points.
    centre_variance : float
        Of a coordinate of a projection centre.
    turn_rad : float, rad
        Standard deviation of the rotations of the images.
    """

    poses: Poses
    xyz: Float
    covariance: Float
    centre_variance: float
    turn_rad: float

    @property
    def images(self) -> Bool:
        """Which images it has, (n_images,)."""
        return finite_rows(self.poses.position_m)

    @property
    def places(self) -> Float:
        """All points and projection centres."""
        return np.concatenate([self.xyz[finite_rows(self.xyz)], self.poses.position_m[self.images]])

    @property
    def up(self) -> Float:
        """Direction against the mean viewing direction of its images."""
        return np.asarray(self.poses.ground_from_image[self.images][:, :, 2].mean(axis=0))


@dataclass(frozen=True)
class Datum:
    """Points of a component that something is known of, one row each: control points, observed positions, others.

    Attributes
    ----------
    name : (n,) tuple of str
        For messages.
    x : (n, 3) float64, unit of the component
    covariance : (n, 3, 3) float64, unit of the component squared
    offset_m : (n, 3) float64, m
        Lever arm along the component's axes; zero for points.
    xyz_m : (n, 3) float64, m
        On the ground; reduced to an origin near the block.
    covariance_m2 : (n, 3, 3) float64, m^2
        Zero where exact.
    given : (n, 3) bool
        Coordinates that are known.
    n_control : int, optional
        The first rows are control points, the others positions; default: all are control points.
    n_given : int, optional
        The rows beyond are points that only distances reach; default: there are none.
    distances : tuple of Lengths
        Between rows.
    attitudes : GivenAttitudes, optional
        Of images of the component, as the one strip there is.
    row : (n,) int, optional
        Of control and positions in their tables of the Block; default: their numbers.
    id : (n,) str, optional
        Of points and images; default: their names.
    kinds : (str, str)
        Of the rows of control and positions.
    """

    name: tuple[str, ...]
    x: Float
    covariance: Float
    offset_m: Float
    xyz_m: Float
    covariance_m2: Float
    given: Bool
    n_control: int | None = None
    n_given: int | None = None
    distances: tuple[Lengths, ...] = ()
    attitudes: GivenAttitudes | None = None
    row: Int | None = None
    id: Text | None = None
    kinds: tuple[str, str] = (CONTROL, POSITION)

    @property
    def coordinates(self) -> int:
        """Rows of control and positions."""
        return len(self.x) if self.n_given is None else self.n_given
