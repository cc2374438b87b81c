"""Gross errors put into blocks of film and of a UAV, and what the chain with default options finds of them.

    python -m tests.campaigns.gross_errors --count 20 [--first 1] [--blocks film uav rc30] [--only image_points ...]

Each seed is one block of each kind, of 13 control points (rc30: the demo, of 72), spoilt in eight ways:

    image_points     1 % of all image points off by 10 to 1,000 sigma
    many             5 %
    moderate         5 % off by 8 to 60 sigma, which a robust adjustment takes for long tails
    control          two control points off by 1 m
    swapped_control  two control points with each other's coordinates
    position         one observed position off by 20 to 100 sigma
    positions        three
    swapped_numbers  20 pairs of image points of one image with each other's number

Found is what stays out in the last Solution. Left is the share of the image points off by more than twice their minimal
detectable error (from the redundancy numbers of the block without gross errors) that are used; `rmse` that of points
of three and more rays in use over that of the same points in the block without, X, Y and Z together; `lost` the share
of all image points that were right and stay out; `precision` the share of what stays out, of the kind, that was wrong;
`blamed` the same without what is left out as undecidable: where one of the two rays of a point is wrong both go;
`possible` the precision of who leaves out exactly the wrong ones and what no test tells from them (`separable`). rmse
and precision of a way are those of all seeds together: control that is rightly left out weakens a single block by
chance. A line ends with what is not as it should be (LIMITS).
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.campaigns.separable import inseparable
from tests.stages.chain import Chain, run_chain, simulated

DELTA0 = 4.13
"""Size of a detectable error over sigma / sqrt(r), at 0.1 % and a power of 80 %."""


@dataclass(frozen=True)
class Spoilt:
    """A block with gross errors: rows of its tables that have one."""

    block: Block
    kind: str
    rows: Int


def image_points(
    block: Block, rng: np.random.Generator, share: float = 0.01, sizes: tuple[float, float] = (10, 1000)
) -> Spoilt:
    """1 % of all image points off."""
    m = block.image_points
    rows = rng.choice(len(m), round(share * len(m)), replace=False)
    angle, size = rng.uniform(0, 2 * np.pi, len(rows)), rng.uniform(*sizes, len(rows))
    xy = m.xy.copy()
    camera = block.images.camera[m.image[rows]]
    in_pixels = (block.cameras.image_coordinates == "pixel")[:, None]
    per_mm = 1 / np.where(in_pixels, block.cameras.pixel_size_mm, 1.0)[camera]
    xy[rows] += (size * np.stack([np.cos(angle), np.sin(angle)])).T * m.sigma_mm[rows] * per_mm
    return Spoilt(replace(block, image_points=replace(m, xy=xy)), "image_point", rows)


def many(block: Block, rng: np.random.Generator) -> Spoilt:
    """5 % of all image points off."""
    return image_points(block, rng, 0.05)


def moderate(block: Block, rng: np.random.Generator) -> Spoilt:
    """5 % of all image points off by 8 to 60 sigma."""
    return image_points(block, rng, 0.05, (8, 60))


def control(block: Block, rng: np.random.Generator) -> Spoilt:
    """Two control points off by a metre, each in a random direction of an axis."""
    g = block.ground_points
    rows = rng.choice(_control(block), 2, replace=False)
    xyz = g.xyz_m.copy()
    xyz[rows, rng.integers(3, size=2)] += rng.choice([-1.0, 1.0], 2)
    return Spoilt(replace(block, ground_points=replace(g, xyz_m=xyz)), "control", rows)


def swapped_control(block: Block, rng: np.random.Generator) -> Spoilt:
    """Two control points with each other's coordinates."""
    g = block.ground_points
    rows = rng.choice(_control(block), 2, replace=False)
    xyz = g.xyz_m.copy()
    xyz[rows] = xyz[rows[::-1]]
    return Spoilt(replace(block, ground_points=replace(g, xyz_m=xyz)), "control", rows)


def position(block: Block, rng: np.random.Generator, count: int = 1) -> Spoilt:
    """One observed position off."""
    e = block.exterior
    rows = rng.choice(len(e), count, replace=False)
    direction = rng.standard_normal((count, 3))
    size = rng.uniform(20, 100, (count, 1)) * np.sqrt(np.einsum("nii->ni", e.position_covariance_m2[rows]))
    xyz = e.position_m.copy()
    xyz[rows] += size * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    return Spoilt(replace(block, exterior=replace(e, position_m=xyz)), "position", rows)


def positions(block: Block, rng: np.random.Generator) -> Spoilt:
    """Three observed positions off."""
    return position(block, rng, 3)


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
    image_points,
    control,
    swapped_control,
    positions,
    swapped_numbers,
    many,
    position,
    moderate,
)
LIMITS = {"left": 0.02, "lost": 0.02}
"""Largest figures."""
MOST_RMSE = {"many": 1.2, "moderate": 1.2}
"""Of all seeds together; of the other ways 1.1."""
LEAST_PRECISION = {"many": 0.9}
SIGMA0 = (0.97, 1.03)

_SMALL: dict[str, Any] = {"known": {"full": 13, "check_full": 12}}
BLOCKS: dict[str, dict[str, Any]] = {
    "film": {
        "preset": "rc30",
        "flight": {"strips": 4, "images_per_strip": 9, "cross_strips": 0},
        "ties": {"new_points": 500},
        **_SMALL,
    },
    "uav": {
        "preset": "uav",
        "flight": {"strips": 4, "images_per_strip": 8},
        "ties": {"random_per_image": 60.0},
        **_SMALL,
    },
    "rc30": {"preset": "rc30"},
}


def judged(way: str, chain: Chain, spoilt: Spoilt, clean: Chain) -> tuple[dict[str, float], list[str]]:
    """Figures of a spoilt block, and what is not as it should be."""
    solution, reference = chain.bundle, clean.bundle
    out = stays_out(solution, spoilt.kind)
    found = np.isin(spoilt.rows, out)
    large = _above(clean, spoilt) if spoilt.kind == "image_point" else np.ones(len(spoilt.rows), dtype=bool)
    rays = np.minimum(solution.points.rays, reference.points.rays)
    ratio = np.sqrt(
        np.mean(_rmse_m(chain.block, solution, rays > 2) ** 2 / _rmse_m(chain.block, reference, rays > 2) ** 2)
    )
    left = float((large & ~found).sum() / max(large.sum(), 1))
    wrong = spoilt.rows if spoilt.kind == "image_point" else np.zeros(0, np.int64)
    figures = {
        "wrong": len(spoilt.rows),
        "found": int(found.sum()),
        "left": left,
        "rmse": float(ratio),
        "sigma0": solution.sigma0,
        "lost": len(np.setdiff1d(stays_out(solution, "image_point"), wrong)) / len(chain.block.image_points),
        "precision": _share_wrong(out, spoilt),
        "possible": _possible(chain, spoilt, clean),
        "blamed": _share_wrong(stays_out(solution, spoilt.kind, surely=True), spoilt),
    }
    bad = [name for name, most in LIMITS.items() if figures[name] > most]
    bad += [] if SIGMA0[0] <= solution.sigma0 / reference.sigma0 <= SIGMA0[1] else ["sigma0"]
    return figures, bad


def _share_wrong(out: Int, spoilt: Spoilt) -> float:
    return float(np.isin(out, spoilt.rows).mean()) if len(out) else 1.0


def _possible(chain: Chain, spoilt: Spoilt, clean: Chain) -> float:
    if spoilt.kind != "image_point":
        return 1.0
    return len(spoilt.rows) / (len(spoilt.rows) + len(inseparable(clean, chain, spoilt.rows)))


def stays_out(solution: Solution, kind: str, *, surely: bool = False) -> Int:
    """Rows of a kind that stay out; `surely`: without those of which only some are wrong."""
    s = solution.suspects
    which = s.staying_out & (s.verdict != "undecidable") if surely else s.staying_out
    return np.unique(s.row[(s.kind == kind) & which & (s.row >= 0)])


def _above(clean: Chain, spoilt: Spoilt) -> Bool:
    """Gross errors above twice their minimal detectable error: sqrt(e'Re) of whitened e against 2 delta0."""
    before, after = clean.block.image_points, spoilt.block.image_points
    e = (after.xy - before.xy)[spoilt.rows] / before.sigma_mm[spoilt.rows]
    solution = bundle(
        clean.block,
        clean.refined,
        clean.strip_block,
        options=BundleOptions(interior_unknowns=True, reliability=True, blunders="none"),
    )
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


def outcomes(seed: int, only: list[str], kind: str = "rc30") -> Iterator[tuple[str, dict[str, float], list[str]]]:
    """Of one seed all ways."""
    options = BundleOptions(interior_unknowns=True)
    block = simulated(seed, **BLOCKS[kind])
    clean = run_chain(block, options)
    for k, way in enumerate(WAYS):
        if not only or way.__name__ in only:
            spoilt = way(block, np.random.default_rng([seed, k]))
            yield way.__name__, *judged(way.__name__, run_chain(spoilt.block, options), spoilt, clean)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=4)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--blocks", nargs="+", choices=BLOCKS, default=["film", "uav"])
    chosen = parser.parse_args()
    failed, ratios = 0, defaultdict[tuple[str, str], list[float]](list)
    precisions, blamed, possible = (defaultdict[tuple[str, str], list[float]](list) for _ in range(3))
    for seed in range(chosen.first, chosen.first + chosen.count):
        for kind in chosen.blocks:
            for name, figures, bad in outcomes(seed, chosen.only, kind):
                text = ", ".join(f"{key} {value:.4g}" for key, value in figures.items())
                not_good = f"  NOT GOOD: {', '.join(bad)}" if bad else ""
                sys.stdout.write(f"seed {seed}, {kind}, {name}: {text}{not_good}\n")
                ratios[kind, name].append(figures["rmse"])
                precisions[kind, name].append(figures["precision"])
                blamed[kind, name].append(figures["blamed"])
                possible[kind, name].append(figures["possible"])
                sys.stdout.flush()
                failed += bool(bad)
    for (kind, name), values in ratios.items():
        ratio = float(np.sqrt(np.square(values).mean()))
        most = MOST_RMSE.get(name, 1.1)
        precision, least = float(np.mean(precisions[kind, name])), LEAST_PRECISION.get(name, 0.0)
        bad = [
            text for text, is_bad in ((f"beyond {most}", ratio > most), (f"below {least}", precision < least)) if is_bad
        ]
        text = f"{kind}, {name}: rmse {ratio:.3f}, precision {precision:.3f}"
        others = (float(np.mean(shares[kind, name])) for shares in (possible, blamed))
        sys.stdout.write(text + ", possible {:.3f}, of blamed {:.3f}".format(*others))
        sys.stdout.write(f"  NOT GOOD: {', '.join(bad)}\n" if bad else "\n")
        failed += bool(bad)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
