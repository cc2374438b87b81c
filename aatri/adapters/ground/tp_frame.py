"""The ground-photogrammetric frame tp of a component, by the two of its control points that lie farthest apart."""

import numpy as np

from aatri.adapters.ground.absolute_datum import OrientedPart, free_images
from aatri.adapters.strips.oriented_strips import transformation_rows
from aatri.artifacts.block import Block
from aatri.artifacts.solution import StripTransformations
from aatri.artifacts.strips import Strips
from aatri.geometry.rotations import levelling
from aatri.geometry.two_point import farthest_apart, two_point_frame
from aatri.observations.control import control_of

TP = "tp"
"""Transformation, and id of the frame."""


def tp_rows(block: Block, strips: Strips, part: OrientedPart) -> StripTransformations:
    """Parameters of the frame of a component, its levelled axes and unit; none if two points are not known in full.

    (X, Y)tp = [b a; a -b] (N - N1, E - E1) + (X1, Y1),   Ztp = lambda (H - H1) + Z1
    """
    component, control = part.component, control_of(block)
    _, rotations, _ = free_images(strips, component)
    level = component.xyz @ levelling(rotations[:, :, 2].mean(axis=0)).T
    in_full = np.isin(control.point, component.point) & control.given.all(axis=1)
    xyz_m, place = control.xyz_m[in_full], np.searchsorted(component.point, control.point[in_full])
    if len(xyz_m) < 2:
        return StripTransformations.empty()
    ends = farthest_apart(xyz_m[:, :2])
    frame = two_point_frame(level[place[ends]], xyz_m[ends][:, [1, 0, 2]])
    names = ("a", "b", "lambda", "N1_m", "E1_m", "H1_m", "X1", "Y1", "Z1")
    values = [frame.a, frame.b, frame.scale, *frame.north_east_height_m, *frame.xyz_tp]
    return transformation_rows(TP, TP, names, values)
