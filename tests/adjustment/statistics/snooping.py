"""Data snooping: remove the observation with the largest test statistic, adjust again, re-admit what fits after all.

For a record of one or more whitened residuals v with cofactor R = I - J Q J' of the residuals, the estimated gross
error is -R^-1 v (in standard deviations) and the test statistic sqrt(v' R^-1 v / rows), for a single residual
w = |v| / sqrt(r). A record without redundancy (r below `UNCONTROLLED`) cannot be tested and is never removed.

Source: Baarda 1968; Foerstner 1980. Rejected records are tested for re-admission with the final solution: their
prediction error over its standard deviation sqrt(1 + j'Qj).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from aatri.adjustment.statistics.reliability import UNCONTROLLED
from aatri.arrays import Bool, Float
from aatri.errors import GeometryError
from tests.adjustment.dense import DenseResult

S = TypeVar("S")


@dataclass(frozen=True)
class SnoopedResult(Generic[S]):
    """Result of an adjustment with data snooping.

    Attributes
    ----------
    result : DenseResult
        Adjustment of the active records.
    active : (n,) bool
        Records not rejected.
    size : (n, m) float64
        Estimated gross error of each record over its sigma, observed minus what it should be.
    test : (n,) float64
        Test statistic; NaN where uncontrolled.
    """

    result: DenseResult[S]
    active: Bool
    size: Float
    test: Float


def snoop(
    solve: Callable[[Bool, S], DenseResult[S]],
    linearise: Callable[[S], tuple[Float, Float]],
    start: S,
    n_records: int,
    *,
    limit: float = 4.0,
    max_share: float = 0.3,
    active: Bool | None = None,
) -> SnoopedResult[S]:
    """Adjust with data snooping.

    Parameters
    ----------
    solve : callable
        `solve(active, state)`: adjust with the active records from the given state. Its result may have rows beyond
        those of the records (priors); they come last and are not tested.
    linearise : callable
        state -> (v (n, m), J (n, m, u)) of all records, whitened, also of inactive ones.
    start : S
    n_records : int
    limit : float
        Records with a larger test statistic are rejected.
    max_share : float
        At most this share of the records is rejected.
    active : (n,) bool, optional
        Records to begin with; the others are tested for re-admission.
    """
    use = np.ones(n_records, dtype=bool) if active is None else active.copy()
    result = solve(use, start)
    for _ in range(2 * n_records):
        size, test = statistics(linearise, result, use)
        candidates = np.where(use & np.isfinite(test), test, -1.0)
        worst = int(np.argmax(candidates)) if candidates.max() > 0 else -1
        fitting = np.flatnonzero(~use & (test < limit))
        if worst >= 0 and test[worst] > limit and (~use).sum() < max_share * n_records:
            use[worst] = False
        elif len(fitting) and not (worst >= 0 and test[worst] > limit):
            best = int(fitting[np.argmin(test[fitting])])
            use[best] = True
            trial = solve(use, result.state)
            if statistics(linearise, trial, use)[1][best] < limit:
                result = trial
                continue
            use[best] = False
            break
        else:
            break
        try:
            result = solve(use, result.state)
        except GeometryError:
            use[worst] = True
            break
    size, test = statistics(linearise, result, use)
    return SnoopedResult(result, use, size, test)


def statistics(
    linearise: Callable[[S], tuple[Float, Float]], result: DenseResult[S], active: Bool
) -> tuple[Float, Float]:
    """Estimated gross error and test statistic of every record, see the module's text.

    Returns
    -------
    size : (n, m) float64
    test : (n,) float64
    """
    v, J = linearise(result.state)
    m = v.shape[1]
    spread = np.einsum("nik,kl,njl->nij", J, result.covariance, J)
    eye = np.eye(m)
    cofactor = np.where(active[:, None, None], eye - spread, eye + spread)
    values, vectors = np.linalg.eigh(cofactor)
    controlled = values > UNCONTROLLED
    projected = np.einsum("nji,nj->ni", vectors, v)
    scaled = np.where(controlled, projected / np.where(controlled, values, 1.0), 0.0)
    size = np.einsum("nij,nj->ni", vectors, scaled)
    size = -np.where(active[:, None], size, v)
    rows = controlled.sum(axis=1)
    test = np.where(rows > 0, np.sqrt((projected * scaled).sum(axis=1) / np.maximum(rows, 1)), np.nan)
    return size, test
