"""Observed values of unknowns themselves: ground coordinates of control, priors of interior unknowns.

v = x - x_observed,    dv/dx = I
"""

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import Ids, State
from aatri.adjustment.whitening import whitener_of_covariances
from aatri.arrays import Bool, Float, Int
from aatri.observations.observed import Observed, named


def value_records(
    name: str, group: str, block: Int, value: Float, covariance: Float, observed: Bool | None = None
) -> Records:
    """Records that observe the blocks of a group directly.

    Parameters
    ----------
    name : str
        Name of the observation type.
    group : str
        Group of unknowns, of plain numbers.
    block : (n,) int32
    value : (n, k) float64
        Only the observed components are looked at.
    covariance : (n, k, k) float64
    observed : (n, k) bool, optional
        Default: all.
    """
    used = np.ones(value.shape, dtype=bool) if observed is None else observed
    target = np.where(used, value, 0.0)
    derivative = np.eye(value.shape[1]) * used[:, :, None]

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        return np.where(used[rows], state[group][block[rows]] - target[rows], 0.0), (derivative[rows],)

    active = np.asarray(used.any(axis=1))
    whitener = whitener_of_covariances(covariance, used)
    return Records(name, ((group, block),), evaluate, whitener, active, linear=True)


def observed_priors(
    kind: str,
    group: str,
    ids: Ids,
    values: Float,
    covariance: Float,
    weighted: Bool,
    labels: tuple[str, ...],
    unit: str = "",
) -> tuple[Observed, ...]:
    """What is known beforehand of the weighted unknowns of a group, v = p - p_prior; nothing where none is weighted.

    Parameters
    ----------
    values, weighted : (n, k)
    covariance : (n, k, k) float64
        Only that among weighted unknowns is looked at.
    """
    rows = np.flatnonzero(weighted.any(axis=1)).astype(np.int32)
    if not len(rows):
        return ()
    records = value_records(kind, group, rows, values[rows], covariance[rows], weighted[rows])
    names = named(image=np.asarray(ids, dtype=np.str_)[rows])
    return (Observed(records, np.full(len(rows), -1), names, unit, components=labels),)
