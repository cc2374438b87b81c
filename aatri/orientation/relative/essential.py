"""Relative orientation of many pairs without any start: five-point samples, then least squares.

A compiled loop over the pairs, in threads, draws samples (`from_consensus`) and gives the best orientations that
differ; the best one is adjusted with the points that fit it, by the rules of `relative.pairs`: data snooping, model
points, statistics. Nothing is assumed about how the images lie to each other.

Where a second orientation explains the points as well, the pair is ambiguous: points in a plane have two orientations
(Longuet-Higgins), and often both have all points in front. The expected rotation decides, where one is given; else the
second is returned beside the first one. Where a rotation alone
explains the images there is no base, but the rotation is known.

Source: Nister, PAMI 26 (2004) 756; Fischler & Bolles 1981; Longuet-Higgins, Proc. R. Soc. B 227 (1986) 399.
"""

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.vectors import unit
from aatri.orientation.relative.critical import angle_sigmas, degenerate_pairs
from aatri.orientation.relative.from_consensus import SAMPLES, FromConsensus
from aatri.orientation.relative.image_scale import limit_of, with_image_scale, with_sigmas
from aatri.orientation.relative.kernels.snooping import SNOOPED
from aatri.orientation.relative.limits import ENOUGH_FIT, LEAST_SHARE_OF_MODEL, NO_BASE, TURNED_SHARE
from aatri.orientation.relative.loops import Portion, from_parallel, oriented_from
from aatri.orientation.relative.orientations import (
    EssentialOrientations,
    PairSettings,
    RelativeOrientations,
    rows_of_pairs,
)
from aatri.progress import SILENT, Reporter

TURNS = 15
"""Reweighted fits of a rotation."""


def essential_orientations(
    rays: RayPairs,
    start: Int,
    *,
    snooping_limit: float | None = None,
    max_iterations: int = 20,
    min_points: int = 5,
    max_samples: int = SAMPLES,
    expected: Float | None = None,
    reporter: Reporter = SILENT,
) -> EssentialOrientations:
    """Orient the right image of every pair to its left one.

    Pairs of so few points that a wrong one cannot be located begin as parallel images where that leads somewhere.

    Parameters
    ----------
    rays, start, snooping_limit, max_iterations, min_points, reporter
        As of `pairs.relative_orientations`.
    max_samples : int
        Most samples of a pair.
    expected : (m, 3, 3) float64, optional
        Rotations of the right images into the frames of the left ones, as attitudes tell them; NaN where unknown. They
        decide between two orientations over a plane.
    """
    settings, count = PairSettings(limit_of(rays, snooping_limit), max_iterations, min_points), np.diff(start)
    searches: list[tuple[Bool, FromConsensus]] = []  # the first, with the standard deviations stated, and the last

    def orient(scaled: RayPairs, pairs: Int) -> RelativeOrientations:
        first, rotations = np.concatenate([[0], np.cumsum(count[pairs])]), None if expected is None else expected[pairs]
        many, few = (FromConsensus(first, max_samples, fewest, rotations) for fewest in (SNOOPED, 5))

        def parallel(portion: Portion) -> None:
            portion.chosen[:] &= (portion.count < SNOOPED) | (many.share[portion.pair] >= LEAST_SHARE_OF_MODEL)
            from_parallel(portion)

        def five_or_six(portion: Portion) -> None:
            portion.chosen[:] &= portion.count < SNOOPED
            few(portion)

        starts = ((many, LEAST_SHARE_OF_MODEL), (parallel, ENOUGH_FIT), (five_or_six, LEAST_SHARE_OF_MODEL))
        orientations = oriented_from(scaled, first, starts, settings, reporter)
        searches[1:] = [(orientations.formed, many)]
        return orientations

    orientations, m = with_image_scale(orient, rays, start), len(count)
    second, samples = next((s.second, s.samples) for formed, s in searches if formed is orientations.formed)
    for pair in np.flatnonzero(np.isfinite(second[:, 0, 0]) & orientations.formed).tolist():
        text = "ambiguous: another orientation explains the points as well, as over a plane"
        orientations.warnings[pair] = (*orientations.warnings.get(pair, ()), text)
    second[~orientations.formed] = np.nan
    turned = np.full((m, 3, 3), np.nan), np.full(m, np.nan), np.zeros(m, dtype=np.int64)
    not_formed = np.flatnonzero(~orientations.formed)
    unformed = with_sigmas(rays.take(rows_of_pairs(start, not_formed)), orientations.scale)
    first = np.concatenate([[0], np.cumsum(count[not_formed])])
    for k in degenerate_pairs(unformed, first, max(min_points, 5)):
        for column, value in zip(turned, _turned(unformed.take(slice(first[k], first[k + 1])))):
            column[not_formed[k]] = value
    return EssentialOrientations(orientations, second, *turned, samples)


def _turned(rays: RayPairs) -> tuple[Float | float, float, int]:
    """Rotation of the right image where it alone explains most points, its standard deviation, and their number."""
    if len(rays.left) < 5:
        return np.nan, np.nan, 0
    u1, u2 = unit(rays.left), unit(rays.right)
    sigma, weight = angle_sigmas(rays), np.ones(len(u1))
    for _ in range(TURNS):
        R = nearest_rotation((weight[:, None] * u1).T @ u2)
        off = np.linalg.norm(np.cross(u1, u2 @ R.T), axis=1) / sigma
        weight = 1.0 / np.maximum(off, 0.1)
    fits: Bool = off < 3.0 * NO_BASE
    if fits.sum() < max(5, TURNED_SHARE * len(off)):
        return np.nan, np.nan, 0
    moment = np.eye(3) * fits.sum() - u1[fits].T @ u1[fits]
    least = float(np.linalg.eigvalsh(moment)[0])
    return R, float(np.median(sigma) / np.sqrt(least)) if least > 0 else np.pi, int(fits.sum())
