"""Are the statistics what they say? Blocks with normal errors of just the standard deviations given, nothing removed.

    python -m tests.campaigns.calibration --count 100

The block of `variance_components`: two cameras, control, positions, distances. Over all blocks:

- sigma0: the sum of v'Pv over the sum of redundancies, chi-square;
- the share of |w| above 3.29: 0.1 % expected;
- NEES: d'C^-1 d / n of single points and poses against the truth, whose mean is 1; neighbours are correlated, so that
  its band comes from the scatter of the means of the blocks;
- power: one image coordinate of each block carries just its detectable error; its own |w| > 3.29 in 80 %.

Bands are at the level 1 - 0.01 / 24 each.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import binom, chi2, t

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.geometry.rotations import log_rotation
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.campaigns.variance_components import TRUE, disturbed, error_free

LEVEL = 0.01 / 24
BOUND = 3.29


@dataclass(frozen=True)
class Found:
    """Figures of one block."""

    squares: float
    redundancy: int
    tests: int
    beyond: int
    of_points: float
    of_poses: float
    detected: bool


def one_block(made: Block, seed: int) -> Found:
    """Adjust one block with errors, and once more with one detectable error in it."""
    rng = np.random.default_rng(seed)
    block = disturbed(made, rng, dict.fromkeys(TRUE, 1.0))
    solution = _adjusted(block)
    tests = solution.tests
    assert tests is not None
    w = tests.test[np.isfinite(tests.test)]
    rows = np.flatnonzero((solution.residuals.kind == "image_point") & np.isfinite(tests.detectable[:, 0]))
    k = int(rng.choice(rows))
    row = int(solution.residuals.row[k])
    xy = block.image_points.xy.copy()
    pixel = block.cameras.pixel_size_mm[block.images.camera[block.image_points.image[row]], 0]
    xy[row, 0] += tests.detectable[k, 0] / pixel
    wrong = _adjusted(replace(block, image_points=replace(block.image_points, xy=xy)))
    assert wrong.tests is not None
    detected = bool(abs(wrong.tests.test[k, 0]) > BOUND)
    of_points, of_poses = _nees(block, solution)
    return Found(solution.sigma0**2 * solution.redundancy, solution.redundancy, len(w), int((np.abs(w) > BOUND).sum()),
                 of_points, of_poses, detected)  # fmt: skip


def _adjusted(block: Block) -> Solution:
    return bundle(block, calibrated(block), options=BundleOptions(reliability=True, blunders="none"))  # type: ignore[arg-type]


def _nees(block: Block, solution: Solution) -> tuple[float, float]:
    """Mean of d'C^-1 d / n over the points, and over the poses."""
    points, images = block.true_points, block.true_images
    assert points is not None
    assert images is not None
    d = solution.points.xyz_m[points.point] - points.xyz_m
    known = np.isfinite(d).all(axis=1)
    C = solution.points.covariance_m2[points.point][known]
    of_points = float(np.einsum("ni,ni->n", d[known], np.linalg.solve(C, d[known][..., None])[..., 0]).mean() / 3)
    R = solution.images.ground_from_image[images.image] @ images.ground_from_image.swapaxes(1, 2)
    shift = solution.images.position_m[images.image] - images.position_m
    e = np.concatenate([shift, log_rotation(R)], axis=1)
    C = solution.images.covariance[images.image]
    return of_points, float(np.einsum("ni,ni->n", e, np.linalg.solve(C, e[..., None])[..., 0]).mean() / 6)


def judged(found: list[Found]) -> list[tuple[bool, str]]:
    """Every figure with its band."""
    n = len(found)
    r, squares = sum(f.redundancy for f in found), sum(f.squares for f in found)
    low, high = (float(chi2.ppf(p, r)) / r for p in (LEVEL / 2, 1 - LEVEL / 2))
    lines = [(low < squares / r < high, f"sigma0 squared {squares / r:.4f}, expected {low:.4f} to {high:.4f}")]
    tests, beyond = sum(f.tests for f in found), sum(f.beyond for f in found)
    low, high = (float(binom.ppf(p, tests, 0.001)) for p in (LEVEL / 2, 1 - LEVEL / 2))
    lines.append((low <= beyond <= high, f"{beyond} of {tests} tests beyond 3.29, expected {low:.0f} to {high:.0f}"))
    for name in ("of_points", "of_poses"):
        mean = np.array([getattr(f, name) for f in found])
        band = float(t.ppf(1 - LEVEL / 2, n - 1) * mean.std(ddof=1) / np.sqrt(n)) if n > 2 else np.inf
        lines.append((abs(mean.mean() - 1) < band, f"NEES {name[3:]} {mean.mean():.4f}, 1 within {band:.4f} expected"))
    hits = sum(f.detected for f in found)
    low, high = (float(binom.ppf(p, n, 0.8)) for p in (LEVEL / 2, 1 - LEVEL / 2))
    lines.append((low <= hits <= high, f"{hits} of {n} detectable errors found, expected {low:.0f} to {high:.0f}"))
    return lines


def main(count: int) -> int:
    made = error_free()
    lines = judged([one_block(made, seed) for seed in range(1, count + 1)])
    for ok, text in lines:
        print(f"{'ok   ' if ok else 'WRONG'} {text}", flush=True)  # noqa: T201
    return 0 if all(ok for ok, _ in lines) else 1


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10)
    raise SystemExit(main(parser.parse_args().count))
