"""Movements between two simulated epochs: how many are found, beside what the noncentral distribution says.

    python -m tests.campaigns.epochs --count 50 [--first 1] [--points 150 --moved 10]

A free network of 150 points is observed twice by 12 images (made up: errors of a common covariance, from the normal
equations of a bundle); ten points move by 1 to 10 standard deviations of their displacement. With P of the points that
stand still (aatri/evaluation/congruence.py) a movement s_k is found with the probability

    P(chi2(3, s_k' P_kk s_k) > limit),    limit of one test: 1 - (1 - level)^(1/m).

A point j that stood still is named beside moved ones by chance, at the level of one test, or because a missed movement
moves its test. With P of all but those named rightly, its test is

    chi2(3, g' P_jj^-1 g),    g = sum P_jk s_k over the missed ones,

at most rho^2 of the missed one's noncentrality, rho the largest canonical correlation of two tests. Both sums are
expected counts; pairs of epochs without movement in which any point is named are held against the level.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.stats import binom, chi2, ncx2, poisson

from aatri.evaluation.congruence import congruence
from aatri.evaluation.epochs import datum_directions

IMAGES, LEVEL = 12, 0.05

ALARM = 1e-3
"""Probability, for each of the three counts, of exit code 1 by chance."""


def made_up_network(rng: np.random.Generator, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Places of points, and their covariance in a bundle of 12 images with a free datum (closed by a weak prior)."""
    xyz_m = rng.uniform([-50, -50, -5], [50, 50, 5], (points, 3))
    stations = np.column_stack([np.linspace(-60, 60, IMAGES), rng.uniform(-60, 60, IMAGES), np.full(IMAGES, 80.0)])
    N = np.zeros((6 * IMAGES + 3 * points,) * 2)
    for i, station in enumerate(stations):
        for j in np.flatnonzero(rng.random(points) < 0.5):
            x, y, z = xyz_m[j] - station
            to_point = 5000.0 / z * np.array([[1, 0, -x / z], [0, 1, -y / z]])  # pixels a metre, c = 5000
            turned = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
            A = np.hstack([-to_point, to_point @ turned, to_point])
            own = np.r_[6 * i : 6 * i + 6, 6 * IMAGES + 3 * j : 6 * IMAGES + 3 * j + 3]
            N[np.ix_(own, own)] += A.T @ A
    return xyz_m, np.linalg.inv(N + 1e-3 * np.eye(len(N)))[6 * IMAGES :, 6 * IMAGES :]


@dataclass(frozen=True)
class Pair:
    """Outcome of one pair of epochs with movements and one without."""

    found: int
    found_expected: float
    beside: int
    """Points named that stood still."""
    beside_expected: float
    alarm: bool
    """Whether any point is named in the pair without movement."""


def one_pair(seed: int, points: int, moving: int) -> Pair:
    """Two epochs, compared."""
    rng = np.random.default_rng(seed)
    xyz_m, C = made_up_network(rng, points)
    H, L, rows = datum_directions(xyz_m, "similarity"), np.linalg.cholesky(C), np.arange(3 * points).reshape(-1, 3)
    noise = [L @ rng.standard_normal(3 * points) for _ in range(4)]
    moved = rng.choice(points, moving, replace=False)
    weight = np.linalg.inv(2 * C)
    P = weight - weight @ H @ np.linalg.solve(H.T @ weight @ H, H.T @ weight)
    s, limit, expected = np.zeros(3 * points), chi2.isf(1 - (1 - LEVEL) ** (1 / points), 3), 0.0
    for k in moved:
        direction = rng.standard_normal(3)
        own = np.linalg.cholesky(np.linalg.inv(P[np.ix_(rows[k], rows[k])]))
        s[rows[k]] = rng.uniform(1.0, 10.0) * own @ (direction / np.linalg.norm(direction))
    for k in moved:
        still = _without(P, rows, moved[moved != k])
        expected += float(ncx2.sf(limit, 3, _test(still, s, rows[k])))
    object_of = np.repeat(np.arange(points), 3)
    named = np.flatnonzero(congruence(noise[1] - noise[0] + s, 2 * C, object_of, H, level=LEVEL).moved)
    alarm = congruence(noise[3] - noise[2], 2 * C, object_of, H, level=LEVEL).moved.any()
    rightly, others = np.intersect1d(named, moved), np.setdiff1d(np.arange(points), moved)
    rest = _without(P, rows, rightly)
    smeared = [_test(rest, np.where(np.isin(object_of, rightly), 0.0, s), rows[j]) for j in others]
    by_chance = float(ncx2.sf(limit, 3, np.maximum(smeared, 1e-12)).sum())
    return Pair(len(rightly), expected, len(named) - len(rightly), by_chance, bool(alarm))


def _without(P: np.ndarray, rows: np.ndarray, free: np.ndarray) -> np.ndarray:
    """P of the other points where some are free to move."""
    J = rows[free].ravel()
    return P - P[:, J] @ np.linalg.solve(P[np.ix_(J, J)], P[J])


def _test(P: np.ndarray, d: np.ndarray, own: np.ndarray) -> float:
    v = P[own] @ d
    return float(v @ np.linalg.solve(P[np.ix_(own, own)], v))


def main() -> int:
    """Run the campaign; 1 if a count is out of its band."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("count", 50), ("first", 1), ("points", 150), ("moved", 10)):
        parser.add_argument(f"--{name}", type=int, default=default)
    a = parser.parse_args()
    pairs = [one_pair(seed, a.points, a.moved) for seed in range(a.first, a.first + a.count)]
    n, movements = len(pairs), a.moved * len(pairs)
    found, beside, alarms = sum(p.found for p in pairs), sum(p.beside for p in pairs), sum(p.alarm for p in pairs)
    expected, by_chance = sum(p.found_expected for p in pairs), sum(p.beside_expected for p in pairs)
    print(  # noqa: T201
        f"{n} pairs: {found} of {movements} movements found, {expected:.1f} expected\n"
        f"{beside} points named beside them in {sum(p.beside > 0 for p in pairs)} pairs, {by_chance:.1f} expected\n"
        f"{alarms} pairs without movement with an alarm ({LEVEL:.0%} stated)"
    )
    too_far = abs(found - expected) > 3.3 * np.sqrt(max(expected * (1 - expected / movements), 1.0))
    return int(too_far or poisson.sf(beside - 1, by_chance) < ALARM or binom.sf(alarms - 1, n, LEVEL) < ALARM)


if __name__ == "__main__":
    raise SystemExit(main())
