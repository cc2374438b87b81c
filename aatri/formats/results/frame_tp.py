"""The ground-photogrammetric frame tp that an absolute orientation has told of, as a transformation."""

import numpy as np

from aatri.artifacts.solution import StripTransformations
from aatri.geometry.two_point import TwoPointFrame


def frame_tp(transformations: StripTransformations) -> TwoPointFrame | None:
    """The frame tp that an absolute orientation has started from; None if it has none."""
    rows = transformations.take(transformations.model == "tp")
    if not len(rows):
        return None
    value = dict(zip(rows.parameter.tolist(), rows.value.tolist()))
    ground, tp = ([value[name] for name in names] for names in (("N1_m", "E1_m", "H1_m"), ("X1", "Y1", "Z1")))
    return TwoPointFrame(value["a"], value["b"], np.array(ground), np.array(tp))
