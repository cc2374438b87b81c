"""What the adjustments of models share: how they iterate, and what counts as wrong."""

from typing import Literal

from aatri.plugin import Field, Options


class ModelAdjustmentOptions(Options):
    """Options of an adjustment of models."""

    iteration: Literal["together", "plan_height"] = Field(
        "together", description="all seven parameters together, or plan (4) and height (3) in turn"
    )
    limit: float | None = Field(
        None, gt=0, description="test statistic of a wrong tie or control point, in sigma; null: by the number of tests"
    )
    max_sigma0: float | None = Field(
        None, gt=0, description="an error where sigma0 is larger; null: a warning beyond 20"
    )
    reliability: bool = Field(
        False, description="redundancy numbers, test statistics and detectable errors of all observations"
    )
