"""Standard deviations of strip blocks: truth over theory of the new points before the bundle, pooled over many blocks.

    python -m tests.campaigns.strip_sigmas --count 24 [--first 1] [--only film_demo uav ...]

The demo's block of 9 and 2 strips, with ties as they are, four times fewer and twice as many; and a drone's of 8 strips
with 80 % overlap, as it is, with a fifth of the ties, and with 60 %; each with much and with little control. Strip
block by polynomials of degree 0 and 2: the RMS of the true errors of the new points over the RMS of their standard
deviations, in X, Y and Z: pooled over all blocks, and the range of single blocks; and sigma0 of control, tau counted.
The errors of a block hang together: it has as many independent ones as its mean square scatters by, 2 / variance of
(truth over theory)^2, which is tr(C)^2 / tr(C^2) of their covariance. Pooled the ratios are to be 0.85 to 1.2, as far
as the independent errors of all blocks tell: 1.96 / sqrt(2 n) beside it is chance.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

import numpy as np

from aatri.adapters.strips.strip_adjustment import on_the_ground
from aatri.evaluation.differences import is_new
from aatri.geometry.strip_bases import SECOND_DEGREE
from aatri.orientation.bodies import strip_polynomials
from aatri.orientation.bodies.deformed_covariances import deformed_covariances
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated

Float = np.ndarray


_UAV_60 = {"preset": "uav", "flight": {"forward_overlap": 60.0, "images_per_strip": 16}}
BLOCKS: dict[str, tuple[dict[str, Any], tuple[int, int]]] = {
    "film_sparse": ({"preset": "rc30", "ties": {"per_position": 1, "new_points": 900}}, (72, 16)),
    "film_demo": ({"preset": "rc30"}, (72, 16)),
    "film_dense": ({"preset": "rc30", "ties": {"new_points": 8000}}, (72, 16)),
    "uav_sparse": ({"preset": "uav", "ties": {"random_per_image": 60.0}}, (25, 9)),
    "uav": ({"preset": "uav"}, (25, 9)),
    "uav_60": (_UAV_60, (25, 9)),
}
"""Blocks, and how many control points they have."""

DEGREES, LOW, HIGH = (0, 2), 0.85, 1.2


def one_block(seed: int, control: int, options: dict[str, Any]) -> list[tuple[Float, float]]:
    """Of each degree: mean squares of errors and of standard deviations of new points, (2, 3); sigma0 of control."""
    block = simulated(seed, known={"full": control}, **options)
    interior = affine(block) if (block.cameras.kind == "film").any() else calibrated(block)
    points = systematic(block, interior)
    strips = scale_transfer(block, dependent(block, points))
    ground = on_the_ground(block, strips, similarity(block, strips, points))
    models = np.bincount(strips.strip_images.strip)[ground.strips] - 1
    truth = block.true_points
    assert truth is not None
    true_m = np.full((len(block.points), 3), np.nan)
    true_m[truth.point] = truth.xyz_m
    of_degrees = []
    for degree in DEGREES:
        found = strip_polynomials.adjust_strip_polynomials(
            ground.points, len(block.points), ground.axes, ground.control, degree=degree, basis=SECOND_DEGREE
        )
        error = found.point_m + ground.origin - true_m
        deformed = deformed_covariances(found, ground.points, len(block.points), ground.axes, ground.control, models)
        C = np.einsum("nii->ni", deformed.point_covariance_m2)
        new = is_new(block) & np.isfinite(error).all(axis=1) & np.isfinite(C).all(axis=1)
        squares = np.array([(error[new] ** 2).mean(axis=0), C[new].mean(axis=0)])
        of_degrees.append((squares, found.tied.ground_sigma0))
    return of_degrees


def told(name: str, found: list[tuple[Float, float]]) -> bool:
    """Tell the ratios of many blocks, and whether they are within what is wanted and chance."""
    squares = np.array([both for both, _ in found])
    single = squares[:, 0] / squares[:, 1]
    pooled = np.sqrt(squares[:, 0].sum(axis=0) / squares[:, 1].sum(axis=0))
    independent = 2 * single.mean(axis=0) ** 2 / single.var(axis=0, ddof=1)
    chance = 1 + 1.96 / np.sqrt(2 * len(found) * independent)
    within = bool(((pooled >= LOW / chance) & (pooled <= HIGH * chance)).all())
    ranges = [f"{low:.2f} to {high:.2f}" for low, high in zip(*np.sqrt([single.min(axis=0), single.max(axis=0)]))]
    print(  # noqa: T201
        f"{name}: pooled {' '.join(f'{r:.2f}' for r in pooled)}; single blocks {', '.join(ranges)}; independent errors "
        f"of one {' '.join(f'{n:.0f}' for n in independent)}; sigma0 of control "
        f"{np.sqrt(np.mean([s**2 for _, s in found])):.2f}{'' if within else '  NOT GOOD'}",
        flush=True,
    )
    return within


def main(seeds: range, only: list[str]) -> None:
    """Run and tell."""
    good = []
    for name in only:
        options, controls = BLOCKS[name]
        for control in controls:
            of_seeds = [one_block(seed, control, options) for seed in seeds]
            for degree, of_degree in zip(DEGREES, zip(*of_seeds)):
                good.append(told(f"{name}, {control} control points, degree {degree}", list(of_degree)))
    sys.exit(0 if all(good) else 1)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--only", nargs="+", choices=BLOCKS, default=list(BLOCKS))
    chosen = parser.parse_args()
    main(range(chosen.first, chosen.first + chosen.count), chosen.only)
