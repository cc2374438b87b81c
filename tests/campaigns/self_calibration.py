"""What sets of additional parameters bring back of the accuracy that an uncorrected camera costs.

    python -m tests.campaigns.self_calibration 5 [--first 1] [--lens k1=5e-9,k2=-2.2e-13,b1=1e-4] [--preset rc30]

Each block is simulated twice from one seed: with an error-free camera, and with one whose lens distortion nobody
corrects. Printed is the truth RMSE of all points over that of the error-free camera, X, Y and Z: mean and standard
deviation over the blocks, and the largest of all; and sigma0.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated

LENS = {"k1": 5e-9, "k2": -2.2e-13, "b1": 1e-4}
SETS: tuple[tuple[str, dict[str, Any] | None], ...] = (
    ("none", None),
    ("brown_conrady", {"set": "brown_conrady"}),
    ("brown21", {"set": "brown21"}),
    ("ebner12", {"set": "ebner12"}),
    ("ebner12, interior: false", {"set": "ebner12", "interior": False}),
    ("gruen44", {"set": "gruen44"}),
    ("bauer3", {"set": "bauer3"}),
    ("legendre", {"set": "legendre"}),
    ("fourier", {"set": "fourier"}),
)


def outcomes(seed: int, lens: dict[str, float], preset: str, use_positions: bool) -> Iterator[tuple[str, Float, float]]:
    """Name of the set, truth RMSE over that of the error-free camera, sigma0."""
    error_free = _started(simulated(seed, preset=preset, camera={"distortion": "none"}))
    reference = _rmse_m(error_free[0], _adjusted(error_free, None, use_positions))
    camera = {"distortion": "brown", "brown": lens, "distortion_known": False}
    distorted = _started(simulated(seed, preset=preset, camera=camera))
    for name, options in SETS:
        solution = _adjusted(distorted, options, use_positions)
        yield name, _rmse_m(distorted[0], solution) / reference, solution.sigma0


def _started(block: Block) -> tuple[Block, ImagePoints, Solution]:
    refined = systematic(block, affine(block))
    strips = scale_transfer(block, dependent(block, refined))
    return block, refined, similarity(block, strips, refined)


def _adjusted(
    started: tuple[Block, ImagePoints, Solution], wanted: dict[str, Any] | None, use_positions: bool
) -> Solution:
    options = {"interior_unknowns": True, "self_calibration": wanted, "positions": {"use": use_positions}}
    return bundle(*started, options=BundleOptions.model_validate(options))


def _rmse_m(block: Block, solution: Solution) -> Float:
    assert block.true_points is not None
    return np.asarray(np.sqrt(np.nanmean((solution.points.xyz_m - block.true_points.xyz_m) ** 2, axis=0)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("blocks", type=int)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--lens", type=_lens, default=LENS)
    parser.add_argument("--preset", default="rc30")
    parser.add_argument("--without-positions", action="store_true")
    given = parser.parse_args()
    found: dict[str, list[Float]] = {name: [] for name, _ in SETS}
    for seed in range(given.first, given.first + given.blocks):
        for name, ratio, sigma0 in outcomes(seed, given.lens, given.preset, not given.without_positions):
            found[name].append(np.append(ratio, sigma0))
    lines = ["| `self_calibration` | X | Y | Z | largest | sigma0 |", "|---|---|---|---|---|---|"]
    for name, rows in found.items():
        table = np.array(rows)
        mean, scatter = table.mean(axis=0), table.std(axis=0, ddof=1) if len(table) > 1 else np.full(4, np.nan)
        cells = [f"{m:.2f} ± {s:.2f}" for m, s in zip(mean[:3], scatter[:3])]
        lines.append(f"| {name} | {' | '.join(cells)} | {table[:, :3].max():.2f} | {mean[3]:.3f} |")
    sys.stdout.write("\n".join(lines) + "\n")


def _lens(text: str) -> dict[str, float]:
    return {name: float(value) for name, value in (part.split("=") for part in text.split(","))}


if __name__ == "__main__":
    main()
