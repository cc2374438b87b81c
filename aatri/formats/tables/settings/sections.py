"""What the sections of block.yaml share: strict mappings, and kinds of numbers.

Unknown keys are errors, keys that start with `x_` are ignored.
"""

from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator


def broadcast(value: Any) -> Any:
    """One number for three."""
    return [value] * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def pair(value: Any) -> Any:
    """One number for two."""
    return [value] * 2 if isinstance(value, int | float) and not isinstance(value, bool) else value


Positive = Annotated[float, Field(gt=0)]
Sigma = Annotated[float, Field(ge=0)]
Two = Annotated[list[float], Field(min_length=2, max_length=2)]
TwoPositive = Annotated[list[Positive], BeforeValidator(pair), Field(min_length=2, max_length=2)]
Three = Annotated[list[float], Field(min_length=3, max_length=3)]
ThreeSigmas = Annotated[list[Sigma], BeforeValidator(broadcast), Field(min_length=3, max_length=3)]
FreeSigma = Annotated[float, Field(ge=0, allow_inf_nan=True)]
ThreeFreeSigmas = Annotated[list[FreeSigma], BeforeValidator(broadcast), Field(min_length=3, max_length=3)]


class FaultAt(ValueError):
    """A fault of one of the keys of the section that is checked."""

    def __init__(self, what: str, *keys: str) -> None:
        super().__init__(what)
        self.keys = keys


class YamlSection(BaseModel):
    """A mapping of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _without_own_keys(cls, value: Any) -> Any:
        if isinstance(value, dict):
            return {key: item for key, item in value.items() if not str(key).startswith("x_")}
        return value
