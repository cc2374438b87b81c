"""Image points with a correction added to them, and named among those they have had."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.arrays import Bool, Float
from aatri.artifacts.image_points import Corrections, ImagePoints


def with_corrections(
    image_points: ImagePoints, xy_mm: Float, names: Sequence[str], largest_mm: Sequence[float]
) -> ImagePoints:
    """The image points at corrected places.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm
        Corrected coordinates of all measurements.
    names, largest_mm : sequences
        The corrections made, in order, and the largest length of each.
    """
    done = image_points.corrections
    return replace(
        image_points,
        measurements=replace(image_points.measurements, xy_mm=xy_mm),
        corrections=Corrections(
            name=np.concatenate([done.name, np.array(names, dtype=np.str_)]),
            largest_mm=np.concatenate([done.largest_mm, largest_mm]),
        ),
    )


def largest_length(correction_mm: Float, used: Bool) -> float:
    """Largest length of the corrections of the chosen points, mm; 0 of none."""
    return float(np.hypot(*correction_mm[used].T).max(initial=0.0))
