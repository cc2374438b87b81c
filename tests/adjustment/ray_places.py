"""Rays of blocks on the places of a front, of any sizes, and their dense Jacobians."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.kernels.eliminate import GROUP
from aatri.arrays import Bool, Float, Int

BASE = 5
"""Number of the first ray: that of the row of a chunk is less by it."""

SIZES = ((2, (6,)), (3, (7,)), (3, (15,)), (1, (4,)), (2, (6, 10)), (3, (4, 2, 3)))
"""Residuals, and unknowns of each part of a ray."""


def _neighbourhoods(rng: np.random.Generator, images: int, points: int) -> list[list[int]]:
    found = []
    for _ in range(points):
        first = int(rng.integers(0, images - 4))
        found.append(sorted(rng.choice(np.arange(first, first + 5), size=rng.integers(2, 5), replace=False).tolist()))
    return sorted(found)


PLACES = {
    "like blocks, more than one group": [[0, 1, 2]] * (2 * GROUP + 3),
    "nearly like blocks": _neighbourhoods(np.random.default_rng(1), 12, 70),
    "blocks that meet nothing in common": [[0, 1], [2, 3], [4, 5], [6, 7]],
    "one block of many rays": [list(range(120))],
    "several rays of one image": [[0, 0, 1], [0, 1, 1], [1, 1, 1]],
    "poses that are held": [[-1, 0, 2], [0, 1, -1], [-1, -1]],
}
"""The image of every ray of every block; -1 where it is held."""


@dataclass(frozen=True)
class RaysOnPlaces:
    """Rays as the kernels take them; image k has `wide` unknowns from k wide on, those of other parts follow."""

    ray_start: Int
    loc: Int
    size: Int
    start: Int
    v: Float
    A: Float
    B: Float
    columns: int

    @property
    def blocks(self) -> int:
        """Number of blocks."""
        return len(self.ray_start) - 1

    def rows(self, p: int) -> Int:
        """Rows of the rays of a block."""
        return np.arange(self.ray_start[p], self.ray_start[p + 1]) - BASE

    def jacobian(self, rows: Int, active: Bool) -> Float:
        """Dense Jacobian to all kept unknowns, (rows m, columns), zero where not active."""
        m = self.A.shape[1]
        J = np.zeros((m * len(rows), self.columns))
        for i, r in enumerate(rows):
            for c, k, s in zip(self.loc[r], self.size, self.start):
                if c >= 0 and active[r]:
                    J[m * i : m * i + m, c : c + k] += self.A[r, :, s : s + k]
        return J


def rays_on(places: list[list[int]], m: int, parts: tuple[int, ...], seed: int) -> RaysOnPlaces:
    """Random rays: the first part is of the image, each other one of one of two cameras; some of these are held."""
    rng = np.random.default_rng(seed)
    image = np.array([c for rays in places for c in rays])
    images = 1 + max(int(image.max()), 0)
    loc, columns = [np.where(image >= 0, parts[0] * image, -1)], images * parts[0]
    for size in parts[1:]:
        loc.append(np.where(rng.uniform(size=len(image)) < 0.1, -1, columns + size * (image % 2)))
        columns += 2 * size
    n, size = len(image), np.array(parts, dtype=np.int32)
    ray_start = BASE + np.concatenate([[0], np.cumsum([len(rays) for rays in places])]).astype(np.int64)
    A, B = rng.normal(size=(n, m, int(size.sum()))), rng.normal(size=(n, m, 3))
    start = (np.cumsum(size) - size).astype(np.int32)
    return RaysOnPlaces(
        ray_start, np.stack(loc, axis=1).astype(np.int32), size, start, rng.normal(size=(n, m)), A, B, columns
    )
