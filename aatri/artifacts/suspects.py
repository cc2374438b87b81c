"""Suspects: observations a stage tested and did not believe. They travel from stage to stage.

The next stage starts without what was rejected and tests each for re-admission. Observations that nothing controls are
told beside them by every stage that adjusts.
"""

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.tables.schema import Table, column

LEFT_OUT = ("rejected", "undecidable", "swapped")
"""Verdicts with which an observation stays out."""


class Suspects(Table):
    """Observations under suspicion, with the size of their gross error."""

    kind: Text = column("str", doc="image_point, fiducial, control, position, model_tie or strip_tie")
    row: Int = column("i4", doc="row of the observation in its table of the Block; -1 if it has none", optional=True)
    image: Text = column("str", doc="id of the image or model, empty if none")
    point: Text = column("str", doc="id of the point, empty if none")
    stage: Text = column("str", doc="role of the stage that tested it")
    size: Float = column("f8", doc="estimated gross error, in the unit of the observation", optional=True)
    unit: Text = column("str", doc="unit of size and sigma")
    sigma: Float = column("f8", doc="standard deviation of the size", optional=True)
    test: Float = column("f8", doc="test statistic, in standard deviations", optional=True)
    verdict: Text = column(
        "str",
        doc="left out: rejected, undecidable (it or another of its point so called), swapped (with another of its "
        "image or kind so called); used: readmitted, kept",
    )
    error: Float = column(
        "f8",
        3,
        optional=True,
        absent=True,
        doc="estimated gross error by component (x, y; X, Y, Z), observed minus what it should be",
    )

    @property
    def staying_out(self) -> Bool:
        """Which of them stay out, (n,)."""
        return np.isin(self.verdict, LEFT_OUT)


class Uncontrolled(Table):
    """Observations with a direction that nothing controls: a gross error along it shows in no residual."""

    kind: Text = column("str", doc="image_point, control, position, distance ...")
    row: Int = column("i4", doc="row in its table of the Block; -1 if it has none", optional=True)
    image: Text = column("str", doc="id of the image, model or strip, empty if none")
    point: Text = column("str", doc="id of the point, name of the parameter, empty if none")
    redundancy: Float = column("f8", doc="redundancy number in that direction, below 0.01")
    direction: Float = column(
        "f8", 3, doc="the direction, of length 1, along the axes of residual; NaN: any", optional=True
    )
