"""Test of single fiducial marks for gross errors, and whether the worst of them can be located.

    R_i = I - K_i N^-1 K_i',   gross error R_i^-1 v_i,   statistic sqrt(v_i' R_i^-1 v_i / 2)

with everything whitened. Two marks cannot be told apart where their residuals span the same space: the largest
canonical correlation of R_i^-1/2 R_ij R_j^-1/2 is near 1.

Source: Baarda 1968; Foerstner 1983 for the separability of two errors.
"""

import numpy as np

from aatri.arrays import Bool, Float, Int

ALIKE = 0.99
"""Two marks whose residuals correlate by more cannot be told apart."""

UNCONTROLLED = 1e-6
"""A smaller eigenvalue of R_i means that an error in this direction does not show."""


def tests_of_marks(
    K: Float, residual_mm: Float, root_weight: Float, used: Bool, redundancy: Int, determined: Bool
) -> tuple[Float, Bool]:
    """Tests of all marks of n images with up to m marks; NaN where uncontrolled.

    Parameters
    ----------
    K : (n, m, 2, k) float64
        Derivatives of the transformed marks to the parameters.
    residual_mm, root_weight : (n, m, 2) float64, mm and 1/mm
        Root weight 0 where a mark is not used.
    used : (n, m) bool
    redundancy : (n,) int64
    determined : (n,) bool

    Returns
    -------
    test : (n, m) float64
    separable : (n, m) bool
        No other mark explains the residuals as well.
    """
    n, m = used.shape
    design = K * root_weight[..., None]
    rows = design.reshape(n, 2 * m, K.shape[-1])
    q, _ = np.linalg.qr(np.where(determined[:, None, None], rows, 0.0))
    projector = -np.einsum("nai,nbi->nab", q, q)
    projector += np.eye(2 * m)
    blocks = projector.reshape(n, m, 2, m, 2).transpose(0, 1, 3, 2, 4)
    own = blocks[:, np.arange(m), np.arange(m)]
    values, vectors = np.linalg.eigh(own)
    controlled = used & determined[:, None] & (redundancy > 0)[:, None] & (values > UNCONTROLLED).all(axis=2)
    safe = np.where(controlled[..., None], np.maximum(values, UNCONTROLLED), 1.0)
    v = np.where(used[..., None], residual_mm * root_weight, 0.0)
    along = np.einsum("nmij,nmi->nmj", vectors, v)
    test = np.sqrt((along**2 / safe).sum(axis=2) / 2)
    root = np.einsum("nmij,nmj,nmkj->nmik", vectors, 1.0 / np.sqrt(safe), vectors)
    between = np.einsum("nmab,nmkbc,nkcd->nmkad", root, blocks, root)
    correlation = np.linalg.svd(between, compute_uv=False)[..., 0]
    both = controlled[:, :, None] & controlled[:, None, :] & ~np.eye(m, dtype=bool)
    separable = np.asarray(~(both & (correlation > ALIKE)).any(axis=2))
    return np.where(controlled, test, np.nan), separable


def located(test: Float, separable: Bool, redundancy: Int, limit: float) -> Int:
    """Per image the mark to reject, or -1: the largest test statistic, if no other mark explains it as well."""
    size = np.where(np.isnan(test), -1.0, test)
    worst = size.argmax(axis=1) if size.shape[1] else np.zeros(len(size), dtype=np.int64)
    rows = np.arange(len(size))
    good = (size[rows, worst] > limit) & (redundancy >= 4) & separable[rows, worst]
    return np.where(good, worst, -1)
