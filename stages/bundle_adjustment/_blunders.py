"""Options of the search for gross errors."""

from typing import Self

from pydantic import model_validator

from aatri.adjustment.statistics.limits import LEAST_LIMIT
from aatri.adjustment.statistics.weight_functions import Weighting
from aatri.orientation.bundle.blunders.search_options import Method, SearchOptions, Sigmas
from aatri.plugin import Field, Options

GONE = {
    "huber": "`huber: K` is now `blunders: {method: robust, weights: huber, bound: K}`",
    "huber_rejects": "`huber_rejects: L` is now `blunders: {method: robust, limit: L}`; `robust_snooping`, the "
    "default, needs no second bundle",
}
"""Options there were, and what to write instead."""


class Blunders(Options):
    """The search for gross errors."""

    method: Method = Field(
        "robust_snooping",
        description="robust_snooping: data snooping from a robust adjustment; data_snooping: from least squares, "
        "robustly where these do not converge; robust: weighted down, not rejected, and without statistics; none",
    )
    weights: Weighting = Field("huber", description="weight function of the robust adjustment")
    bound: float | None = Field(
        None, gt=0, description="bound of the weight function, in standard deviations; default: that of the function"
    )
    limit: float | None = Field(
        None,
        gt=1,
        description="|w| above which an observation is rejected; with robust: named; default: by the number of tests, "
        "so that a block without gross errors loses anything with a chance of 1 %",
    )
    tau: bool = Field(False, description="tests standardised by sigma0 of the adjustment (Pope), not a priori")
    max_share: float | None = Field(
        None, gt=0, le=0.5, description="largest share of a kind that is rejected; default: what its redundancy allows"
    )
    sigmas: Sigmas = Field(
        "estimated",
        description="estimated: where the standard deviations of a class of observations are clearly wrong, tests and "
        "weights follow its residuals; tests: the tests alone; given: as they are",
    )

    @model_validator(mode="after")
    def _of_robust(self) -> Self:
        stated = self.model_fields_set
        if self.method in ("data_snooping", "none") and stated & {"weights", "bound"}:
            raise ValueError(f"weights and bound are those of a robust adjustment: method {self.method} has none")
        if self.method == "none" and stated & {"limit", "tau", "max_share", "sigmas"}:
            raise ValueError("limit, tau, max_share and sigmas are those of a search: method none has none")
        return self

    def search_options(self) -> SearchOptions:
        """The same as the methods take it."""
        limit = LEAST_LIMIT if self.limit is None else self.limit
        return SearchOptions(
            self.method, self.weights, self.bound, limit, self.limit is None, self.tau, self.max_share, self.sigmas
        )
