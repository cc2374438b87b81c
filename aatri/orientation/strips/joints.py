"""Scales of models from those before them: both share an image, seen from which common points are equally far.

Model a (images i, j) and model b (images j, k) each have the unit of their own base. With r_a and r_b the distances of
a common point from the projection centre of j in either model, every point gives the scale of b in units of a:

    l = log r_a - log r_b = s + J_a x_a + J_b x_b + e,   scale = exp(s)

e is the error of the image coordinates with the orientations held. Part of it is the same for both models, the ray of
image j: turned towards i by an angle d it shortens r_a by d / tan(g_a) and, mostly, lengthens r_b; g is the angle of
the rays at the point. x_a and x_b are the errors of the two relative orientations, latent unknowns with their
covariance as prior: common to all points of a model, they bend it and are not gross errors. s is the weighted mean
that follows, after data snooping from the median; one or two points are all used.

Rotations need no common points: they are chained through the common image. All joints are adjusted by a compiled loop,
in threads (`kernels.joints`; observation equations in `kernels.log_scale`).

Source: docs/formulas.md 3.5 (of the textbook k = (Z2a - Bza) / Z1b, the mean of three points).
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from aatri.adjustment.threads import by_rows, in_threads, items_between, taken
from aatri.arrays import Bool, Float, Int, ranges
from aatri.orientation.strips.kernels.joints import join
from aatri.orientation.strips.kernels.log_scale import log_scales
from aatri.orientation.strips.model_errors import root_of

AT_ONCE = 250_000
"""Common points worked on together; bounds the memory."""

WORTH_A_THREAD = 2_000
"""Common points for which a thread of their own pays."""


@dataclass(frozen=True)
class ModelTable:
    """Models, each in the frame of its left image, base 1."""

    left_from_right: Float
    base: Float
    """(m, 3, 3), (m, 3)."""
    orientation_covariance: Float
    """(m, 5, 5), rad^2. Of the rotation increment and the turn of the base along its tangents."""
    start: Int
    """(m + 1,) int64. First point of each model; the last is their number."""
    point: Int
    """(n,). Ascending within a model."""
    xyz: Float
    covariance: Float
    """(n, 3), (n, 3, 3). Covariances from the image coordinates, orientation held."""

    def of_row(self) -> Int:
        """The model of each point."""
        return np.repeat(np.arange(len(self.base)), np.diff(self.start))


@dataclass(frozen=True)
class JointTable:
    """Scales of models in the unit of those before."""

    first: Int
    second: Int
    """(j,). The models."""
    scale: Float
    sigma: Float
    """(j,). NaN without common points."""
    spread: Float
    """(j,). Extent of the used points across the track over that of all points of both models."""
    start: Int
    """(j + 1,) int64. First common point of each joint; the last is their number."""
    first_row: Int
    second_row: Int
    """(n,) int64. Rows of the common points among the points of the models."""
    active: Bool
    """(n,). Points used."""
    log_scale: Float
    """(n,). Logarithm of each point's own scale minus that of `scale`."""
    size: Float
    size_sigma: Float
    test: Float
    """(n,). Estimated gross error of log_scale, its standard deviation and |size| / size_sigma; NaN where uncontrolled.
    """
    turn: Float | None = None
    """(j, 3, 3). Rotation of the second model against the common image, where the points and not the image connect the
    models."""

    def used(self) -> Int:
        """Points used at each joint, (j,)."""
        return np.bincount(self.of_row()[self.active], minlength=len(self.first))

    def of_row(self) -> Int:
        """The joint of each common point."""
        return np.repeat(np.arange(len(self.first)), np.diff(self.start))

    def largest_test(self) -> Float:
        """Largest test statistic of the points used at each joint, (j,); 0 where none is controlled."""
        largest = np.zeros(len(self.first))
        np.maximum.at(largest, self.of_row()[self.active], np.nan_to_num(self.test[self.active]))
        return largest


def scale_transfers(models: ModelTable, first: Int, second: Int, *, snooping_limit: float = 4.0) -> JointTable:
    """Scales of models in the unit of others.

    Parameters
    ----------
    first, second : (j,) int
        The right image of the first model is the left one of the second.
    snooping_limit : float
        Points whose scale is wrong by more than this many standard deviations are rejected, where three or more
        points allow to tell which.
    """
    start, first_row, second_row = _common(models, first, second)
    n, j = len(first_row), len(first)
    joints = JointTable(
        np.asarray(first),
        np.asarray(second),
        np.full(j, np.nan),
        np.full(j, np.nan),
        np.full(j, np.nan),
        start,
        first_row,
        second_row,
        np.zeros(n, dtype=bool),
        np.full(n, np.nan),
        np.full(n, np.nan),
        np.full(n, np.nan),
        np.full(n, np.nan),
    )
    pieces = max(round(n / AT_ONCE), 1)
    bounds = np.searchsorted(start[:-1], np.linspace(0, n, pieces + 1)[1:-1])
    edges = np.unique(np.concatenate([[0], bounds, [j]])).tolist()
    of_models = _of_models(models)
    for a, b in pairwise(edges):
        rows = slice(int(start[a]), int(start[b]))
        _adjust(joints, a, b, *_observed(of_models, first_row[rows], second_row[rows]), snooping_limit)
    joints.spread[:] = _spreads(models, joints)
    return joints


def with_mean_scales(joints: JointTable) -> JointTable:
    """The joints with the plain mean of the scales of all points; their scatter gives the standard deviation."""
    own, of_row = np.exp(joints.log_scale) * joints.scale[joints.of_row()], joints.of_row()
    count = np.bincount(of_row, minlength=len(joints.first))
    mean = np.bincount(of_row, own, minlength=len(count)) / np.where(count > 0, count, np.nan)
    square = np.bincount(of_row, (own - mean[of_row]) ** 2, minlength=len(count))
    sigma = np.sqrt(square / np.where(count > 1, count * (count - 1), np.nan))
    return replace(
        joints, scale=mean, sigma=sigma, active=np.ones(len(own), dtype=bool), log_scale=np.log(own / mean[of_row])
    )


def with_given_scales(joints: JointTable, scale: Float, sigma: Float, active: Bool) -> JointTable:
    """The joints with scales from elsewhere, (j,), and the points used, (n,)."""
    of_row = joints.of_row()
    own = joints.log_scale + np.log(joints.scale[of_row])
    return replace(joints, scale=scale, sigma=sigma, log_scale=own - np.log(scale)[of_row], active=active)


def turns_round(models: ModelTable, joints: JointTable) -> Bool:
    """Joints at which the base of the second model runs against that of the first, (j,)."""
    before = np.einsum("nji,nj->ni", models.left_from_right[joints.first], models.base[joints.first])
    return np.asarray((before * models.base[joints.second]).sum(axis=1) < 0)


def _common(models: ModelTable, first: Int, second: Int) -> tuple[Int, Int, Int]:
    """Common points of every joint: first of each joint, rows in either model, by point."""
    span = int(models.point.max(initial=0)) + 1
    key = models.of_row().astype(np.int64) * span + models.point
    joint, row = _rows_of(models.start, first)
    key_of_row = np.asarray(second, dtype=np.int64)[joint] * span + models.point[row]
    there = np.minimum(np.searchsorted(key, key_of_row), max(len(key) - 1, 0))
    common = key[there] == key_of_row if len(key) else np.zeros(0, dtype=bool)
    start = np.concatenate([[0], np.cumsum(np.bincount(joint[common], minlength=len(first)))])
    return start, row[common], there[common]


def _rows_of(start: Int, chosen: Int) -> tuple[Int, Int]:
    """Rows of the chosen items, one after the other: the item's place among the chosen, the row."""
    count = np.diff(start)[chosen]
    return np.repeat(np.arange(len(chosen)), count), ranges(start[:-1][chosen], count)


def _of_models(models: ModelTable) -> tuple[Int | Float, ...]:
    """What the compiled observation equations take of the models."""
    roots = root_of(models.orientation_covariance)
    columns = (models.xyz, models.covariance, models.base, models.left_from_right, roots)
    of_row = np.ascontiguousarray(models.of_row(), dtype=np.int64)
    return (of_row, *(np.require(column, np.float64, ["C", "W"]) for column in columns))


def observed_scales(models: ModelTable, first_row: Int, second_row: Int) -> tuple[Float, Float, Float]:
    """Observed logarithms of the scale of common points.

    Parameters
    ----------
    first_row, second_row : (n,) int
        Rows of the points in the model before and in the one after it.

    Returns
    -------
    observed, sigma : (n,) float64
    A : (n, 11) float64
        Derivatives over sigma: by the latent errors of both orientations, of unit variance, and by the scale's
        logarithm.
    """
    return _observed(_of_models(models), first_row, second_row)


def _observed(of_models: tuple[Int | Float, ...], first: Int, second: Int) -> tuple[Float, Float, Float]:
    n = len(first)
    a, b = (np.ascontiguousarray(rows, dtype=np.int64) for rows in (first, second))
    observed, sigma, A = np.empty(n), np.empty(n), np.empty((n, 11))
    arguments = (a, b, *of_models, observed, sigma, A)
    in_threads(n, lambda begin, end: log_scales(begin, end, *arguments), worth=WORTH_A_THREAD)
    return observed, sigma, A


def _adjust(joints: JointTable, a: int, b: int, observed: Float, sigma: Float, A: Float, limit: float) -> None:
    """Fill in the joints a ... b - 1."""
    start = np.ascontiguousarray(joints.start[a : b + 1] - joints.start[a], dtype=np.int64)
    n, m = len(observed), b - a
    y = observed / sigma
    x, scale_sigma, done = np.full((m, 11), np.nan), np.full(m, np.nan), np.zeros(m, dtype=bool)
    active, work = np.zeros(n, dtype=bool), np.full((n, 3), np.nan)

    def part(first: int, last: int) -> None:
        join(*items_between(start, first, last), start, A, y, limit, x, scale_sigma, done, active, work)

    in_threads(n, part, worth=WORTH_A_THREAD)
    rows, joint = slice(int(joints.start[a]), int(joints.start[b])), np.repeat(np.arange(m), np.diff(start))
    v, r = work[:, 0], work[:, 1]
    joints.scale[a:b] = np.where(done, np.exp(x[:, -1]), np.nan)
    joints.sigma[a:b] = joints.scale[a:b] * scale_sigma
    joints.active[rows], joints.test[rows] = active, work[:, 2]
    joints.log_scale[rows] = observed - x[joint, -1]
    joints.size[rows] = np.where(active, -v / r, -v) * sigma
    joints.size_sigma[rows] = sigma * np.where(active, r**-0.5, r**0.5)


def _spreads(models: ModelTable, joints: JointTable) -> Float:
    """Extent across the track of the points used at each joint over that of all, as seen from the common image."""
    b = models.base[joints.second]
    across, depth = np.column_stack([-b[:, 1], b[:, 0], np.zeros(len(b))]), np.tile([0.0, 0.0, 1.0], (len(b), 1))
    joint_1, row_1 = _rows_of(models.start, joints.first)
    joint_2, row_2 = _rows_of(models.start, joints.second)
    base, R = models.base[joints.first], models.left_from_right[joints.first]
    from_right = by_rows(lambda row, joint: models.xyz[row] - base[joint], row_1, joint_1)
    first = _places(from_right, joint_1, (R @ across[:, :, None])[:, :, 0], R[:, :, 2])
    second = _places(taken(models.xyz, row_2), joint_2, across, depth)
    of_all = _extents(np.concatenate([first, second]), np.concatenate([joint_1, joint_2]), len(b))
    used = joints.of_row()[joints.active]
    of_used = _extents(_places(models.xyz[joints.second_row[joints.active]], used, across, depth), used, len(b))
    return np.where((of_all > 0) & (joints.used() > 0), of_used / np.where(of_all > 0, of_all, 1.0), 0.0)


def _places(xyz: Float, joint: Int, across: Float, depth: Float) -> Float:
    """Coordinates along the axes across over those along the depths of the joints, (n,)."""

    def quotient(xyz: Float, joint: Int) -> Float:
        return np.asarray((xyz * across[joint]).sum(axis=1) / np.abs((xyz * depth[joint]).sum(axis=1)))

    return by_rows(quotient, xyz, joint)


def _extents(place: Float, joint: Int, n: int) -> Float:
    lowest, highest = np.full(n, np.inf), np.full(n, -np.inf)
    np.minimum.at(lowest, joint, place)
    np.maximum.at(highest, joint, place)
    return np.where(highest >= lowest, highest - lowest, 0.0)
