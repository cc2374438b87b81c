"""Relative orientation without start in many seeded trials: how many end at the truth, and how far off.

A pair sees points before it at depths of 0.7 to 1.3 times D; base over D is drawn from 0.1 to 1; the right image looks
at the middle of the points, turned by any angle about its axis; 20 to 100 points. Image coordinates are projected here;
nothing of the code under test is used for it. A trial succeeds if base and rotation are within 6 of their own standard
deviations (error-free: 1e-6 rad), and not ambiguous.

    python -m tests.campaigns.essential [trials] [outliers, percent]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.relative.essential import essential_orientations

C_MM, PIXEL_MM = 8.8, 0.0024
SIGMA_MM = 0.5 * PIXEL_MM
SIGMAS = 6.0


@dataclass(frozen=True)
class Trial:
    """A pair and its truth."""

    left: Any
    right: Any
    rotation: Any
    base: Any


def trial(rng: np.random.Generator, *, noise: float, outliers: float = 0.0, planar: bool = False) -> Trial:
    """Image coordinates in mm of one pair; noise in standard deviations, outliers a share."""
    n, depth = int(rng.integers(20, 101)), 1.0 / rng.uniform(0.1, 1.0)
    X = np.column_stack([rng.uniform(-0.6, 0.6, (n, 2)), -np.ones(n)])
    X *= depth if planar else depth * rng.uniform(0.7, 1.3, n)[:, None]
    base = rng.normal(size=3)
    base /= np.linalg.norm(base)
    if planar or base[2] < -0.9:
        base[2] = abs(base[2])
    z = base - X.mean(axis=0)
    z /= np.linalg.norm(z)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    R = np.column_stack([x, np.cross(z, x), z]) @ Rotation.from_euler("z", rng.uniform(-np.pi, np.pi)).as_matrix()
    w = (X - base) @ R
    seen = w[:, 2] < 0
    left, right = (-C_MM * u[seen, :2] / u[seen, 2:] for u in (X, w))
    left, right = (xy + noise * rng.normal(0, SIGMA_MM, xy.shape) for xy in (left, right))
    wrong = round(outliers * len(right))
    right[:wrong] = rng.uniform(-0.6 * C_MM, 0.6 * C_MM, (wrong, 2))
    return Trial(left, right, R, base)


def rays_of(trials: list[Trial]) -> tuple[RayPairs, Any]:
    """All pairs, one after the other, and where each begins."""
    left, right = (np.concatenate([getattr(t, side) for t in trials]) for side in ("left", "right"))
    z, sigma = np.full(len(left), -C_MM), np.full((len(left), 2), SIGMA_MM)
    start = np.concatenate([[0], np.cumsum([len(t.left) for t in trials])]).astype(np.int64)
    return RayPairs(np.column_stack([left, z]), np.column_stack([right, z]), sigma, sigma), start


def errors(trials: list[Trial], found: Any) -> tuple[Any, Any]:
    """Errors of rotation and base in rad, larger of both, and the same over their standard deviation."""
    far, ratio = np.full(len(trials), np.inf), np.full(len(trials), np.inf)
    for k, t in enumerate(trials):
        if found.formed[k]:
            turned = Rotation.from_matrix(found.left_from_right[k] @ t.rotation.T).magnitude()
            off = 2 * np.arcsin(min(0.5 * np.linalg.norm(found.base[k] - t.base), 1.0))
            far[k] = max(turned, off)
            ratio[k] = far[k] / np.sqrt(np.linalg.eigvalsh(found.covariance[k])[-1])
    return far, ratio


def campaign(count: int, noise: float, outliers: float, seed: int = 1) -> dict[str, float]:
    """Run so many trials."""
    rng = np.random.default_rng(seed)
    trials = [trial(rng, noise=noise, outliers=outliers) for _ in range(count)]
    made = essential_orientations(*rays_of(trials))
    far, ratio = errors(trials, made.orientations)
    good = (ratio < SIGMAS) if noise else (far < 1e-6)
    ambiguous = np.isfinite(made.second[:, 0, 0])
    return {
        "trials": count,
        "at the truth": int(good.sum()),
        "of these called ambiguous": int((good & ambiguous).sum()),
        "worst, rad": float(far[good].max(initial=0.0)),
        "samples, mean": float(made.samples.mean()),
        "wrong and not told": int((~good & made.orientations.formed & ~ambiguous).sum()),
    }


if __name__ == "__main__":
    trials_wanted = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    wrong_share = float(sys.argv[2]) / 100 if len(sys.argv) > 2 else 0.3
    for of_noise, of_outliers in ((0.0, 0.0), (1.0, 0.0), (1.0, wrong_share)):
        found = campaign(trials_wanted, of_noise, of_outliers)
        sys.stdout.write(f"noise {0.5 * of_noise} px, outliers {of_outliers:.0%}: {found}\n")
