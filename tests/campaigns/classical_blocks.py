"""Accuracy and reliability of classical blocks: layouts that leave heights open, more overlap, positions.

    python -m tests.campaigns.classical_blocks

The blocks of `ackermann`: RMS over new points in units of sigma0 at the ground, from covariances; control is exact.
With control every 4b along the perimeter, or in four corners, strips can turn about the single rows of points between
them: heights are open, plan is not. There every new point gets a height with a standard deviation of 10,000 sigma0,
which closes the heights and says nothing of plan. 60 % side overlap: n strips of n + 1 images b apart, so that the
block is square. Positions: 8 strips of 17, four corners, positions without drift. Accepted: 3 % of the reference.
Reliability: 4 strips, one point at each position, control of 0.5 sigma0; minima over points of three images, and how
large a gross error must be to be found.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aatri.adjustment.statistics.limits import DELTA0
from tests.campaigns.ackermann import BASE_M, C_MM, SCALE, SIGMA_M, Regular, adjusted, perimeter, regular, rms

OPEN_M = 1e4 * SIGMA_M
TOLERANCE = 0.03

EVERY_4B = {2: 1.60, 4: 1.22, 6: 1.11, 8: 1.05}
CORNERS = {2: 1.60, 4: 2.43, 6: 3.40, 8: 4.42}
SIXTY = {4: 0.77, 8: 0.67, 12: 0.64}
"""Plan of blocks of so many strips."""

POSITIONS = {0.5: (0.90, 1.47), 1: (0.95, 1.56), 2: (1.07, 1.76), 5: (1.40, 2.38), 10: (1.87, 3.32), 20: (2.54, 4.95)}
"""Plan and height by the standard deviation of the positions, sigma0 at the ground."""

LEAST = {"x": 0.092, "y": 0.175}
"""Least redundancy numbers of points of three images."""


def plan(block: Regular, every: int) -> float:
    """RMS in plan over new points, exact control every so many b along the perimeter, heights closed."""
    columns, rows = _along(block.columns, every), _along(block.rows, every)
    ends = np.array([0, block.rows - 1]), np.array([0, block.columns - 1])
    known = np.concatenate([block.at(columns, ends[0]), block.at(ends[1], rows)])
    control = {int(p): (np.inf, OPEN_M) for p in range(len(block.points))}
    result = adjusted(block, {**control, **{int(p): (0.0, 0.0) for p in known}})
    new = ~np.isin(np.arange(len(result.xyz_m)), known)
    variance = np.einsum("nii->ni", result.point_covariance_m2)[new, :2]
    return float(np.sqrt(variance.mean()) / SIGMA_M)


def _along(count: int, every: int) -> np.ndarray:
    return np.unique(np.append(np.arange(0, count, every), count - 1))


def with_sixty_percent(strips: int) -> Regular:
    """Strips b apart, n + 1 images in each."""
    s, k = np.indices((strips, strips + 1)).reshape(2, -1)
    height = np.full(len(s), C_MM * SCALE / 1e3 / BASE_M)
    stations = np.column_stack([k, s, height]) * BASE_M
    return Regular(stations, s, np.zeros(len(s), bool), strips + 1, strips + 2)


def with_positions(sigma: float) -> tuple[float, float]:
    """Plan and height of 8 strips, four corners, positions of so many sigma0."""
    block = regular(8, 17)
    corners = block.at(np.array([0, block.columns - 1]), np.array([0, block.rows - 1]))
    control = {int(p): (0.0, 0.0) for p in corners}
    return rms(adjusted(block, control, sigma_gps=sigma * SIGMA_M), control)


def reliability() -> tuple[dict[str, float], tuple[float, float], tuple[float, float]]:
    """Least r of points of three images in x and y; detectable errors of image coordinates; of control heights."""
    block = regular(4, 9)
    control = perimeter(block, 0.5 * SIGMA_M)
    result = adjusted(block, control)
    rays = result.observations[0]
    r = 1.0 - np.einsum("nii->ni", rays.covariance)
    point = dict(rays.observed.records.touches)["point"]
    three = (np.bincount(point)[point] == 3) & ~np.isin(point, list(control))
    found = DELTA0 / np.sqrt(r[three])
    of_control = next(o for o in result.observations if o.observed.kind == "control")
    heights = 1.0 - of_control.covariance[:, 2, 2]
    limits = tuple(float(DELTA0 / np.sqrt(x)) for x in (heights.max(), heights.min()))
    return (
        dict(zip("xy", r[three].min(axis=0).tolist())),
        (float(np.median(found)), float(found.max())),
        (limits[0], limits[1]),
    )


def compared() -> Iterator[tuple[bool, str]]:
    """Every figure beside that of the reference."""
    for strips, own in EVERY_4B.items():
        yield _near(f"perimeter every 4b, {strips} strips: plan", plan(regular(strips, 2 * strips + 1), 4), own)
    for strips, own in CORNERS.items():
        yield _near(f"four corners, {strips} strips: plan", plan(regular(strips, 2 * strips + 1), 10**6), own)
    for strips, own in SIXTY.items():
        yield _near(f"60 % side overlap, {strips} strips: plan", plan(with_sixty_percent(strips), 2), own)
    for sigma, both in POSITIONS.items():
        for name, value, own in zip(("plan", "height"), with_positions(sigma), both):
            yield _near(f"positions of {sigma} sigma0: {name}", value, own)
    least, image, height = reliability()
    for axis, own in LEAST.items():
        yield _near(f"least r of three images, {axis}", least[axis], own)
    yield _near("largest detectable error of three images, sigmas", image[1], 13.6)
    text = f"detectable errors: median {image[0]:.1f} (6.5 to 8.3), control heights {height[0]:.0f} to {height[1]:.0f}"
    yield 6.5 <= image[0] <= 8.3, f"{text} (18 to 32) sigmas"


def _near(what: str, value: float, own: float) -> tuple[bool, str]:
    return abs(value / own - 1) <= TOLERANCE, f"{what} {value:.3f}, reference {own}"


def main() -> int:
    """Tell all; 1 if anything is beyond the tolerance."""
    lines = list(compared())
    for ok, text in lines:
        print(f"{'ok   ' if ok else 'WRONG'} {text}", flush=True)  # noqa: T201
    return 0 if all(ok for ok, _ in lines) else 1


if __name__ == "__main__":
    raise SystemExit(main())
