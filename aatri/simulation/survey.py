"""Geodetic observations between the points of a block, each by its own forward model.

Instruments stand on points and are set up along the vertical, and so are targets; what an instrument shows comes from
the line between the two in the axes (grid east, grid north, up) of its place:

    distance     (1 + m) |l| + a                    horizontal   |l| sin z
    direction    arg(n + i e) - orientation         azimuth, angle from grid north, between two targets
    zenith       arccos(u / |l|) less the angle between chord and arc of a ray of curvature k sin(z) / R
    ellipsoid    the geodesic, by PROJ              map          length in the map
    height, coordinate differences                  of the coordinates of the block

Points observed are near each other: neighbours in plan that belong to no relative control.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from aatri.arrays import Float, Int
from aatri.simulation.rays import Photography
from aatri.simulation.settings import refused
from aatri.simulation.survey_settings import SurveyOptions
from aatri.units import EARTH_RADIUS_M

NEAREST, FARTHEST = 3, 12
"""Targets are among these neighbours of a station."""
GROUP = "EDM"
HEIGHTS_M = (1.3, 1.8)
"""Lowest and highest instrument and target."""


@dataclass(frozen=True)
class Place:
    """Where instruments and targets stand: one end of many observations."""

    local_m: Float  # E, N, h of the point
    height_m: Float  # above it

    @property
    def raised_m(self) -> Float:
        """E, N, h of the instrument or the target."""
        return np.asarray(self.local_m + self.height_m[:, None] * np.array([0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class Sighted:
    """Observations of one type, without errors."""

    type: str
    """As in geodetic.csv."""
    kind: str
    """Of the observation."""
    station: Int
    target: Int
    vertex: Int
    """(n,). Rows of points, in the order of the simulation; `target` of images where `to_image`; vertex -1 if none."""
    heights_m: Float
    """(n, 2), m."""
    value: Float
    """(n,), m or rad."""
    set: Int
    """(n,). -1: none."""
    to_image: bool = False
    reduced: str = "no"
    group: str = ""


def line(photography: Photography, start: Place, end: Place) -> Float:
    """From instruments to targets, in the axes of the instruments: east, north, up, (n, 3) m."""
    away = photography.cartesian(end.raised_m) - photography.cartesian(start.raised_m)
    return np.asarray(np.einsum("nji,nj->ni", photography.axes(start.local_m), away))


def bearing(away: Float) -> Float:
    """Clockwise from north, rad."""
    return np.asarray(np.angle(away[:, 1] + 1j * away[:, 0]) % (2 * np.pi))


def zenith(away: Float, refraction: float) -> Float:
    """Zenith angle of the arriving ray, rad: the target looks higher than its chord."""
    length = np.linalg.norm(away, axis=1)
    z = np.arccos(away[:, 2] / length)
    return np.asarray(z - np.arcsin(0.5 * length * refraction * np.sin(z) / EARTH_RADIUS_M))


def sighted(
    settings: SurveyOptions,
    photography: Photography,
    local_m: Float,
    candidates: Int,
    in_block: Any,
    rng: np.random.Generator,
) -> list[Sighted]:
    """All observations asked for, without errors.

    Parameters
    ----------
    local_m : (n, 3) float64, m
        E, N, h of all points.
    candidates : (m,) int
        Points that may be observed.
    in_block : callable
        Local coordinates to those of the block.

    Raises
    ------
    GeometryError
        If there are too few points.
    """
    view = _View(photography, local_m, candidates, in_block, rng, settings)
    counts = (
        (settings.distances, view.distances),
        (settings.horizontal_distances, view.horizontal),
        (settings.ellipsoid_distances, view.ellipsoid),
        (settings.map_distances, view.map),
        (settings.image_distances, view.image_distances),
        (settings.direction_sets, view.directions),
        (settings.azimuths, view.azimuths),
        (settings.angles, view.angles),
        (settings.zenith_angles, view.zenith_angles),
        (settings.height_differences, view.height_differences),
        (settings.baselines, view.baselines),
    )
    return [part for count, draw in counts if count for part in draw(count)]


@dataclass(frozen=True)
class _View:
    photography: Photography
    local_m: Float
    candidates: Int
    in_block: Any
    rng: np.random.Generator
    settings: SurveyOptions

    def _targets(self, stations: int, each: int) -> tuple[Int, Int]:
        """Random stations and near targets of each, (n,), (n, each) rows of points."""
        plan = self.local_m[self.candidates, :2]
        if len(plan) <= each:
            raise refused(
                f"{len(plan)} points are too few for {each} lines of sight from each station",
                "raise ties or known, or lower survey.directions_per_set",
            )
        last = min(max(FARTHEST, each + NEAREST), len(plan) - 1)
        at = self.rng.integers(len(plan), size=stations)
        near = cKDTree(plan).query(plan[at], last + 1)[1][:, min(NEAREST, last - each + 1) :]
        chosen = np.array([self.rng.permutation(places)[:each] for places in near]).reshape(stations, each)
        return self.candidates[at], self.candidates[chosen]

    def _heights(self, n: int) -> Float:
        return np.round(self.rng.uniform(*HEIGHTS_M, (n, 2)), 3)

    def _pairs(self, n: int) -> tuple[Int, Int, Float, Float]:
        """Stations, targets, heights of both, and the lines between them."""
        start, end, heights = self._pairs_raised(n)
        return start, end, heights, self._line(start, end, heights)

    def _pairs_raised(self, n: int) -> tuple[Int, Int, Float]:
        """Stations, targets, and heights of both."""
        start, end = self._targets(n, 1)
        return start, end[:, 0], self._heights(n)

    def _line(self, start: Int, end: Int, heights: Float) -> Float:
        return line(
            self.photography, Place(self.local_m[start], heights[:, 0]), Place(self.local_m[end], heights[:, 1])
        )

    def distances(self, n: int) -> list[Sighted]:
        start, end, heights, away = self._pairs(n)
        s = self.settings
        shown = (1 + s.distance_scale) * np.linalg.norm(away, axis=1) + s.distance_addition_m
        group = GROUP if s.distance_scale or s.distance_addition_m else ""
        return [_of("distance", "distance", start, end, heights, shown, group=group)]

    def horizontal(self, n: int) -> list[Sighted]:
        start, end, heights, away = self._pairs(n)
        value = np.hypot(away[:, 0], away[:, 1])
        return [_of("horizontal_distance", "horizontal_distance", start, end, heights, value)]

    def ellipsoid(self, n: int) -> list[Sighted]:
        start, end = self._targets(n, 1)
        value = self.photography.on_ellipsoid(self.local_m[start], self.local_m[end[:, 0]])
        none = np.zeros((n, 2))
        return [_of("distance", "horizontal_distance", start, end[:, 0], none, value, reduced="ellipsoid")]

    def map(self, n: int) -> list[Sighted]:
        start, end = self._targets(n, 1)
        value = np.abs((self.local_m[end[:, 0], :2] - self.local_m[start, :2]) @ np.array([1, 1j]))
        none = np.zeros((n, 2))
        return [_of("distance", "horizontal_distance", start, end[:, 0], none, value, reduced="map")]

    def image_distances(self, n: int) -> list[Sighted]:
        image = self.rng.integers(len(self.photography.station_m), size=n)
        tree = cKDTree(self.local_m[self.candidates, :2])
        near = tree.query(self.photography.station_m[image, :2], min(FARTHEST, len(self.candidates)))[1]
        start = self.candidates[np.array([self.rng.choice(places) for places in near])]
        heights = np.column_stack([self._heights(n)[:, 0], np.zeros(n)])
        away = line(
            self.photography,
            Place(self.local_m[start], heights[:, 0]),
            Place(self.photography.station_m[image], heights[:, 1]),
        )
        value = np.linalg.norm(away, axis=1)
        return [_of("distance", "distance", start, image, heights, value, to_image=True)]

    def directions(self, n: int) -> list[Sighted]:
        each = self.settings.directions_per_set
        start, ends = self._targets(n, each)
        start, end, sets = np.repeat(start, each), ends.ravel(), np.repeat(np.arange(n), each)
        heights = self._heights(len(start))
        turned = bearing(self._line(start, end, heights)) - self.rng.uniform(0, 2 * np.pi, n)[sets]
        return [_of("direction", "direction", start, end, heights, turned % (2 * np.pi), of_set=sets)]

    def azimuths(self, n: int) -> list[Sighted]:
        start, end, heights, away = self._pairs(n)
        return [_of("azimuth", "azimuth", start, end, heights, bearing(away))]

    def angles(self, n: int) -> list[Sighted]:
        vertex, ends = self._targets(n, 2)
        heights = self._heights(n)
        above = np.column_stack([np.zeros(n), heights[:, 0]]), np.column_stack([np.zeros(n), heights[:, 1]])
        first, second = (bearing(self._line(vertex, ends[:, k], above[k])) for k in range(2))
        value = (second - first) % (2 * np.pi)
        return [_of("angle", "angle", ends[:, 0], ends[:, 1], heights, value, vertex=vertex)]

    def zenith_angles(self, n: int) -> list[Sighted]:
        start, end, heights, away = self._pairs(n)
        k = self.settings.refraction if self.photography.spherical else 0.0
        return [_of("zenith", "zenith", start, end, heights, zenith(away, k))]

    def height_differences(self, n: int) -> list[Sighted]:
        start, end, heights = self._pairs_raised(n)
        up = self.local_m[end, 2] + heights[:, 1] - self.local_m[start, 2] - heights[:, 0]
        return [_of("height_difference", "height_difference", start, end, heights, up)]

    def baselines(self, n: int) -> list[Sighted]:
        start, end, heights = self._pairs_raised(n)
        low, high = (
            self.in_block(Place(self.local_m[rows], heights[:, k]).raised_m) for k, rows in enumerate((start, end))
        )
        axes = zip(("dX", "dY", "dZ"), (high - low).T)
        return [_of(name, "coordinate_difference", start, end, heights, apart) for name, apart in axes]


def _of(
    type_: str,
    kind: str,
    start: Int,
    end: Int,
    heights: Float,
    value: Float,
    *,
    of_set: Int | None = None,
    vertex: Int | None = None,
    **more: Any,
) -> Sighted:
    none = np.full(len(start), -1)
    return Sighted(
        type_,
        kind,
        start,
        end,
        none if vertex is None else vertex,
        heights,
        value,
        none if of_set is None else of_set,
        **more,
    )
