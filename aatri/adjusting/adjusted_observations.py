"""Observations of one kind after an adjustment: what residuals, tests and tables of any stage are made from."""

from __future__ import annotations

from dataclasses import dataclass

from aatri.adjustment.records import Records
from aatri.adjustment.residuals import residuals
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.observations.observed import Observed


@dataclass(frozen=True)
class AdjustedObservations:
    """Observations of one kind after the adjustment.

    Attributes
    ----------
    observed : Observed
    rows : (k,) int
        Rows that take part: used, or rejected and predicted.
    used : (n,) bool
        Of all rows: they determine the result.
    covariance : (n, m, m) float64
        Covariance of the adjusted (rejected: predicted) values over the a-priori standard deviations: I minus it is the
        cofactor of the whitened residuals (I plus it that of the prediction error); NaN unknown.
    weighted : Records, optional
        The records with the weights of the adjustment, where they are not those a priori: whitened by these.
    """

    observed: Observed
    rows: Int
    used: Bool
    covariance: Float
    weighted: Records | None = None

    @property
    def records(self) -> Records:
        """The records as they were adjusted."""
        return self.observed.records if self.weighted is None else self.weighted

    def residuals(self, state: State) -> Float:
        """Computed minus observed of the rows that take part, (k, m)."""
        return residuals(self.observed.records, state, self.rows)
