"""Are the statistics what they say? Blocks with normal errors of just the standard deviations given.

    python -m tests.campaigns.calibration --count 100 --injections 9 [--types "free datum" ...]
    python -m tests.campaigns.calibration --count 100 --blunders robust_snooping

Twelve types of blocks (`calibration_blocks`), of each so many with seeds 1, 2, 3 ...; nothing is removed unless
`--blunders` says so. Of each type, over all blocks:

- sigma0: the sum of v'Pv over the sum of redundancies, chi-square;
- NEES: d'C^-1 d / n of all poses and points together against the truth, C their whole covariance matrix from a dense
  inverse that shares nothing with the core but the Jacobians; chi-square of as many degrees of freedom;
- both of single blocks against their chi-square distributions, by Kolmogorov and Smirnov's test: p above 0.001;
- NEES of single points and of single poses with the covariances of the solution: their mean is 1; neighbours are
  correlated, so that the band comes from the scatter of the means of the blocks;
- the share of |w| above 3.29: 0.1 % expected; tests are correlated, so that the variance of the counts of the blocks
  widens the binomial band;
- power: a detectable error in one coordinate of an image point, control point, position or distance, its sign at
  random, and the block adjusted anew: its own |w| > 3.29 in 79.95 %.

Bands are at the level 1 - 0.01 / 24 each.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import binom, chi2, kstest, norm, t

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.campaigns.calibration_blocks import TYPES
from tests.campaigns.calibration_errors import Own, dense_errors

Float = np.ndarray
LEVEL = 0.01 / 24
BOUND = 3.29
KS = 1e-3
POWER = float(norm.cdf(4.13 - BOUND) + norm.cdf(-4.13 - BOUND))


@dataclass(frozen=True)
class Found:
    """Figures of one block."""

    squares: float
    redundancy: int
    nees: float
    unknowns: int
    of_points: float
    of_poses: float
    differs: float
    tests: int
    beyond: int
    removed: int
    injected: int
    detected: int


def one_block(name: str, seed: int, injections: int, blunders: str = "none") -> Found:
    """Adjust one block, and again with each of so many detectable errors in it."""
    made = TYPES[name]
    block, points = made.made(seed)
    options = BundleOptions(reliability=True, blunders=blunders, **made.options)  # type: ignore[arg-type]
    solution = bundle(block, points, options=options)
    tests = solution.tests
    assert tests is not None
    w = tests.test[np.isfinite(tests.test)]
    d, C, rank, own = dense_errors(block, points, solution, options)
    of_points, of_poses = _single(d, own)
    differs = max(float(np.abs(C[s, s] - Q).max() / np.abs(Q).max()) for s, Q in own)
    rng = np.random.default_rng([seed, 2])
    detected = sum(_detected(block, points, solution, options, rng) for _ in range(injections))
    return Found(
        squares=solution.sigma0**2 * solution.redundancy,
        redundancy=solution.redundancy,
        nees=_nees(d, C, rank),
        unknowns=rank,
        of_points=of_points,
        of_poses=of_poses,
        differs=differs,
        tests=len(w),
        beyond=int((np.abs(w) > BOUND).sum()),
        removed=int((~solution.residuals.active).sum()),
        injected=injections,
        detected=detected,
    )


def _nees(d: Float, C: Float, rank: int) -> float:
    """d'C^- d with the inverse over the directions that are not zero."""
    scale = np.sqrt(np.diag(C))
    values, vectors = np.linalg.eigh(C / scale[:, None] / scale)
    y = vectors[:, -rank:].T @ (d / scale)
    return float((y**2 / values[-rank:]).sum())


def _single(d: Float, own: Own) -> tuple[float, float]:
    """Mean of d'C^-1 d / n over the points, and over the poses."""
    sizes: dict[int, list[float]] = {3: [], 6: []}
    for s, Q in own:
        sizes[len(Q)].append(float(d[s] @ np.linalg.solve(Q, d[s])) / len(Q))
    return float(np.mean(sizes[3])), float(np.mean(sizes[6]))


KINDS = ("image_point", "control", "position", "distance")


def _detected(
    block: Block, points: ImagePoints, solution: Solution, options: BundleOptions, rng: np.random.Generator
) -> bool:
    """Whether a detectable error in an observation drawn at random is beyond the bound."""
    tests, residuals = solution.tests, solution.residuals
    assert tests is not None
    row, axis = np.nonzero(np.isfinite(tests.detectable) & np.isin(residuals.kind, KINDS)[:, None])
    k = int(rng.integers(len(row)))
    row, axis = row[k], axis[k]
    size = tests.detectable[row, axis] * rng.choice([-1.0, 1.0])
    kind, place = str(residuals.kind[row]), int(residuals.row[row])
    if kind == "image_point":
        xy = points.measurements.xy_mm.copy()
        xy[place, axis] += size
        points = replace(points, measurements=replace(points.measurements, xy_mm=xy))
    elif kind == "distance":
        value = block.geodetic.value.copy()
        value[place] += size
        block = replace(block, geodetic=replace(block.geodetic, value=value))
    else:
        name, column = ("ground_points", "xyz_m") if kind == "control" else ("exterior", "position_m")
        table = getattr(block, name)
        values = getattr(table, column).copy()
        values[place, axis] += size
        block = replace(block, **{name: replace(table, **{column: values})})
    again = bundle(block, points, solution, options=options)
    assert again.tests is not None
    return bool(abs(again.tests.test[row, axis]) > BOUND)


def judged(found: list[Found], blunders: str = "none") -> Iterator[tuple[bool, str]]:
    """Every figure of blocks of one type with its band."""
    r, squares = sum(f.redundancy for f in found), sum(f.squares for f in found)
    n, removed = sum(f.unknowns for f in found), sum(f.removed for f in found)
    if blunders != "none":
        tests = sum(f.tests for f in found)
        yield True, f"{removed} observations removed, {2 * norm.sf(4) * tests:.1f} of the tests beyond 4 expected"
    yield _of_chi_square("sigma0^2", squares, r)
    yield _of_chi_square("NEES", sum(f.nees for f in found), n)
    yield _of_distribution("sigma0^2", [chi2.cdf(f.squares, f.redundancy) for f in found])
    yield _of_distribution("NEES", [chi2.cdf(f.nees, f.unknowns) for f in found])
    yield _of_means("NEES of points", np.array([f.of_points for f in found]))
    yield _of_means("NEES of poses", np.array([f.of_poses for f in found]))
    yield _of_counts(np.array([f.beyond for f in found]), np.array([f.tests for f in found]))
    injected = sum(f.injected for f in found)
    if injected:
        hits = sum(f.detected for f in found)
        low, high = (float(binom.ppf(p, injected, POWER)) / injected for p in (LEVEL / 2, 1 - LEVEL / 2))
        share = hits / injected
        yield low <= share <= high, f"power {share:.4f} of {injected} ({low:.4f} to {high:.4f})"
    if blunders == "none":
        worst = max(f.differs for f in found)
        yield worst < 1e-6, f"covariances off the dense inverse by {worst:.1e} at most"


def _of_chi_square(name: str, squares: float, r: int) -> tuple[bool, str]:
    low, high = (float(chi2.ppf(p, r)) / r for p in (LEVEL / 2, 1 - LEVEL / 2))
    return low < squares / r < high, f"{name} {squares / r:.4f} ({low:.4f} to {high:.4f})"


def _of_distribution(name: str, probabilities: list[float]) -> tuple[bool, str]:
    """Kolmogorov and Smirnov's test of the values of single blocks against their chi-square distributions."""
    p = float(kstest(probabilities, "uniform").pvalue)
    return p > KS, f"{name} of single blocks: Kolmogorov-Smirnov p {p:.3f} (above {KS})"


def _of_means(name: str, mean: Float) -> tuple[bool, str]:
    n = len(mean)
    band = float(t.ppf(1 - LEVEL / 2, n - 1) * mean.std(ddof=1) / np.sqrt(n)) if n > 2 else np.inf
    return abs(mean.mean() - 1) < band, f"{name} {mean.mean():.3f} (1 within {band:.3f})"


def _of_counts(beyond: Float, tests: Float) -> tuple[bool, str]:
    p = 2 * float(norm.sf(BOUND))
    expected = p * tests.sum()
    wider = max(1.0, float(((beyond - p * tests) ** 2).sum() / expected))
    low, high = (float(binom.ppf(q, tests.sum(), p)) - expected for q in (LEVEL / 2, 1 - LEVEL / 2))
    low, high = (expected + np.sqrt(wider) * x for x in (low, high))
    text = f"{beyond.sum()} of {tests.sum()} tests beyond {BOUND} ({max(low, 0):.0f} to {high:.0f})"
    return low <= beyond.sum() <= high, text


def main(types: list[str], seeds: range, injections: int, blunders: str) -> int:
    """Run the campaign; how many figures are outside their bands."""
    wrong, every = 0, []
    for name in types:
        found = [one_block(name, seed, injections, blunders) for seed in seeds]
        every += found
        wrong += _told(name, judged(found, blunders))
    if len(types) > 1:
        wrong += _told("all types", judged(every, blunders))
    return wrong


def _told(name: str, figures: Iterator[tuple[bool, str]]) -> int:
    wrong = 0
    print(name)  # noqa: T201
    for ok, text in figures:
        wrong += not ok
        print(f"    {'ok   ' if ok else 'WRONG'} {text}", flush=True)  # noqa: T201
    return wrong


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--injections", type=int, default=0)
    parser.add_argument("--types", nargs="+", default=list(TYPES), choices=list(TYPES))
    parser.add_argument("--blunders", default="none")
    wanted = parser.parse_args()
    chosen = range(wanted.first, wanted.first + wanted.count)
    raise SystemExit(1 if main(wanted.types, chosen, wanted.injections, wanted.blunders) else 0)
