"""Relative orientation of many pairs without any start: five-point samples, then least squares.

A compiled loop over the pairs, in threads, draws samples (`kernels.consensus`) and gives the best orientations that
differ; the best one is adjusted with the points that fit it, by the rules of `relative.dependent`: data snooping, model
points, statistics. Nothing is assumed about how the images lie to each other.

Where a second orientation explains the points as well, the pair is ambiguous: points in a plane have two orientations
(Longuet-Higgins), and often both have all points in front. It is returned beside the first one. Where a rotation alone
explains the images there is no base, but the rotation is known.

Source: Nister, PAMI 26 (2004) 756; Fischler & Bolles 1981; Longuet-Higgins, Proc. R. Soc. B 227 (1986) 399.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.vectors import unit
from aatri.orientation.relative.dependent import FEWEST
from aatri.orientation.relative.image_scale import limit_of, with_image_scale
from aatri.orientation.relative.kernels.consensus import JUDGES, KEPT, consensus
from aatri.orientation.relative.pair_adjustment import SNOOPED
from aatri.orientation.relative.pair_loops import Portion, RelativeOrientations, oriented_in_loops
from aatri.orientation.relative.pairs import one_by_one
from aatri.orientation.relative.start import NO_BASE, refuse_degenerate
from aatri.progress import SILENT, Reporter

SAMPLES = 1_000
"""Most samples of a pair."""

AS_GOOD = 3.0
"""A second orientation explains n points as well if its cost, sum log(1 + (v / 3)^2), exceeds the first one's by no
more than this many standard deviations: the two see other components of the errors, so that the difference of their
sums of squares has a standard deviation of up to 2 sqrt(n), that of the costs a ninth of it."""

LEAST = 2.0
"""The same where points are few."""

TURNS = 15
"""Reweighted fits of a rotation."""

TURNED = 0.5
"""Share of the points that a rotation has to explain."""


@dataclass(frozen=True)
class EssentialOrientations:
    """Relative orientations without start.

    Attributes
    ----------
    found : RelativeOrientations
    second : (m, 3, 4) float64
        Rotation and base of another orientation that explains the points as well; NaN where there is none.
    turned : (m, 3, 3) float64
        Rotation of the right image into the frame of the left one where the images have no base; else NaN.
    turned_sigma_rad : (m,) float64, rad
    turned_points : (m,) int64
        Points that the rotation explains.
    samples : (m,) int64
        Five-point samples drawn.
    """

    found: RelativeOrientations
    second: Float
    turned: Float
    turned_sigma_rad: Float
    turned_points: Int
    samples: Int


def essential_orientations(
    rays: RayPairs, start: Int, *, snooping_limit: float | None = None, max_iterations: int = 20, min_points: int = 5,
    max_samples: int = SAMPLES, patient: bool = True, reporter: Reporter = SILENT,
) -> EssentialOrientations:  # fmt: skip
    """Orient the right image of every pair to its left one.

    Parameters
    ----------
    rays : RayPairs
        The points of all pairs, pair by pair.
    start : (m + 1,) int
        First point of each pair; the last is the number of points.
    snooping_limit, max_iterations, min_points
        See `dependent.relative_orientation`; without a limit it counts the points tested.
    max_samples : int
        Most samples of a pair.
    patient : bool
        Pairs that the compiled loops cannot orient are tried one by one from several starts; those of so few points
        that these loops do not take them are always.
    reporter : Reporter
        Told how many pairs are done.
    """
    limit = limit_of(rays, snooping_limit)
    made, scale = with_image_scale(
        lambda scaled: _oriented(
            scaled, start, limit, max_iterations, min_points, max_samples, patient=patient, reporter=reporter
        ),
        lambda made: made.found,
        rays,
    )
    return replace(made, found=replace(made.found, sigma0=scale * made.found.sigma0, scale=scale))


def _oriented(
    rays: RayPairs, start: Int, snooping_limit: float, max_iterations: int, min_points: int, max_samples: int, *,
    patient: bool, reporter: Reporter,
) -> EssentialOrientations:  # fmt: skip
    m = len(start) - 1
    second, samples, share = np.full((m, 3, 4), np.nan), np.zeros(m, dtype=np.int64), np.zeros(m)

    def begin(portion: Portion) -> None:
        own, count = slice(portion.first, portion.last), np.diff(start[portion.first : portion.last + 1])
        poses, costs = np.full((len(count), KEPT, 3, 4), np.nan), np.full((len(count), KEPT), np.inf)
        drawn, fits = np.zeros(len(count), dtype=np.int64), np.zeros(len(portion.active), dtype=bool)
        portion.all_pairs(consensus, portion.chosen, portion.table, max_samples, poses, costs, drawn, fits)
        portion.chosen[:] &= np.isfinite(costs[:, 0])
        portion.pose[:] = poses[:, 0]
        portion.active[:] &= fits
        row = np.repeat(np.arange(len(count)), count)
        share[own] = np.bincount(row[fits], minlength=len(count)) / np.maximum(count, 1)
        samples[own] = drawn
        limit = np.maximum(LEAST, AS_GOOD * 2.0 * np.sqrt(np.minimum(count, JUDGES)) / 9.0)
        also = portion.chosen & (costs[:, 1] - np.where(portion.chosen, costs[:, 0], 0.0) <= limit)
        second[own][also] = poses[also, 1]

    found = oriented_in_loops(rays, start, begin, snooping_limit, max_iterations, min_points, reporter, enough=FEWEST)
    for pair in np.flatnonzero(np.isfinite(second[:, 0, 0])).tolist():
        if found.formed[pair]:
            text = "ambiguous: another orientation explains the points as well, as over a plane"
            found.warnings[pair] = (*found.warnings.get(pair, ()), text)
    second[~found.formed] = np.nan
    turned = np.full((m, 3, 3), np.nan), np.full(m, np.nan), np.zeros(m, dtype=np.int64)
    for pair in np.flatnonzero(~found.formed).tolist():
        if pair in found.reasons:
            continue
        rows = np.arange(start[pair], start[pair + 1])
        mine = rays.take(rows)
        try:
            refuse_degenerate(mine, max(min_points, 5))
        except GeometryError as error:
            found.reasons[pair] = error.what
            for column, value in zip(turned, _turned(mine)):
                column[pair] = value
            continue
        if len(rows) < SNOOPED or (patient and share[pair] >= FEWEST):
            one_by_one(found, rays, pair, start, snooping_limit, max_iterations, min_points)
        elif share[pair] >= FEWEST:
            found.reasons[pair] = "no adjustment of its points converges: they hardly determine an orientation"
        else:
            found.reasons[pair] = f"only {round(share[pair] * len(rows))} of {len(rows)} points fit one orientation"
    return EssentialOrientations(found, second, *turned, samples)


def _turned(rays: RayPairs) -> tuple[Float | float, float, int]:
    """Rotation of the right image where it alone explains most points, its standard deviation, and their number."""
    if len(rays.left) < 5:
        return np.nan, np.nan, 0
    u1, u2 = unit(rays.left), unit(rays.right)
    sigma = np.hypot(rays.left_sigma.mean(axis=1) / np.linalg.norm(rays.left, axis=1),
                     rays.right_sigma.mean(axis=1) / np.linalg.norm(rays.right, axis=1))  # fmt: skip
    weight = np.ones(len(u1))
    for _ in range(TURNS):
        R = nearest_rotation((weight[:, None] * u1).T @ u2)
        off = np.linalg.norm(np.cross(u1, u2 @ R.T), axis=1) / sigma
        weight = 1.0 / np.maximum(off, 0.1)
    fits: Bool = off < 3.0 * NO_BASE
    if fits.sum() < max(5, TURNED * len(off)):
        return np.nan, np.nan, 0
    moment = np.eye(3) * fits.sum() - u1[fits].T @ u1[fits]
    least = float(np.linalg.eigvalsh(moment)[0])
    return R, float(np.median(sigma) / np.sqrt(least)) if least > 0 else np.pi, int(fits.sum())
