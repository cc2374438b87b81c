"""An adjusted block: poses, points and parameters with their covariances, and the observations held against them.

How errors of its observations move the points and images they touch takes one more way down the tree, with the gains of
all records; for a free datum they are carried over to inner constraints.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import ndtri

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.covariance.gains import Gains
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.records import Records
from aatri.adjustment.statistics.limits import ALARM
from aatri.adjustment.stepping.adjusted import Adjusted
from aatri.arrays import Bool, Float, Int
from aatri.notes import Note
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import POINT, POSE, Poses
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.free_datum import FreeDatum, transformation_of


@dataclass(frozen=True)
class AdjustedParameters:
    """A group of parameters after the adjustment."""

    given: ParameterRows
    value: Float
    """(n, s)."""
    covariance: Float
    """(n, s, s). NaN where not asked for; zero where held."""


@dataclass(frozen=True)
class BundleResult:
    """An adjusted block."""

    poses: Poses
    """NaN where the image was left out."""
    xyz_m: Float
    """(n_points, 3), m."""
    covariances: dict[str, Float]
    """Dict of str to (n, k, k). Of all groups of unknowns; NaN where not determined or not asked for."""
    parameters: tuple[AdjustedParameters, ...]
    observations: tuple[AdjustedObservations, ...]
    image_adjusted: Bool
    point_adjusted: Bool
    adjusted: Adjusted
    notes: tuple[Note, ...] = ()
    free: FreeDatum | None = None
    """Where the datum is free."""
    absent: Bool | None = None
    """(n_points, 3). Coordinates that no observation can see: values of the start, no results."""
    counted: float | None = None
    """Redundancy that sigma0 counts, where it is not all of it, see `observed_sigma0`."""
    set_aside: Mapping[str, Bool] = field(default_factory=dict)
    """Dict of str to (n,). Images and points that were left out, as their observations do not determine them."""

    @property
    def pose_covariance(self) -> Float:
        """Of the orientations, (n_images, 6, 6), m and rad."""
        return self.covariances[POSE]

    @property
    def point_covariance_m2(self) -> Float:
        """Of the ground points, (n_points, 3, 3), m^2."""
        return self.covariances[POINT]

    @property
    def ray_used(self) -> Bool:
        """Image points that determine the result."""
        rays = (o.used for o in self.observations if {POSE, POINT} <= o.observed.records.groups)
        return next(rays, np.zeros(0, dtype=bool))

    def in_problem(self, place: int) -> tuple[Records, Int]:
        """Observations of a kind as records of the adjustment, and the row of each there; -1 where it takes no part."""
        taking_part = [k for k, o in enumerate(self.observations) if len(o.rows) and not o.observed.exact]
        observations = self.observations[place]
        row = np.full(len(observations.observed), -1, dtype=np.int64)
        row[observations.rows] = np.arange(len(observations.rows))
        return self.adjusted.problem.records[taking_part.index(place)], row


Adjust = Callable[[BundleInput], BundleResult]


def without_absent(result: BundleResult) -> BundleResult:
    """The result, NaN where a coordinate of a point is none of its unknowns."""
    if result.absent is None or not result.absent.any():
        return result
    unknown = result.absent[:, :, None] | result.absent[:, None, :]
    covariances = {**result.covariances, POINT: np.where(unknown, np.nan, result.covariances[POINT])}
    return replace(result, xyz_m=np.where(result.absent, np.nan, result.xyz_m), covariances=covariances)


def held_for_datum(result: BundleResult) -> int:
    """Scalars that a free datum holds: as many as control, positions and distances leave open; 0 without."""
    free = result.free
    return 0 if free is None else int(sum(u.free.sum() for u in free.unknowns)) - result.adjusted.n_unknowns


def without_covariances(result: BundleResult) -> BundleResult:
    """The same without what was not asked for."""
    groups = {name: np.full_like(values, np.nan) for name, values in result.covariances.items()}
    return replace(
        result,
        covariances=groups,
        parameters=tuple(replace(p, covariance=groups[p.given.group]) for p in result.parameters),
        observations=tuple(replace(o, covariance=np.full_like(o.covariance, np.nan)) for o in result.observations),
    )


def from_result(inputs: BundleInput, result: BundleResult) -> BundleInput:
    """The block with its adjusted values as start, also those of the unknowns that kinds of observations bring.

    A free datum stays fitted onto the values before.
    """
    state = result.adjusted.state
    image, point = result.image_adjusted, result.point_adjusted
    observed = tuple(replace(o, start={name: state[name] for name in o.start}) for o in inputs.observed)
    return replace(
        inputs,
        poses=state[POSE].where(image, inputs.poses),
        xyz_m=np.where(point[:, None], state[POINT], inputs.xyz_m),
        observed=observed,
        datum=inputs.datum or {POSE: inputs.poses, POINT: inputs.xyz_m},
    )


AT_INFINITY = float(-ndtri(ALARM))
"""Below it a distance may as well be infinite: one that is exceeds it once in a thousand times."""


def distance_tests(result: BundleResult, rays: ImagePointRows) -> tuple[Float, Float]:
    """Distances D of points from the middle of their images, and the tests t = D / sqrt(u'C u) of their being finite.

    u is the direction, C the covariance; t tests 1 / D against 0, whose error is normal where that of D is not.
    Source: Civera, Davison and Montiel 2008, Inverse depth parametrization for monocular SLAM.

    Returns
    -------
    distance_m : (n_points,) float64, m
    test : (n_points,) float64
        NaN without a covariance.
    """
    used = np.flatnonzero(result.ray_used)
    point, image = rays.point[used], rays.image[used]
    total, count = np.zeros((len(result.xyz_m), 3)), np.bincount(point, minlength=len(result.xyz_m))
    np.add.at(total, point, result.poses.position_m[image])
    away_m = result.xyz_m - total / np.where(count > 0, count, np.nan)[:, None]
    distance_m = np.linalg.norm(away_m, axis=1)
    along = np.einsum("ni,nij,nj->n", away_m, result.point_covariance_m2, away_m) / distance_m**2
    return distance_m, distance_m / np.sqrt(np.where(result.point_adjusted & (along > 0), along, np.nan))


def gains_of_observations(result: BundleResult) -> list[Gains | None]:
    """Gains of each of the observations, for the rows that take part; None where they are exact or none takes part.

    Parameters
    ----------
    result : BundleResult
        Of least squares, with its factor or without.
    """
    adjusted = result.adjusted
    if not adjusted.has_factor:
        return [None] * len(result.observations)
    marginal = marginal_covariances(adjusted, gains_of=(POINT, POSE))
    if result.free is not None:
        determined = np.asarray(np.isfinite(marginal.groups[POINT]).all(axis=(1, 2)))
        transformation = transformation_of(result.free, adjusted, determined)
        for records, gains in zip(adjusted.problem.records, marginal.gains):
            transformation.move_gains(gains, records, adjusted.state)
    in_turn = iter(marginal.gains)
    return [None if o.observed.exact or not len(o.rows) else next(in_turn) for o in result.observations]
