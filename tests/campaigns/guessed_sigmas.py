"""Standard deviations of a result where those of the image points were guessed wrong.

    python -m tests.campaigns.guessed_sigmas --count 20 [--first 1] [--blocks film uav] [--factors 0.2 0.5 1 2 5]

Small blocks of film and of a UAV without gross errors go through the chain at defaults, with the standard deviations of
the image points times a factor. Of the bundle: truth over theory of the new points (RMS of true errors over RMS of
standard deviations, X, Y, Z), NEES of their coordinates (mean of d'C^-1 d / 3), both pooled over all blocks, sigma0,
and the share of observations left out. Wanted: ratios and NEES of 0.85 to 1.2, at most 0.3 % left out.
"""

import argparse
import sys
from dataclasses import replace

import numpy as np

from aatri.evaluation.differences import is_new
from tests.stages.chain import run_chain, simulated

BLOCKS = {
    "film": {"preset": "rc30", "flight": {"strips": 3, "images_per_strip": 6}, "known": {"full": 13}},
    "uav": {"preset": "uav", "flight": {"strips": 4, "images_per_strip": 6}, "known": {"full": 13}},
}
LOW, HIGH, MOST_LOST = 0.85, 1.2, 0.003


def one_block(name: str, seed: int, factor: float) -> tuple[np.ndarray, float, float, float]:
    """Mean squares of errors and of standard deviations of the new points, (2, 3); NEES, sigma0 and the share lost."""
    block = simulated(seed, **BLOCKS[name])
    m, truth = block.image_points, block.true_points
    assert truth is not None
    solution = run_chain(replace(block, image_points=replace(m, sigma_mm=factor * m.sigma_mm))).bundle
    true_m = np.full((len(block.points), 3), np.nan)
    true_m[truth.point] = truth.xyz_m
    error, C = solution.points.xyz_m - true_m, solution.points.covariance_m2
    new = is_new(block) & np.isfinite(error).all(axis=1) & np.isfinite(C).all(axis=(1, 2))
    error, C = error[new], C[new]
    nees = np.einsum("ni,ni->n", error, np.linalg.solve(C, error[:, :, None])[:, :, 0]).mean() / 3
    squares = np.array([(error**2).mean(axis=0), np.einsum("nii->ni", C).mean(axis=0)])
    return squares, float(nees), solution.sigma0, float(solution.suspects.staying_out.sum() / len(m))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--blocks", nargs="+", choices=tuple(BLOCKS), default=list(BLOCKS))
    parser.add_argument("--factors", nargs="+", type=float, default=[0.2, 0.5, 1.0, 2.0, 5.0])
    chosen, within = parser.parse_args(), True
    for name in chosen.blocks:
        for factor in chosen.factors:
            of = [one_block(name, seed, factor) for seed in range(chosen.first, chosen.first + chosen.count)]
            squares, nees, sigma0, lost = (np.mean([one[k] for one in of], axis=0) for k in range(4))
            ratio = np.sqrt(squares[0] / squares[1])
            good = min(*ratio, nees) >= LOW and max(*ratio, nees) <= HIGH and lost <= MOST_LOST
            within &= good
            figures = f"truth over theory {' '.join(f'{r:.2f}' for r in ratio)}, NEES {nees:.2f}, sigma0 {sigma0:.3f}"
            told = "" if good else "  <-"
            sys.stdout.write(f"{name}, image sigmas times {factor:g}: {figures}, {lost:.2%} left out{told}\n")
            sys.stdout.flush()
    sys.exit(0 if within else 1)


if __name__ == "__main__":
    main()
