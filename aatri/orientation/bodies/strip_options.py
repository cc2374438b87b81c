"""Options of the adjustment of strips: highest degrees, by free strips or by strips of the block, and limits."""

from typing import Annotated

import numpy as np
from pydantic import Field

from aatri.arrays import Int, Text
from aatri.errors import InputError
from aatri.ids import shown
from aatri.options import Options


class StripBlockOptions(Options):
    """Options of a strip block adjustment."""

    degree: int = Field(2, ge=0, le=3, description="highest degree; it falls where control and ties determine less")
    degrees: dict[str, Annotated[int, Field(ge=0, le=3)]] = Field(
        {}, description="highest degree of single strips, by their ids; the others have `degree`"
    )
    limit: float | None = Field(
        None, gt=0, description="test statistic of a wrong tie or control point, in sigma; null: by the number of tests"
    )
    max_sigma0: float | None = Field(
        None,
        gt=0,
        description="an error where strips deform by so many times what their length explains; null: a warning "
        "beyond 20 times",
    )
    reliability: bool = Field(
        False, description="redundancy numbers, test statistics and detectable errors of all observations"
    )

    @property
    def degrees_requested(self) -> bool:
        """A degree is stated: that it falls is a warning then."""
        return bool({"degree", "degrees"} & self.model_fields_set)

    @property
    def highest_degree(self) -> int:
        """Of all strips."""
        return max(self.degree, *self.degrees.values()) if self.degrees else self.degree

    def degrees_of(self, names: Text) -> Int:
        """Highest degree of every strip, (n_strips,).

        Parameters
        ----------
        names : (n_strips,) str
            Ids of free strips: those of the block, with .1 .2 ... where a strip is broken.

        Raises
        ------
        InputError
            If an id is that of no strip.
        """
        degrees = np.full(len(names), self.degree)
        ids = [str(name) for name in names]
        unsplit = [name.rpartition(".")[0] if name.rpartition(".")[2].isdigit() else name for name in ids]
        for strip, value in self.degrees.items():
            of_name = [k for k, name in enumerate(ids) if name == strip]
            of_name = of_name or [k for k, name in enumerate(unsplit) if name == strip]
            if not of_name:
                raise InputError(
                    f"`degrees` names strip {strip}, which is not among the strips {shown(ids)}",
                    remedy="give ids of free strips, as the log of strip formation lists them",
                )
            degrees[of_name] = value
        return degrees
