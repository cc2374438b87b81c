"""What choosing the parameters of a self-calibration by the same block does to its standard deviations.

    python -m tests.campaigns.parameter_removal --count 100

Blocks of the type "self-calibration" (15 images, 3 strips, observed positions, Brown's parameters free) with lenses of
three sizes: none, one whose errors are of the size of their standard deviations, where choosing does most harm, and one
that no test misses. Adjusted with the whole set, and with `remove: true`. Told are the RMS of the errors of points and
of poses over their standard deviations, 1 where these hold, and the mean number of unknowns.
"""

from __future__ import annotations

import argparse

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.geometry.rotations import log_rotation
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.campaigns.calibration_blocks import LENS, TYPES, Type

SIZES = (0.0, 0.2, 1.0)
"""Of the lens, in those of the calibration campaign."""


def sized(size: float) -> Type:
    """The type of block with another lens."""
    made = TYPES["self-calibration"]
    camera = {**made.simulated["camera"], "brown": {name: size * value for name, value in LENS.items()}}
    return Type({**made.simulated, "camera": camera}, made.options)


def ratios(block: Block, solution: Solution) -> tuple[float, float]:
    """Mean of d'C^-1 d / n of points and of poses."""
    points, images = block.true_points, block.true_images
    assert points is not None
    assert images is not None
    d = solution.points.xyz_m[points.point] - points.xyz_m
    turned = solution.images.ground_from_image[images.image] @ images.ground_from_image.swapaxes(1, 2)
    e = np.concatenate([solution.images.position_m[images.image] - images.position_m, log_rotation(turned)], axis=1)
    found = []
    for error, C in ((d, solution.points.covariance_m2[points.point]), (e, solution.images.covariance[images.image])):
        size = np.einsum("ni,ni->n", error, np.linalg.solve(C, error[..., None])[..., 0])
        found.append(float(size.mean()) / error.shape[1])
    return found[0], found[1]


def main(seeds: range) -> None:
    """Run and tell."""
    for size in SIZES:
        made = sized(size)
        for remove in (False, True):
            calibration = {**made.options["self_calibration"], "remove": remove}
            options = BundleOptions(blunders="none", self_calibration=calibration)  # type: ignore[arg-type]
            found, unknowns = [], []
            for seed in seeds:
                block, points = made.made(seed)
                solution = bundle(block, points, options=options)
                found.append(ratios(block, solution))
                unknowns.append(solution.unknowns)
            squares = np.array(found)
            mean, band = squares.mean(axis=0), squares.std(axis=0) / np.sqrt(len(seeds))
            rms, band = np.sqrt(mean), 0.5 * band / np.sqrt(mean)
            said = "remove" if remove else "all kept"
            print(  # noqa: T201
                f"lens {size:g}, {said}: points {rms[0]:.3f} ± {band[0]:.3f}, poses {rms[1]:.3f} ± {band[1]:.3f}, "
                f"unknowns {np.mean(unknowns):.1f}",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--first", type=int, default=1)
    chosen = parser.parse_args()
    main(range(chosen.first, chosen.first + chosen.count))
