"""Options of stages and of kinds of observations: frozen pydantic models; declarations that many stages have."""

from typing import Annotated, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

Reliability: TypeAlias = Annotated[
    bool, Field(description="redundancy numbers, test statistics and detectable errors of all observations")
]
LimitOfTies: TypeAlias = Annotated[
    float | None,
    Field(gt=0, description="test statistic of a wrong tie or control point, in sigma; null: by the number of tests"),
]


class Options(BaseModel):
    """Base of all options; unknown names are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True, allow_inf_nan=False)
