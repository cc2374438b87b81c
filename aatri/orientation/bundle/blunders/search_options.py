"""How gross errors are searched for: stated once, by the options of the stage."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from aatri.adjustment.statistics.limits import LEAST_LIMIT, limit_of_tests
from aatri.adjustment.statistics.weight_functions import BOUNDS, Weighting

Method = Literal["robust_snooping", "data_snooping", "robust", "none"]

Sigmas = Literal["estimated", "tests", "given"]


@dataclass(frozen=True)
class SearchOptions:
    """How gross errors are searched for."""

    method: Method = "robust_snooping"
    """`robust_snooping`: data snooping from a robust adjustment; `data_snooping`: from least squares, or as
    `robust_snooping` where these do not converge; `robust`: a robust adjustment alone, not one of least squares in the
    end; `none`."""
    weights: Weighting = "huber"
    """Weight function of the robust adjustment."""
    bound: float | None = None
    """Of the weight function, in standard deviations; default: that of the function."""
    limit: float = LEAST_LIMIT
    """|w| above which an observation is rejected."""
    counts: bool = True
    """The limit is that of all tests together, see `for_tests`."""
    tau: bool = False
    """The tests are standardised by the sigma0 of the adjustment."""
    max_share: float | None = None
    """Largest share of a kind that is rejected; default: what its redundancy answers for."""
    sigmas: Sigmas = "estimated"
    """`estimated`: tests and weights with standard deviations that fit the residuals, where the given ones do not;
    `tests`: the tests alone; `given`: as they are."""

    @property
    def k(self) -> float:
        """Bound of the weight function."""
        return BOUNDS[self.weights] if self.bound is None else self.bound

    def for_tests(self, tests: int) -> SearchOptions:
        """The options with the limit of so many tests, unless the user has stated one."""
        return replace(self, limit=limit_of_tests(tests)) if self.counts else self
