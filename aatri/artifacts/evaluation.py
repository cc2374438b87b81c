"""Evaluation: empirical and theoretical accuracy of a Solution, summarised and per point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from aatri.arrays import Float, Int, Text
from aatri.tables.schema import Artifact, Table, attribute, column, table


@dataclass(frozen=True, eq=False)
class Figures(Table):
    """Figures of accuracy, by name; what was not determined has no row."""

    name: Text = column("str", doc="name, with unit: check_rmse_x_m ...")
    value: Float = column("f8", doc="value in the unit of the name")


@dataclass(frozen=True, eq=False)
class Differences(Table):
    """Differences at control, check and new points: solution minus given, or minus truth."""

    point: Text = column("str", doc="id of the point")
    kind: Text = column("str", doc="control, left_out (control predicted without itself), check or truth")
    difference_m: Float = column("f8", 3, unit="m", doc="difference; NaN where the coordinate does not take part",
                                 optional=True)  # fmt: skip
    sigma_m: Float = column("f8", 3, unit="m", doc="theoretical standard deviation; NaN unknown", optional=True)
    rays: Int = column("i4", doc="image points used")


@dataclass(frozen=True, eq=False)
class Evaluation(Artifact):
    """Accuracy of a Solution."""

    kind: ClassVar[str] = "Evaluation"
    schema_version: ClassVar[int] = 1

    verdict: str = attribute(doc="one sentence: what is known of the accuracy, and from what")
    figures: Figures = table()
    differences: Differences = table()

    def metrics(self) -> dict[str, float | int | None]:
        """All figures; counts as integers."""
        values = zip(self.figures.name, self.figures.value)
        return {str(n): int(v) if str(n).endswith("_points") else _plain(float(v)) for n, v in values}


def _plain(value: float) -> float | None:
    return None if np.isnan(value) else value
