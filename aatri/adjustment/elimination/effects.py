"""Effects of further parameters on rays, reduced by the eliminated blocks, unit by unit.

With the whitened effects H of the parameters of a unit on its rays, c = B'H of a block that they meet, D = L L' and
U = L^-1 c, what is left of them for the kept unknowns x is

    A'(H - B L^-T U),     H'H - U'U,     H'v - U'y            summed over rays and blocks,  y = L^-1 B'v

What the kept unknowns take up of further parameters is formed for many units in one pass up the tree. With the factor N
= L L' of the reduced normal equations, sparse right-hand sides c of each unit and the gradient g = A'v of the kept
unknowns,

    U = L^-1 c,    y = L^-1 g,    c'N^-1 c = U'U,    c'N^-1 g = U'y        unit by unit

A front meets the units that touch its own unknowns or those below it, and passes on what is left of their right-hand
sides at its boundary. Each panel is read once, for all units together, and no U of all kept unknowns is in memory.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.sparse import csr_array

from aatri.adjustment.elimination import lapack
from aatri.adjustment.elimination.chunks import linearised
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.elimination.schedule import Schedule, Stretch
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


@dataclass(frozen=True)
class _Passed:
    """What a node passes on to its parent."""

    units: Int
    """(a,) int64, ascending. Those that it has met."""
    boundary: Float
    """(boundary, a k). What is left of their right-hand sides."""
    squares: Float
    products: Float
    """(a, k, k), (a, k). U'U and U'y of the node and of those below it."""


def unit_products(problem: IndexedProblem, factored: Factored, right: csr_array, k: int) -> tuple[Float, Float]:
    """U'U and U'y of each unit.

    Parameters
    ----------
    right : (n_kept, u k) csr_array
        Right-hand sides, the k of a unit beside each other; zero for held scalars.
    k : int
        Parameters of a unit.

    Returns
    -------
    squares, products : (u, k, k), (u, k) float64
        Summed in the order of the tree: the same bits for any number of threads, as far as BLAS gives them.
    """
    nodes, n = problem.tree.nodes, right.shape[1] // k
    passed: list[_Passed | None] = [None] * len(nodes)

    def finish(node: int) -> None:
        passed[node] = _at_node(problem, factored, right, k, node, passed)
        for child in nodes[node].children:
            passed[child] = None

    Schedule.of(problem).up(_nothing, finish)
    squares, products = np.zeros((n, k, k)), np.zeros((n, k))
    for last in passed:  # those of the roots
        if last is not None:
            squares[last.units] += last.squares
            products[last.units] += last.products
    return squares, products


def _nothing(_node: int, _pool: ThreadPoolExecutor | None) -> None:
    """There is nothing to assemble but what a node finds in the right-hand sides."""


def _at_node(
    problem: IndexedProblem, factored: Factored, right: csr_array, k: int, node: int, passed: list[_Passed | None]
) -> _Passed | None:
    front, maps = problem.tree.nodes[node], problem.tree.maps
    m = front.panel
    own = right[front.columns[:m]]
    below = [(maps[child], part) for child in front.children if (part := passed[child]) is not None]
    units = np.unique(np.concatenate([own.indices // k, *(part.units for _, part in below)])).astype(np.int64)
    if not len(units):
        return None
    x = np.zeros((front.size, len(units) * k), order="F")
    row = np.repeat(np.arange(m), np.diff(own.indptr))
    x[row, np.searchsorted(units, own.indices // k) * k + own.indices % k] = own.data
    squares, products = np.zeros((len(units), k, k)), np.zeros((len(units), k))
    for rows, part in below:
        at = np.searchsorted(units, part.units)
        x[np.ix_(rows, (at[:, None] * k + np.arange(k)).ravel())] += part.boundary
        squares[at] += part.squares
        products[at] += part.products
    if m:
        lapack.forward_columns(factored.factor.panel(node), x)
        U = x[:m].reshape(m, len(units), k).transpose(1, 2, 0)
        squares += U @ U.swapaxes(1, 2)
        products += U @ factored.y[node]
    return _Passed(units, x[m:].copy(), squares, products)  # without U
