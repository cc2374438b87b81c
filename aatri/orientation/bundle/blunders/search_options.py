"""Options of the search for gross errors."""

from typing import Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from aatri.adjustment.statistics.limits import limit_of_tests
from aatri.adjustment.statistics.weight_functions import BOUNDS, Weighting
from aatri.options import Options

Method = Literal["robust_snooping", "data_snooping", "robust", "none"]

Sigmas = Literal["estimated", "tests", "given"]


class SearchOptions(Options):
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

    _tests: int = PrivateAttr(0)

    @property
    def k(self) -> float:
        """Bound of the weight function."""
        return BOUNDS[self.weights] if self.bound is None else self.bound

    @property
    def w_limit(self) -> float:
        """|w| above which an observation is rejected: as stated, or that of all tests together."""
        return limit_of_tests(self._tests) if self.limit is None else self.limit

    def for_tests(self, tests: int) -> Self:
        """The options where so many tests are made together."""
        options = self.model_copy()
        options._tests = tests
        return options
