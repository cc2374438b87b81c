"""Effects of further parameters on rays, reduced by the eliminated blocks, unit by unit.

With the whitened effects H of the parameters of a unit on its rays, c = B'H of a block that they meet, D = L L' and
U = L^-1 c, what is left of them for the kept unknowns x is

    A'(H - B L^-T U),     H'H - U'U,     H'v - U'y            summed over rays and blocks,  y = L^-1 B'v
"""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from aatri.adjustment.elimination.chunks import linearised
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.elimination.schedule import Stretch
from aatri.adjustment.kernels.reduce_effects import reduce_effects
from aatri.adjustment.records import Records
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int

GAP = 16
"""Blocks that are linearised without need rather than begin anew behind them."""


class Effects(Protocol):
    """Derivatives of residuals by further parameters, (n, m, k): an array, or what makes those of the rows asked for.

    Of all image points of a block, by all that a camera may be wrong in, they are larger than the image points.
    """

    @property
    def shape(self) -> tuple[Any, ...]:
        """n, m and k."""

    def __getitem__(self, rows: Any, /) -> Any:
        """Those of some rows, a new array."""


@dataclass(frozen=True)
class WhitenedEffects:
    """Effects of which so many are whitened as are asked for at a time: those of all image points are large."""

    records: Records
    rows: Int
    """(n,). Of the records."""
    H: Effects
    order: Int
    """(n,). Row of H of each."""

    @property
    def shape(self) -> tuple[int, ...]:
        """n, m and k."""
        return len(self.rows), *self.H.shape[1:]

    def __getitem__(self, part: slice, /) -> Float:
        """Those of some rows, whitened."""
        return whitened_effects(self.records, self.rows[part], self.H[self.order[part]])


def whitened_effects(records: Records, rows: Int, H: Float) -> Float:
    """Whitened, in the place of H where no matrices are needed; zero where a record is not active."""
    L = records.whitener[rows]
    L = np.where(records.active[rows].reshape(-1, *[1] * (L.ndim - 1)), L, 0.0)
    return np.multiply(L[:, :, None], H, out=H) if L.ndim == 2 else L @ H


def reduced_effects(
    problem: IndexedProblem,
    factored: Factored,
    state: State,
    ray: Int,
    H: Effects,
    unit: Int,
    sums: tuple[Float, Float, Float],
) -> Float:
    """Reduce effects on rays.

    Parameters
    ----------
    ray : (e,) int64
        Places among the rays, ascending; one that belongs to several units comes several times.
    H : (e, m, k) float64, or what makes them
        Whitened; zero where the ray is not active.
    unit : (e,) int64
    sums : (u, k), (u, k), (u, k, k) float64
        Added to: the diagonal of H'H; gradient and information with the kept unknowns held.

    Returns
    -------
    (n_kept, u * k) float64
        Right-hand sides of the kept unknowns; zero for held scalars.
    """
    rays, fill, k = problem.rays, problem.ray_lane(state), H.shape[2]
    assert rays is not None
    kept = np.zeros((problem.layout.n_kept, len(sums[0]) * k))
    met = np.unique(np.searchsorted(rays.ray_start, ray, side="right") - 1)
    for blocks in np.split(met, np.flatnonzero(np.diff(met) > GAP) + 1) if len(met) else ():
        stretch = Stretch(0, 0, int(blocks[0]), int(blocks[-1]) + 1)
        for p0, p1, v, A, B in linearised(problem, fill, stretch, masked=False):
            base, last = rays.ray_start[[p0, p1]].tolist()
            chunk = slice(*np.searchsorted(ray, [base, last]))
            rows = (p0, p1, base, rays.ray_start, v, A, B, problem.ray_columns[base:last])
            blocks_of_rows = (problem.block_free, factored.block_factor, factored.block_y)
            effects = (ray[chunk], unit[chunk], H[chunk], kept, *sums)
            reduce_effects(*rows, rays.parts.size, rays.parts.start, *blocks_of_rows, *effects)
    kept[problem.layout.fixed] = 0.0
    return kept
