"""Observations of one kind after an adjustment: what residuals, tests and tables of any stage are made from."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.records import Records, residuals
from aatri.adjustment.statistics.variance_components import GroupSigmas, group_sigmas
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.observations.observed import Observed


@dataclass(frozen=True)
class AdjustedObservations:
    """Observations of one kind after the adjustment."""

    observed: Observed
    rows: Int
    """(k,). Rows that take part: used, or rejected and predicted."""
    used: Bool
    """(n,). Of all rows: they determine the result."""
    covariance: Float
    """(n, m, m). Covariance of the adjusted (rejected: predicted) values over the a-priori standard deviations: I minus
    it is the cofactor of the whitened residuals (I plus it that of the prediction error); NaN unknown."""
    weighted: Records | None = None
    """The records with the weights of the adjustment, where they are not those a priori: whitened by these."""

    @property
    def records(self) -> Records:
        """The records as they were adjusted."""
        return self.observed.records if self.weighted is None else self.weighted

    def residuals(self, state: State) -> Float:
        """Computed minus observed of the rows that take part, (k, m)."""
        return residuals(self.observed.records, state, self.rows)


def classes_of(o: Observed, labels: Sequence[str] = ("",), label: Int | None = None) -> tuple[list[str], Int]:
    """Classes of a kind that have standard deviations of their own: names, and the class of every component.

    Parameters
    ----------
    labels : sequence of str
        What tells its rows apart.
    label : (n,) int, optional
        Which of these each row has; default: the first.

    Returns
    -------
    names : list of str
    number : (n, m) int64
    """
    parts = o.parts or (("", tuple(range(o.records.rows))),)
    component = np.zeros(o.records.rows, dtype=np.int64)
    for k, (_, components) in enumerate(parts):
        component[list(components)] = k * len(labels)
    names = [" ".join(filter(None, (o.kind, part, more))) for part, _ in parts for more in labels]
    return names, (np.zeros(len(o), dtype=np.int64) if label is None else label).reshape(-1, 1) + component


def sigmas_of_groups(
    observations: Sequence[AdjustedObservations], state: State, number: Sequence[Int], n_groups: int
) -> GroupSigmas:
    """Factors on the standard deviations of groups, from the residuals of what is used.

    Parameters
    ----------
    number : sequence of (n, m) int
        Group of every component of each of the observations; -1 none.
    """
    parts: list[tuple[Float, Float, Int]] = [(np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64))]
    parts += [_squares_and_redundancy(o, state, group) for o, group in zip(observations, number)]
    squares, redundancy, group = (np.concatenate(columns) for columns in zip(*parts))
    return group_sigmas(squares, redundancy, group.astype(np.int64), n_groups)


def _squares_and_redundancy(adjusted: AdjustedObservations, state: State, number: Int) -> tuple[Float, Float, Int]:
    """v_i (P v)_i, (Qvv P)_ii and group of the components in use."""
    o = adjusted.observed
    rows = np.flatnonzero(adjusted.used)
    if o.exact or not len(rows):
        return np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64)
    L = adjusted.records.whitener[rows]
    v = o.records.evaluate(state, rows)[0]
    hat = adjusted.covariance[rows]
    if L.ndim == 2:
        squares, r = (L * v) ** 2, 1.0 - np.einsum("nii->ni", hat)
    else:
        white = np.einsum("nij,nj->ni", L, v)
        squares = v * np.einsum("nji,nj->ni", L, white)
        # (Qvv P)_ii = (L^-1 (I - H) L)_ii; components that are not observed are left out of L
        both = adjusted.records.observed_components()[rows]
        filled = np.where(both[:, :, None] & both[:, None, :], L, np.eye(L.shape[1]))
        r = np.einsum("nij,njk,nki->ni", np.linalg.inv(filled), np.eye(L.shape[1]) - hat, filled)
    used = adjusted.records.observed_components()[rows]
    return squares[used], r[used], np.where(used, number[rows], -1)[used]
