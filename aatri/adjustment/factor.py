"""Factor of the reduced normal matrix: dense Cholesky while it is small, sparse LU beyond.

The matrix is scaled to unit diagonal first, so that pivots and eigenvalues are free of units. A matrix that is not
positive definite within `RANK_TOLERANCE` is reported with the names of the unknowns in its null vectors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.linalg as sl
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from aatri.adjustment.dense import RANK_TOLERANCE
from aatri.errors import GeometryError

Float = npt.NDArray[np.float64]

DENSE_LIMIT = 6000
"""Up to this many unknowns the matrix is factorised densely."""


@dataclass(frozen=True)
class Factor:
    """A factorised matrix: `solve` for right-hand sides, `inverse` where it is dense enough to be had."""

    size: int
    scale: Float
    _solve: Callable[[Float], Float]
    dense: bool

    def solve(self, right: Float) -> Float:
        """Solution for one or more right-hand sides, (n,) or (n, m)."""
        scale = self.scale if right.ndim == 1 else self.scale[:, None]
        return np.asarray(self._solve(right / scale) / scale)

    def inverse(self) -> Float:
        """The whole inverse, (n, n)."""
        return self.solve(np.eye(self.size))


def factorise(matrix: sp.csc_matrix, name_of: Callable[[int], str]) -> Factor:
    """Factorise a symmetric positive definite matrix.

    Parameters
    ----------
    matrix : csc matrix (n, n)
    name_of : callable
        Column -> name of the unknown, for messages.

    Raises
    ------
    GeometryError
        If the matrix is rank deficient; the message names the unknowns.
    """
    n = matrix.shape[0]
    diagonal = matrix.diagonal()
    if not np.isfinite(diagonal).all() or (n and diagonal.min() <= 0):
        bad = np.flatnonzero(~(diagonal > 0))
        raise GeometryError(_text([name_of(int(k)) for k in bad[:5]], len(bad)))
    scale = np.sqrt(diagonal)
    inverse_scale = sp.diags(1.0 / scale)
    unit = inverse_scale @ matrix @ inverse_scale
    if n <= DENSE_LIMIT:
        return Factor(n, scale, _dense(unit.toarray(), name_of), True)
    return Factor(n, scale, _sparse(unit.tocsc(), name_of), False)


def _dense(unit: Float, name_of: Callable[[int], str]) -> Callable[[Float], Float]:
    lower, info = sl.lapack.dpotrf(unit, lower=1)
    weak = info != 0 or (len(unit) and np.diag(lower).min() ** 2 < RANK_TOLERANCE)
    if weak:
        values, vectors = np.linalg.eigh(unit)
        null = vectors[:, values < RANK_TOLERANCE]
        if info != 0 or null.shape[1]:
            raise GeometryError(_describe(null if null.shape[1] else vectors[:, :1], name_of))

    def solve(right: Float) -> Float:
        return np.asarray(sl.cho_solve((lower, True), right, check_finite=False))

    return solve


def _sparse(unit: sp.csc_matrix, name_of: Callable[[int], str]) -> Callable[[Float], Float]:
    lu: Any = spl.splu(unit, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    pivots = lu.U.diagonal()
    weak = np.flatnonzero(~(pivots >= RANK_TOLERANCE))
    if len(weak):
        column = lu.perm_c.argsort()[weak[0]] if hasattr(lu, "perm_c") else weak[0]
        null = np.zeros((unit.shape[0], 1))
        null[column] = 1.0
        raise GeometryError(_describe(null, name_of))
    return lambda right: np.asarray(lu.solve(right))


def _describe(null: Float, name_of: Callable[[int], str]) -> str:
    texts = []
    for vector in null.T[:7]:
        largest = np.argsort(-np.abs(vector), kind="stable")[:4]
        members = [name_of(int(k)) for k in largest if abs(vector[k]) > 0.3 * abs(vector[largest[0]])]
        texts.append(" with ".join(members))
    return _text(texts, null.shape[1])


def _text(texts: list[str], defect: int) -> str:
    more = f" and {defect - len(texts)} more" if defect > len(texts) else ""
    return f"the observations leave {defect} unknown(s) open: {'; '.join(texts)}{more}"
