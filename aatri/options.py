"""Options of stages and of kinds of observations: frozen pydantic models, unknown names refused."""

from pydantic import BaseModel, ConfigDict


class Options(BaseModel):
    """Base of all options."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True, allow_inf_nan=False)
