"""Exact covariances of the unknowns, a priori (sigma0 = 1).

With the inverse Q of the reduced normal matrix, an eliminated block with factor L and row Z of `normal` has

    Q_yy = L^-T (I + Z Q Z') L^-1,

and only the columns of Q that Z touches are needed. Held scalars have zero covariance.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aatri.adjustment.solve import Adjusted

Float = npt.NDArray[np.float64]


def kept_inverse(adjusted: Adjusted) -> Float:
    """Covariance of all kept unknowns, (n_kept, n_kept)."""
    return adjusted.factor.inverse()


def block_covariances(adjusted: Adjusted, group: str, Q: Float) -> Float:
    """Covariance of every block of a kept group.

    Parameters
    ----------
    adjusted : Adjusted
    group : str
    Q : (n_kept, n_kept) float64

    Returns
    -------
    (n, k, k) float64
    """
    columns = adjusted.layout.kept[group]
    held = columns < 0
    blocks = Q[columns[:, :, None], columns[:, None, :]] if Q.size else np.zeros((*columns.shape, columns.shape[1]))
    return np.where(held[:, :, None] | held[:, None, :], 0.0, blocks)


def eliminated_covariances(adjusted: Adjusted, Q: Float) -> Float:
    """Covariance of every eliminated block, (n_blocks, k, k); blocks with as many kept columns are done together."""
    normal, k = adjusted.normal, adjusted.layout.block_size
    n = len(normal.D_factor)
    inner = np.tile(np.eye(k), (n, 1, 1))
    Z = normal.Z.tocsr()
    Z.sort_indices()
    starts = Z.indptr[::k]
    block_of = np.repeat(np.arange(n), np.diff(starts))
    columns = np.unique(block_of * np.int64(adjusted.layout.n_kept + 1) + Z.indices)
    owner, column = np.divmod(columns, adjusted.layout.n_kept + 1)
    counts = np.bincount(owner, minlength=n)
    offset = np.concatenate([[0], np.cumsum(counts)])
    for count in np.unique(counts[counts > 0]):
        blocks = np.flatnonzero(counts == count)
        for some in np.array_split(blocks, max(1, len(blocks) * int(count) ** 2 // 2_000_000)):
            touched = column[offset[some][:, None] + np.arange(count)]
            rows = _rows(Z, some, touched, k)
            inner[some] += rows @ Q[touched[:, :, None], touched[:, None, :]] @ rows.swapaxes(1, 2)
    L_inverse = np.linalg.inv(normal.D_factor)
    covariance = L_inverse.swapaxes(1, 2) @ inner @ L_inverse
    free = next(u.free for u in adjusted.unknowns if u.eliminated)
    return np.where(free[:, :, None] & free[:, None, :], covariance, 0.0)


def _rows(Z: object, blocks: npt.NDArray[np.int64], touched: npt.NDArray[np.int64], k: int) -> Float:
    """Rows of Z of the blocks, restricted to the columns they touch: (blocks, k, columns)."""
    rows = np.zeros((len(blocks), k, touched.shape[1]))
    indptr, indices, data = Z.indptr, Z.indices, Z.data  # type: ignore[attr-defined]
    for scalar in range(k):
        first, last = indptr[blocks * k + scalar], indptr[blocks * k + scalar + 1]
        length = last - first
        which = np.repeat(np.arange(len(blocks)), length)
        entry = np.repeat(first, length) + np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)
        place = (touched[which] < indices[entry][:, None]).sum(axis=1)
        rows[which, scalar, place] = data[entry]
    return rows
