"""Standard deviations of strips: truth over theory of the new points before the bundle, pooled over many blocks.

    python -m tests.campaigns.strip_sigmas --count 20

The demo's block. For absolute orientation and strip blocks by polynomials: the RMS of the true errors of the new points
over the RMS of their standard deviations, in X, Y and Z; of every block, and pooled over all (the root of the sum of
squares of errors over that of standard deviations). What these do not hold, and why, says
docs/methods/strip_block_adjustment.md.
"""

from __future__ import annotations

import argparse

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.evaluation.differences import is_new
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.conformal import conformal
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated

Float = np.ndarray


def squares(block: Block, solution: Solution) -> Float:
    """Mean squares of errors and of standard deviations of the new points, (2, 3)."""
    truth = block.true_points
    assert truth is not None
    true_m = np.full((len(block.points), 3), np.nan)
    true_m[truth.point] = truth.xyz_m
    C = np.einsum("nii->ni", solution.points.covariance_m2)
    new = is_new(block) & np.isfinite(solution.points.xyz_m).all(axis=1) & np.isfinite(C).all(axis=1)
    error = (solution.points.xyz_m - true_m)[new]
    return np.array([(error**2).mean(axis=0), C[new].mean(axis=0)])


def one_block(seed: int) -> dict[str, Float]:
    """By stage."""
    block = simulated(seed, preset="rc30")
    points = systematic(block, affine(block))
    strips = scale_transfer(block, dependent(block, points))
    absolute = similarity(block, strips, points)
    return {
        "absolute orientation": squares(block, absolute),
        "polynomial": squares(block, polynomial(block, points, strips, absolute)),
        "conformal": squares(block, conformal(block, points, strips, absolute)),
    }


def main(count: int) -> None:
    """Run and tell."""
    found: dict[str, list[Float]] = {}
    for seed in range(1, count + 1):
        for stage, both in one_block(seed).items():
            found.setdefault(stage, []).append(both)
    for stage, blocks in found.items():
        every = np.array(blocks)
        ratio = np.sqrt(every[:, 0] / every[:, 1])
        pooled = np.sqrt(every[:, 0].sum(axis=0) / every[:, 1].sum(axis=0))
        single = ", ".join(f"{low:.2f} to {high:.2f}" for low, high in zip(ratio.min(axis=0), ratio.max(axis=0)))
        print(f"{stage}: pooled {' '.join(f'{r:.2f}' for r in pooled)}; single blocks {single}")  # noqa: T201


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2)
    main(parser.parse_args().count)
