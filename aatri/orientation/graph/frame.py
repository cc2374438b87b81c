"""A frame for a component without a datum: the first base is 1, the images look down where they do so in the mean.

The origin is the first image's projection centre, the second image the next one in the order of ids. Images that look
to all sides, as in an orbit, have no mean direction: then the axes are those of the first image.
"""

import numpy as np

from aatri.geometry.rotations import levelling
from aatri.geometry.similarity import Similarity
from aatri.orientation.graph.component import ImageComponent

ALIKE = 0.3
"""Length of the mean viewing direction below which images look to all sides."""


def first_base_one(component: ImageComponent) -> tuple[ImageComponent, Similarity]:
    """A component in its own frame, and the similarity that led there."""
    rows = np.flatnonzero(component.images)
    centre, rotation = component.poses.position_m[rows], component.poses.ground_from_image[rows]
    base = np.linalg.norm(centre - centre[0], axis=1)
    apart = base > 1e-6 * base.max()
    scale = 1.0 / float(base[np.argmax(apart)])
    up = rotation[:, :, 2].mean(axis=0)
    turn = rotation[0].T
    if np.linalg.norm(up) > ALIKE:
        turn = levelling(turn @ up) @ turn
    similarity = Similarity(-scale * turn @ centre[0], scale, turn)
    return component.moved(similarity), similarity
