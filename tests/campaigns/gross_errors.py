"""Gross errors put into the block of the demo, and what the chain with default options finds of them.

    python -m tests.campaigns.gross_errors --count 4 [--first 1] [--only image_points swapped_numbers ...]

Each seed is one block, spoilt in five ways:

    image_points     1 % of all image points off by 10 to 1,000 sigma
    control          one control point off by 1 m
    swapped_control  two control points with each other's coordinates
    positions        three observed positions off by 20 to 100 sigma
    swapped_numbers  20 pairs of image points of one image with each other's number

Found is what stays out in the last Solution. Left is the share of the image points off by more than twice their minimal
detectable error (from the redundancy numbers of the block without gross errors) that are used; `rmse` that of points of
three and more rays over that of the block without, the largest of X, Y, Z; `lost` the share of all image points that
stay out; `others` what stays out of the kind and was right. A line ends with what is not as it should be.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import staying_out
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.chain import Chain, run_chain, simulated

DELTA0 = 4.13
"""Size of a detectable error over sigma / sqrt(r), at 0.1 % and a power of 80 %."""


@dataclass(frozen=True)
class Spoilt:
    """A block with gross errors: rows of its tables that have one."""

    block: Block
    kind: str
    rows: Int


def image_points(block: Block, rng: np.random.Generator) -> Spoilt:
    """1 % of all image points off."""
    m = block.image_points
    rows = rng.choice(len(m), round(0.01 * len(m)), replace=False)
    angle, size = rng.uniform(0, 2 * np.pi, len(rows)), rng.uniform(10, 1000, len(rows))
    xy = m.xy.copy()
    xy[rows] += (size * np.stack([np.cos(angle), np.sin(angle)])).T * m.sigma_mm[rows]
    return Spoilt(replace(block, image_points=replace(m, xy=xy)), "image_point", rows)


def control(block: Block, rng: np.random.Generator) -> Spoilt:
    """One control point off by a metre, in a random direction of an axis."""
    g = block.ground_points
    row = rng.choice(_control(block), 1)
    xyz = g.xyz_m.copy()
    xyz[row, rng.integers(3)] += rng.choice([-1.0, 1.0])
    return Spoilt(replace(block, ground_points=replace(g, xyz_m=xyz)), "control", row)


def swapped_control(block: Block, rng: np.random.Generator) -> Spoilt:
    """Two control points with each other's coordinates."""
    g = block.ground_points
    rows = rng.choice(_control(block), 2, replace=False)
    xyz = g.xyz_m.copy()
    xyz[rows] = xyz[rows[::-1]]
    return Spoilt(replace(block, ground_points=replace(g, xyz_m=xyz)), "control", rows)


def positions(block: Block, rng: np.random.Generator) -> Spoilt:
    """Three observed positions off."""
    e = block.exterior
    rows = rng.choice(len(e), 3, replace=False)
    direction = rng.standard_normal((3, 3))
    size = rng.uniform(20, 100, (3, 1)) * np.sqrt(np.einsum("nii->ni", e.position_covariance_m2[rows]))
    xyz = e.position_m.copy()
    xyz[rows] += size * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return Spoilt(replace(block, exterior=replace(e, position_m=xyz)), "position", rows)


def swapped_numbers(block: Block, rng: np.random.Generator) -> Spoilt:
    """20 pairs of image points with each other's number: their coordinates are exchanged."""
    m = block.image_points
    xy, rows = m.xy.copy(), []
    for image in rng.choice(len(block.images), 20, replace=False):
        pair = rng.choice(np.flatnonzero(m.image == image), 2, replace=False)
        xy[pair] = xy[pair[::-1]]
        rows.append(pair)
    return Spoilt(replace(block, image_points=replace(m, xy=xy)), "image_point", np.concatenate(rows))


WAYS: tuple[Callable[[Block, np.random.Generator], Spoilt], ...] = (
    image_points, control, swapped_control, positions, swapped_numbers,
)  # fmt: skip


def judged(chain: Chain, spoilt: Spoilt, clean: Chain) -> tuple[dict[str, float], list[str]]:
    """Figures of a spoilt block, and what is not as it should be."""
    solution, reference = chain.bundle, clean.bundle
    out = stays_out(solution, spoilt.kind)
    found = np.isin(spoilt.rows, out)
    large = _above(clean, spoilt) if spoilt.kind == "image_point" else np.ones(len(spoilt.rows), dtype=bool)
    rays = np.bincount(clean.refined.measurements.point, minlength=len(clean.block.points))
    ratio = (_rmse_m(chain.block, solution, rays > 2) / _rmse_m(chain.block, reference, rays > 2)).max()
    left = float((large & ~found).sum() / max(large.sum(), 1))
    figures = {
        "wrong": len(spoilt.rows), "found": int(found.sum()), "left": left,
        "rmse": float(ratio), "sigma0": solution.sigma0,
        "lost": len(stays_out(solution, "image_point")) / len(chain.block.image_points),
        "others": len(np.setdiff1d(out, spoilt.rows)),
    }  # fmt: skip
    bad = [
        name
        for name, good in (
            ("left", figures["left"] <= 0.02),
            ("rmse", ratio <= 1.05),
            ("sigma0", 0.97 <= solution.sigma0 <= 1.03),
            ("lost", figures["lost"] <= 0.02),
        )
        if not good
    ]
    return figures, bad


def stays_out(solution: Solution, kind: str) -> Int:
    """Rows of a kind that stay out."""
    s = solution.suspects
    return np.unique(s.row[(s.kind == kind) & staying_out(s) & (s.row >= 0)])


def _above(clean: Chain, spoilt: Spoilt) -> Bool:
    """Gross errors above twice their minimal detectable error: sqrt(e'Re) of whitened e against 2 delta0."""
    before, after = clean.block.image_points, spoilt.block.image_points
    e = (after.xy - before.xy)[spoilt.rows] / before.sigma_mm[spoilt.rows]
    solution = bundle(clean.block, clean.refined, clean.strip_block,
                      options=BundleOptions(interior_unknowns=True, reliability=True, blunders="none"))  # fmt: skip
    assert solution.tests is not None
    r = solution.residuals
    of = {int(row): k for k, row in enumerate(r.row) if r.kind[k] == "image_point"}
    share = np.array([solution.tests.redundancy[of[int(k)], :2] if int(k) in of else (0.0, 0.0) for k in spoilt.rows])
    return np.asarray(np.sqrt((np.nan_to_num(share) * e**2).sum(axis=1)) > 2 * DELTA0)


def _control(block: Block) -> Int:
    return np.flatnonzero((block.ground_points.role == 1).all(axis=1))


def _rmse_m(block: Block, solution: Solution, points: Bool) -> Float:
    truth = block.true_points
    assert truth is not None
    some = truth.point[points[truth.point]]
    true = truth.xyz_m[points[truth.point]]
    return np.asarray(np.sqrt(np.nanmean((solution.points.xyz_m[some] - true) ** 2, axis=0)))


def outcomes(seed: int, only: list[str]) -> Iterator[tuple[str, dict[str, float], list[str]]]:
    """Of one seed all ways."""
    options = BundleOptions(interior_unknowns=True)
    block = simulated(seed, preset="rc30")
    clean = run_chain(block, options)
    for k, way in enumerate(WAYS):
        if not only or way.__name__ in only:
            spoilt = way(block, np.random.default_rng([seed, k]))
            yield way.__name__, *judged(run_chain(spoilt.block, options), spoilt, clean)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[])
    chosen = parser.parse_args()
    failed = 0
    for seed in range(chosen.first, chosen.first + chosen.count):
        for name, figures, bad in outcomes(seed, chosen.only):
            text = ", ".join(f"{key} {value:.4g}" for key, value in figures.items())
            sys.stdout.write(f"seed {seed}, {name}: {text}{'  NOT GOOD: ' + ', '.join(bad) if bad else ''}\n")
            sys.stdout.flush()
            failed += bool(bad)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
