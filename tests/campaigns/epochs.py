"""Movements between two simulated epochs: how many are found, beside what the noncentral distribution says.

    python -m tests.campaigns.epochs --count 50

A free network of 150 points is observed twice by 12 images (made up: errors of a common covariance, from the normal
equations of a bundle); ten points move by 1 to 10 standard deviations of their displacement. Found: moved points
that are named, against the sum of the probabilities with which each should be. False: pairs of epochs without movement
in which any point is named, against the level.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.stats import chi2, ncx2

from aatri.evaluation.congruence import congruence
from aatri.evaluation.epochs import datum_directions

POINTS, MOVED, LEVEL = 150, 10, 0.05


def made_up_network(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Places of points, and their covariance in a bundle of 12 images with a free datum (closed by a weak prior)."""
    xyz_m = rng.uniform([-50, -50, -5], [50, 50, 5], (POINTS, 3))
    stations = np.column_stack([np.linspace(-60, 60, 12), rng.uniform(-60, 60, 12), np.full(12, 80.0)])
    N = np.zeros((6 * 12 + 3 * POINTS,) * 2)
    for i, station in enumerate(stations):
        for j in np.flatnonzero(rng.random(POINTS) < 0.5):
            x, y, z = xyz_m[j] - station
            to_point = 5000.0 / z * np.array([[1, 0, -x / z], [0, 1, -y / z]])  # pixels a metre, c = 5000
            turned = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
            A = np.zeros((2, len(N)))
            A[:, 6 * i : 6 * i + 3], A[:, 6 * i + 3 : 6 * i + 6] = -to_point, to_point @ turned
            A[:, 72 + 3 * j : 75 + 3 * j] = to_point
            N += A.T @ A
    return xyz_m, np.linalg.inv(N + 1e-3 * np.eye(len(N)))[72:, 72:]


def one_pair(seed: int) -> tuple[int, float, int, bool]:
    """Movements found, expected, points named wrongly beside them, and whether a pair without movement alarms."""
    rng = np.random.default_rng(seed)
    xyz_m, C = made_up_network(rng)
    H, L = datum_directions(xyz_m, "similarity"), np.linalg.cholesky(C)
    object_of = np.repeat(np.arange(POINTS), 3)
    noise = [L @ rng.standard_normal(3 * POINTS) for _ in range(4)]
    moved = rng.choice(POINTS, MOVED, replace=False)
    own = congruence(np.zeros(3 * POINTS), 2 * C, object_of, H, level=LEVEL).covariance
    d, limit, expected = noise[1] - noise[0], chi2.isf(1 - (1 - LEVEL) ** (1 / POINTS), 3), 0.0
    for k in moved:
        size = rng.uniform(1.0, 10.0)
        direction = rng.standard_normal(3)
        d[3 * k : 3 * k + 3] += size * np.linalg.cholesky(own[k]) @ (direction / np.linalg.norm(direction))
        expected += float(ncx2.sf(limit, 3, size**2))
    result = congruence(d, 2 * C, object_of, H, level=LEVEL)
    still = congruence(noise[3] - noise[2], 2 * C, object_of, H, level=LEVEL)
    named = np.flatnonzero(result.moved)
    return int(np.isin(named, moved).sum()), expected, int((~np.isin(named, moved)).sum()), bool(still.moved.any())


def main() -> int:
    """Run the campaign; 1 if a rate is out of its band."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--first", type=int, default=1)
    arguments = parser.parse_args()
    pairs = [one_pair(seed) for seed in range(arguments.first, arguments.first + arguments.count)]
    found, expected, wrong, alarms = (float(sum(p[k] for p in pairs)) for k in range(4))
    n = len(pairs)
    print(  # noqa: T201
        f"{n} pairs: {found:.0f} of {MOVED * n} movements found, {expected:.1f} expected\n"
        f"{wrong:.0f} points named beside them, {alarms:.0f} pairs without movement with an alarm ({LEVEL:.0%} stated)"
    )
    band = 3 * np.sqrt(max(expected * (1 - expected / (MOVED * n)), 1.0))
    alarms_band = LEVEL * n + 3 * np.sqrt(LEVEL * n)
    return int(abs(found - expected) > band or alarms > alarms_band or wrong > alarms_band)


if __name__ == "__main__":
    raise SystemExit(main())
