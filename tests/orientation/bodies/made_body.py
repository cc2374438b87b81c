"""A made-up body on the ground: points and images with normal errors, and what is observed of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from aatri.arrays import finite_rows
from aatri.geometry.rotations import levelling
from aatri.geometry.similarity import Similarity, inverse, transform
from aatri.observations.control import Control, observed_control
from aatri.observations.geodetic.sights import Sights, observed_sights, slope
from aatri.observations.level import PLANE
from aatri.observations.observed import Observed
from aatri.observations.poses import Poses
from aatri.observations.positions import Positions, observed_positions
from aatri.orientation.bodies.absolute import OrientationSettings, OrientedBody, orient_body
from aatri.orientation.bodies.free_body import FreeBody, concerning

TRUE = Similarity(np.array([500.0, 400.0, 100.0]), 220.0, Rotation.from_rotvec([0.02, -0.03, 2.0]).as_matrix())
BACK = inverse(TRUE)
ALL, PLAN, HEIGHT = (True, True, True), (True, True, False), (False, False, True)
CORNERS = np.array([[0.0, 0, 10], [2000, 0, 20], [0, 1200, 30], [2000, 1200, 15]])
LIMIT = 5.0


def other_points() -> np.ndarray:
    """Points of the body of which nothing is observed."""
    rng = np.random.default_rng(9)
    return np.column_stack([rng.uniform(0, 2000, 60), rng.uniform(0, 1200, 60), rng.uniform(0, 40, 60)])


BODY = other_points()


@dataclass
class MadeBody:
    """Known points, numbered from 0, and images, looking down.

    Attributes
    ----------
    points, images : (n, 3) float64, m
        Where they are on the ground.
    off_m : float, m
        Standard deviation of points and centres in the body: their errors.
    stated_m : float, m
        The same as it is stated.
    """

    points: np.ndarray
    images: np.ndarray = field(default_factory=lambda: np.array([[900.0, 500.0, 1500.0], [1100.0, 700.0, 1500.0]]))
    off_m: float = 0.0
    stated_m: float = 0.022
    turn_rad: float = 1e-6
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(3))
    observed: list[Observed] = field(default_factory=list)

    def __post_init__(self) -> None:
        places = np.concatenate([self.points, self.images])
        x = transform(BACK, places + self.rng.normal(0, self.off_m, places.shape))
        n, tilted = len(self.points), TRUE.rotation.T @ np.array([0.02, 0.01, 1.0])
        R = np.tile(levelling(tilted).T, (len(self.images), 1, 1))
        xyz = np.concatenate([x[:n], transform(BACK, BODY)])
        variance = (self.stated_m / TRUE.scale) ** 2
        covariance = np.tile(np.eye(3) * variance, (len(xyz), 1, 1))
        self.body = FreeBody(Poses(x[n:], R), xyz, covariance, covariance[: len(self.images)], self.turn_rad)

    @property
    def rotations(self) -> np.ndarray:
        """Of the images on the ground."""
        return np.asarray(TRUE.rotation @ self.body.poses.ground_from_image)

    def control(
        self, points: Sequence[int], given: Sequence[Sequence[bool]], sigma_m: float, error: np.ndarray | float = 0.0
    ) -> MadeBody:
        """Control at some points; sigma 0: exact."""
        row, known, exact = np.array(points, dtype=np.int32), np.array(given, dtype=bool).reshape(-1, 3), sigma_m == 0
        C = np.tile(np.eye(3) * sigma_m**2, (len(row), 1, 1))
        rows = Control(row, row, self.points[row] + error, C, known & (not exact), known & exact)
        self.observed += observed_control(rows, np.zeros(3), np.array([f"{k + 1}" for k in points], dtype=np.str_))
        return self

    def positions(self, sigma_m: float, arm: np.ndarray | float = 0.0, error: np.ndarray | float = 0.0) -> MadeBody:
        """Positions of all images, of antennas beside them where an arm, in the axes of the camera, is given."""
        n = len(self.images)
        arms = np.zeros((n, 3)) + arm
        place = self.images + np.einsum("nij,nj->ni", self.rotations, arms) + error
        row, C = np.arange(n, dtype=np.int32), np.tile(np.eye(3) * sigma_m**2, (n, 1, 1))
        self.observed += observed_positions(Positions(row, row, place, C, arms), np.zeros(3), row.astype(np.str_))
        return self

    def distances(self, start: Sequence[int], end: Sequence[int], sigma_m: float, error: np.ndarray) -> MadeBody:
        """Distances between points."""
        n = len(start)
        value = np.linalg.norm(self.points[list(end)] - self.points[list(start)], axis=1) + error
        no, zero, none, ends = np.zeros(n, dtype=bool), np.zeros(n), np.full(n, ""), np.array([start, end], np.int32)
        names = np.array([f"{a}-{b}" for a, b in zip(start, end)], dtype=np.str_)
        sigma = np.full(n, sigma_m)
        sights = Sights(np.arange(n), *ends, no, no, zero, zero, value, sigma, names, none, none, none)
        self.observed += observed_sights("distance", sights, PLANE, slope, "m")
        return self

    def oriented(self, *, stiff: bool = False) -> OrientedBody:
        """By what is observed."""
        assert finite_rows(self.body.xyz).all()
        ids = np.arange(1, 1000).astype(np.str_)
        return orient_body(
            lambda _: concerning(self.observed, self.body),
            self.body,
            OrientationSettings(LIMIT, stiff=stiff),
            what="component 1",
            image_ids=ids,
            point_ids=ids,
        )


def active(found: OrientedBody, kind: str) -> list[bool]:
    """Which observations of a kind are not rejected."""
    used: list[bool] = found.tied.active[found.tied.of(kind)].tolist()
    return used


def off_m(found: Similarity, other: Similarity = TRUE) -> float:
    """Largest difference of the points of the body."""
    x = transform(BACK, BODY)
    return float(np.abs(transform(found, x) - transform(other, x)).max())
