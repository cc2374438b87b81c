"""Are results what their covariances say, with every kind of observation, alone and all at once?

    python -m tests.campaigns.kinds --count 100 [--only zenith]

Blocks of ten images on the ellipsoid, with four control points, as `block/simulate` makes them: every kind by its own
forward model, with normal errors of the standard deviations given. Each kind alone beside image points and control,
then all at once. Over all blocks of a case:

- sigma0: the sum of v'Pv over the sum of redundancies, chi-square;
- the share of |w| above 3.29: 0.1 % expected;
- NEES: d'C^-1 d / n of single points and poses against the truth, whose mean is 1; neighbours are correlated, so that
  its band comes from the scatter of the means of the blocks.

Bands are at the level 1 - 0.01 / (4 cases) each.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import binom, chi2, t

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.geometry.rotations import log_rotation
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.geodetic_blocks import made

BOUND = 3.29
N = 12
"""Observations of a kind, or conditions of two."""

RELATIVE = (
    "distance",
    "equal_distance",
    "coordinate_difference",
    "plane",
    "vertical_plane",
    "horizontal_plane",
    "equal_height",
    "line",
    "plumb_line",
    "horizontal_line",
    "angle",
    "parallel",
    "perpendicular",
    "sphere",
    "cylinder",
)
NONE: dict[str, Any] = {"gnss": {"observed": False}}
CASES: dict[str, dict[str, Any]] = {
    "control": NONE | {"known": {"full": 6, "plan": 3, "height": 6}},
    "position": {},
    "drift": {"gnss": {"shift_m": 0.3, "drift_m_per_s": 0.02}, "known": {"full": 9}},
    "attitude": NONE | {"imu": {"observed": True, "rotation": "roll-pitch-heading"}},
    "boresight": {"imu": {"observed": True, "boresight_deg": (0.3, -0.2, 1.0), "boresight": "free"}},
    "rig": {
        "rig": {
            "side": {
                "position_m": (0.4, 0.1, 0.0),
                "angles_deg": (0.0, 25.0, 0.0),
                "error_deg": (0.0, 0.05, 0.0),
                "free": True,
            }
        }
    },
    "distance": NONE | {"survey": {"distances": N}},
    "distance of a group": NONE | {"survey": {"distances": N, "distance_scale": 5e-5, "distance_addition_m": -0.03}},
    "distance to an image": NONE | {"survey": {"image_distances": N}},
    "horizontal distance": NONE | {"survey": {"horizontal_distances": N}},
    "distance on the ellipsoid": NONE | {"survey": {"ellipsoid_distances": N}},
    "distance in the map": NONE | {"survey": {"map_distances": N}},
    "direction": NONE | {"survey": {"direction_sets": 4}},
    "azimuth": NONE | {"survey": {"azimuths": N}},
    "angle": NONE | {"survey": {"angles": N}},
    "zenith": NONE | {"survey": {"zenith_angles": N}},
    "height_difference": NONE | {"survey": {"height_differences": N}},
    "coordinate_difference": NONE | {"survey": {"baselines": N}},
    **{f"relative {name}": NONE | {"survey": {"relative": {name: 2}}} for name in RELATIVE},
}
ALL: dict[str, Any] = {
    "gnss": {"shift_m": 0.3, "drift_m_per_s": 0.02},
    "imu": CASES["boresight"]["imu"],
    "rig": CASES["rig"]["rig"],
    "survey": {
        "distances": N,
        "distance_scale": 5e-5,
        "distance_addition_m": -0.03,
        "image_distances": N,
        "horizontal_distances": N,
        "ellipsoid_distances": N,
        "map_distances": N,
        "direction_sets": 4,
        "azimuths": N,
        "angles": N,
        "zenith_angles": N,
        "height_differences": N,
        "baselines": N,
        "relative": dict.fromkeys(RELATIVE, 1),
    },
}
TOGETHER = "all at once"


@dataclass(frozen=True)
class Found:
    """Figures of one block."""

    squares: float
    redundancy: int
    tests: int
    beyond: int
    of_points: float
    of_poses: float
    kinds: int


def one_block(case: str, seed: int) -> Found:
    """Simulate and adjust one block of a case."""
    block = made(seed, 1000.0, **(ALL if case == TOGETHER else CASES[case]))
    options: dict[str, Any] = {"reliability": True, "blunders": "none", "max_sigma0": 1e9}
    if case in ("drift", TOGETHER):
        options["positions"] = {"drift": "linear"}
    solution = bundle(block, calibrated(block), options=BundleOptions.model_validate(options))
    tests = solution.tests
    assert tests is not None
    w = tests.test[np.isfinite(tests.test)]
    of_points, of_poses = nees(block, solution)
    return Found(
        solution.sigma0**2 * solution.redundancy,
        solution.redundancy,
        len(w),
        int((np.abs(w) > BOUND).sum()),
        of_points,
        of_poses,
        len(set(solution.residuals.kind.tolist())),
    )


def nees(block: Block, solution: Solution) -> tuple[float, float]:
    """Mean of d'C^-1 d / n over the points, and over the poses."""
    points, images = block.true_points, block.true_images
    assert points is not None
    assert images is not None
    d = solution.points.xyz_m[points.point] - points.xyz_m
    known = np.isfinite(d).all(axis=1)
    C = solution.points.covariance_m2[points.point][known]
    of_points = float(np.einsum("ni,ni->n", d[known], np.linalg.solve(C, d[known][..., None])[..., 0]).mean() / 3)
    R = solution.images.ground_from_image[images.image] @ images.ground_from_image.swapaxes(1, 2)
    e = np.concatenate([solution.images.position_m[images.image] - images.position_m, log_rotation(R)], axis=1)
    C = solution.images.covariance[images.image]
    return of_points, float(np.einsum("ni,ni->n", e, np.linalg.solve(C, e[..., None])[..., 0]).mean() / 6)


def judged(found: list[Found], level: float) -> list[tuple[bool, str]]:
    """Every figure with its band."""
    n = len(found)
    r, squares = sum(f.redundancy for f in found), sum(f.squares for f in found)
    low, high = (float(chi2.ppf(p, r)) / r for p in (level / 2, 1 - level / 2))
    lines = [(low < squares / r < high, f"sigma0 squared {squares / r:.4f} ({low:.4f} to {high:.4f})")]
    tests, beyond = sum(f.tests for f in found), sum(f.beyond for f in found)
    low, high = (float(binom.ppf(p, tests, 0.001)) for p in (level / 2, 1 - level / 2))
    lines.append((low <= beyond <= high, f"{beyond} of {tests} tests beyond 3.29 ({low:.0f} to {high:.0f})"))
    for name in ("of_points", "of_poses"):
        mean = np.array([getattr(f, name) for f in found])
        band = float(t.ppf(1 - level / 2, n - 1) * mean.std(ddof=1) / np.sqrt(n)) if n > 2 else np.inf
        lines.append((abs(mean.mean() - 1) < band, f"NEES {name[3:]} {mean.mean():.4f} (1 +- {band:.4f})"))
    return lines


def main(count: int, only: str = "") -> int:
    cases = [c for c in (*CASES, TOGETHER) if only in c]
    wrong = 0
    for case in cases:
        found = [one_block(case, seed) for seed in range(1, count + 1)]
        lines = judged(found, 0.01 / (4 * (len(CASES) + 1)))
        wrong += sum(not ok for ok, _ in lines)
        said = "; ".join(text + ("" if ok else " WRONG") for ok, text in lines)
        print(f"{case} ({found[0].kinds} kinds): {said}", flush=True)  # noqa: T201
    return 1 if wrong else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--only", default="", help="cases whose name contains this")
    chosen = parser.parse_args()
    raise SystemExit(main(chosen.count, chosen.only))
