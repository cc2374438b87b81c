"""Standard deviations of strip blocks: truth over theory of the new points before the bundle, pooled over many blocks.

    python -m tests.campaigns.strip_sigmas --count 20

The demo's block of 9 and 2 strips, 72 and 16 control points, as it is and with ties four times fewer and twice as
many. Strip block by polynomials: the RMS of the true errors of the new points over the RMS of their standard
deviations, in X, Y and Z: pooled over all blocks, and the range of single blocks; and sigma0 of control, tau counted.
Pooled they are to be 0.85 to 1.2 (0.8 to 1.25 of eight blocks, which know them to some 8 %).
"""

from __future__ import annotations

import argparse
import itertools
import sys

import numpy as np

from aatri.adapters.strips.strip_adjustment import on_the_ground
from aatri.evaluation.differences import is_new
from aatri.geometry.strip_bases import SECOND_DEGREE
from aatri.orientation.bodies import strip_polynomials
from aatri.orientation.bodies.deformed_covariances import deformed_covariances
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated

Float = np.ndarray


TIES = {"sparse": {"per_position": 1, "new_points": 900}, "demo": {}, "dense": {"new_points": 8000}}
DEGREES, LOW, HIGH = (0, 2), 0.8, 1.25


def one_block(seed: int, degree: int, control: int, ties: dict[str, int]) -> tuple[Float, float]:
    """Mean squares of errors and of standard deviations of the new points, (2, 3); sigma0 of control."""
    block = simulated(seed, preset="rc30", known={"full": control}, ties=ties)
    points = systematic(block, affine(block))
    strips = scale_transfer(block, dependent(block, points))
    ground = on_the_ground(block, strips, similarity(block, strips, points))
    found = strip_polynomials.adjust_strip_polynomials(
        ground.points, len(block.points), ground.axes, ground.control, degree=degree, basis=SECOND_DEGREE
    )
    truth = block.true_points
    assert truth is not None
    true_m = np.full((len(block.points), 3), np.nan)
    true_m[truth.point] = truth.xyz_m
    error = found.point_m + ground.origin - true_m
    models = np.bincount(strips.strip_images.strip)[ground.strips] - 1
    deformed = deformed_covariances(found, ground.points, len(block.points), ground.axes, ground.control, models)
    C = np.einsum("nii->ni", deformed.point_covariance_m2)
    new = is_new(block) & np.isfinite(error).all(axis=1) & np.isfinite(C).all(axis=1)
    return np.array([(error[new] ** 2).mean(axis=0), C[new].mean(axis=0)]), found.tied.ground_sigma0


def main(count: int) -> None:
    """Run and tell."""
    within = True
    for (name, ties), control, degree in itertools.product(TIES.items(), (72, 16), DEGREES):
        found = [one_block(seed, degree, control, ties) for seed in range(1, count + 1)]
        squares = np.array([both for both, _ in found])
        ratio = np.sqrt(squares[:, 0] / squares[:, 1])
        pooled = np.sqrt(squares[:, 0].sum(axis=0) / squares[:, 1].sum(axis=0))
        single = ", ".join(f"{low:.2f} to {high:.2f}" for low, high in zip(ratio.min(axis=0), ratio.max(axis=0)))
        of_control = np.sqrt(np.mean([s**2 for _, s in found]))
        within &= bool(((pooled >= LOW) & (pooled <= HIGH)).all())
        print(  # noqa: T201
            f"{name}, {control} control points, degree {degree}: pooled {' '.join(f'{r:.2f}' for r in pooled)}; single "
            f"blocks {single}; sigma0 of control {of_control:.2f}",
            flush=True,
        )
    sys.exit(0 if within else 1)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2)
    main(parser.parse_args().count)
