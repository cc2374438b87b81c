"""Observations that nothing controls: told by every stage that adjusts, beside its suspects."""

from dataclasses import dataclass

from aatri.arrays import Float, Int, Text
from aatri.tables.schema import Table, column


@dataclass(frozen=True, eq=False)
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
