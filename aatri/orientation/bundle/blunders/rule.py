"""How gross errors are searched for: stated once, by the options of the stage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from aatri.adjustment.statistics.weight_functions import BOUNDS, Weighting

Method = Literal["robust_snooping", "data_snooping", "robust", "none"]


@dataclass(frozen=True)
class Rule:
    """How gross errors are searched for.

    Attributes
    ----------
    method : str
        `robust_snooping`: data snooping from a robust adjustment; `data_snooping`: from least squares; `robust`: a
        robust adjustment alone, not one of least squares in the end; `none`.
    weights : str
        Weight function of the robust adjustment.
    bound : float, optional
        Of the weight function, in standard deviations; default: that of the function.
    limit : float
        |w| above which an observation is rejected.
    tau : bool
        The tests are standardised by the sigma0 of the adjustment.
    max_share : float
        Largest share of a kind that is rejected.
    """

    method: Method = "robust_snooping"
    weights: Weighting = "huber"
    bound: float | None = None
    limit: float = 4.0
    tau: bool = False
    max_share: float = 0.05

    @property
    def k(self) -> float:
        """Bound of the weight function."""
        return BOUNDS[self.weights] if self.bound is None else self.bound
