"""GNSS positions with a shift of 0.3 m and a drift of 2 mm/s per strip: truth over theory of the new points.

    python -m tests.campaigns.drift --count 3 --control 72
    python -m tests.campaigns.drift --count 20 --control 5

The demo's block, its strips drift groups. Each line: the ratio of the RMS of the true errors of the new points to the
RMS of their standard deviations, in X, Y and Z; last the mean of the squared ratios. With few control points a block
holds few independent errors, so that only the mean over many blocks says something.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

from aatri.evaluation.differences import is_new
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from tests.stages.chain import run_chain, simulated

Float = np.ndarray


def ratios(seed: int, control: int, **preset: object) -> Float:
    """Truth over theory in X, Y, Z of one block."""
    block = simulated(
        seed, preset="rc30", gnss={"shift_m": 0.3, "drift_m_per_s": 0.002}, known={"full": control}, **preset
    )
    bundle = run_chain(block, BundleOptions(interior_unknowns=True)).bundle
    truth = block.true_points
    assert truth is not None
    true_m = np.full((len(block.points), 3), np.nan)
    true_m[truth.point] = truth.xyz_m
    new = is_new(block) & np.isfinite(bundle.points.xyz_m).all(axis=1)
    error = np.sqrt(((bundle.points.xyz_m - true_m)[new] ** 2).mean(axis=0))
    return error / np.sqrt(np.einsum("nii->ni", bundle.points.covariance_m2)[new].mean(axis=0))


def told(count: int, control: int) -> Iterator[str]:
    """A line per block, and the mean."""
    found = []
    for seed in range(1, count + 1):
        found.append(ratios(seed, control))
        yield f"seed {seed}: {' '.join(f'{r:.3f}' for r in found[-1])}"
    yield f"mean of squares: {' '.join(f'{r:.3f}' for r in (np.array(found) ** 2).mean(axis=0))}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=3)
    parser.add_argument("--control", type=int, default=72)
    wanted = parser.parse_args()
    for line in told(wanted.count, wanted.control):
        print(line, flush=True)  # noqa: T201
