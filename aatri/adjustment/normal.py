"""Normal equations with the eliminated blocks taken out: the Schur complement.

With the Jacobian of the kept unknowns A and that of the eliminated ones E, whitened,

    N = A'A,   C = E'A,   D = E'E (block diagonal),   g = A'v,   h = E'v
    (N - C' D^-1 C) dx = -(g - C' D^-1 h),    dy = -D^-1 (h + C dx)

D = L L' block by block; Z = L^-1 C is formed once and the reduced matrix is N - Z'Z. Levenberg-Marquardt damping adds
`damping` times the diagonal. Held scalars have no column.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from aatri.adjustment.records import Records, whitened
from aatri.adjustment.unknowns import State, Unknowns

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Layout:
    """Columns of the unknowns.

    Attributes
    ----------
    kept, eliminated : dict of str to (n, k) int64
        Column of each scalar among the kept or the eliminated unknowns; -1 where it is held.
    n_kept : int
    n_blocks : int
        Number of eliminated blocks, each of `block_size` columns, held ones included.
    block_size : int
    """

    kept: dict[str, Int]
    eliminated: dict[str, Int]
    n_kept: int
    n_blocks: int
    block_size: int


def layout_of(unknowns: Sequence[Unknowns]) -> Layout:
    """Number the columns: kept groups in their order, then the eliminated group.

    Raises
    ------
    ValueError
        If more than one group is eliminated.
    """
    kept: dict[str, Int] = {}
    eliminated: dict[str, Int] = {}
    n_kept, n_blocks, block_size = 0, 0, 1
    for u in unknowns:
        if u.eliminated:
            if eliminated:
                raise ValueError("only one group may be eliminated")
            n_blocks, block_size = u.free.shape
            columns = np.arange(u.free.size, dtype=np.int64).reshape(u.free.shape)
            eliminated[u.name] = np.where(u.free, columns, -1)
        else:
            columns = n_kept + np.cumsum(u.free.ravel(), dtype=np.int64).reshape(u.free.shape) - 1
            kept[u.name] = np.where(u.free, columns, -1)
            n_kept += int(u.free.sum())
    return Layout(kept, eliminated, n_kept, n_blocks, block_size)


@dataclass(frozen=True)
class NormalEquations:
    """Reduced normal equations and what back substitution needs.

    Attributes
    ----------
    reduced : csc matrix (n_kept, n_kept)
    right : (n_kept,) float64
        Right-hand side of the reduced equations.
    Z : csr matrix (n_blocks * k, n_kept)
        L^-1 C.
    D_factor : (n_blocks, k, k) float64
        Lower Cholesky factors L; a held scalar has a unit row.
    y : (n_blocks, k) float64
        L^-1 h.
    D_lowest : (n_blocks,) float64
        Smallest eigenvalue of each D scaled to unit diagonal: the rank of the eliminated block.
    gradient_kept : (n_kept,) float64
    gradient_eliminated : (n_blocks, k) float64
    diagonal_kept : (n_kept,) float64
    diagonal_eliminated : (n_blocks, k) float64
        Diagonals of N and D, undamped.
    cost : float
        v'v.
    """

    reduced: sp.csc_matrix
    right: Float
    Z: sp.csr_matrix
    D_factor: Float
    y: Float
    D_lowest: Float
    gradient_kept: Float
    gradient_eliminated: Float
    diagonal_kept: Float
    diagonal_eliminated: Float
    cost: float


def form(records: Sequence[Records], layout: Layout, state: State, damping: float = 0.0) -> NormalEquations:
    """Form the reduced normal equations at a state."""
    A, E, v = jacobian(records, layout, state)
    N, g = (A.T @ A).tocsc(), A.T @ v
    D, h, C = _eliminated(E, A, v, layout)
    diagonals = N.diagonal(), np.einsum("nii->ni", D).copy()
    if damping > 0:
        N = N + sp.diags(damping * N.diagonal(), format="csc")
        k = np.arange(layout.block_size)
        D[:, k, k] *= 1 + damping
    D_lowest = _lowest(D)
    safe = np.where((D_lowest > 0)[:, None, None], D, np.eye(layout.block_size))
    L = np.linalg.cholesky(safe)
    L_inverse: Float = np.linalg.inv(L).astype(np.float64, copy=False)
    Z = (_block_diagonal(L_inverse) @ C).tocsr()
    y = np.einsum("nij,nj->ni", L_inverse, h)
    reduced = (N - Z.T @ Z).tocsc()
    return NormalEquations(reduced, -(g - Z.T @ y.ravel()), Z, L, y, D_lowest, g, h, *diagonals, float(v @ v))


def back_substitute(normal: NormalEquations, dx: Float) -> Float:
    """Steps of the eliminated blocks.

    Returns
    -------
    (n_blocks, k) float64
    """
    right = -(normal.y + (normal.Z @ dx).reshape(normal.y.shape))
    upper = np.swapaxes(normal.D_factor, 1, 2)
    return np.asarray(np.linalg.solve(upper, right[:, :, None])[:, :, 0])


def cost_of(records: Sequence[Records], state: State) -> float:
    """v'v at a state."""
    return float(sum((whitened(r, state, np.arange(len(r.active)))[0] ** 2).sum() for r in records))


def jacobian(records: Sequence[Records], layout: Layout, state: State) -> tuple[sp.csr_matrix, sp.csr_matrix, Float]:
    """Whitened Jacobians of the kept and the eliminated unknowns, and residuals.

    Returns
    -------
    A : csr matrix (m, n_kept)
    E : csr matrix (m, n_blocks * k)
    v : (m,) float64
    """
    parts: dict[bool, list[tuple[Float, Int, Int]]] = {True: [], False: []}
    residuals, start = [], 0
    for r in records:
        v, jacobians = whitened(r, state, np.arange(len(r.active)))
        n, m = v.shape
        row = start + np.arange(n * m).reshape(n, m)
        for (group, blocks), J in zip(r.touches, jacobians):
            is_kept = group in layout.kept
            columns = (layout.kept if is_kept else layout.eliminated)[group][blocks]
            column = np.broadcast_to(columns[:, None, :], J.shape)
            use = column >= 0
            parts[is_kept].append((J[use], np.broadcast_to(row[:, :, None], J.shape)[use], column[use]))
        residuals.append(v.ravel())
        start += n * m
    shapes = {True: (start, layout.n_kept), False: (start, layout.n_blocks * layout.block_size)}
    A, E = (_csr(parts[kept], shapes[kept]) for kept in (True, False))
    return A, E, np.concatenate(residuals) if residuals else np.zeros(0)


def _csr(parts: list[tuple[Float, Int, Int]], shape: tuple[int, int]) -> sp.csr_matrix:
    if not parts:
        return sp.csr_matrix(shape)
    data, row, column = (np.concatenate(arrays) for arrays in zip(*parts))
    return sp.csr_matrix((data, (row, column)), shape=shape)


def _eliminated(E: sp.csr_matrix, A: sp.csr_matrix, v: Float, layout: Layout) -> tuple[Float, Float, sp.csr_matrix]:
    n, k = layout.n_blocks, layout.block_size
    EE = (E.T @ E).tocoo()
    D = np.zeros((n, k, k))
    D[EE.row // k, EE.row % k, EE.col % k] = EE.data
    held = np.ones(n * k, dtype=bool)
    for columns in layout.eliminated.values():
        held[columns[columns >= 0]] = False
    block, scalar = np.divmod(np.flatnonzero(held), k)
    D[block, scalar, scalar] = 1.0
    return D, (E.T @ v).reshape(n, k), (E.T @ A).tocsr()


def _lowest(D: Float) -> Float:
    """Smallest eigenvalue of each block scaled to unit diagonal; not positive where it is singular."""
    diagonal = np.einsum("nii->ni", D)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    unit = D / (scale[:, :, None] * scale[:, None, :])
    lowest = np.linalg.eigvalsh(unit)[:, 0] if len(D) else np.zeros(0)
    return np.asarray(np.where((diagonal > 0).all(axis=1), lowest, 0.0))


def _block_diagonal(blocks: Float) -> sp.bsr_matrix:
    n, k = blocks.shape[:2]
    return sp.bsr_matrix((blocks, np.arange(n), np.arange(n + 1)), shape=(n * k, n * k))
