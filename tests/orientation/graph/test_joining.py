"""Components that stay apart are listed, however many were tried before one was joined."""

from __future__ import annotations

import numpy as np

from aatri.observations.poses import Poses
from aatri.orientation.graph.component import ImageComponent


def _component(image: int) -> ImageComponent:
    position = np.full((3, 3), np.nan)
    position[image] = 0.0
    return ImageComponent(Poses(np.tile(np.eye(3), (3, 1, 1)), position), np.zeros((4, 3)), np.ones(5, dtype=bool), 1.0)


def test_a_component_is_itself_whatever_its_arrays_hold() -> None:
    """A list takes the last of three out: arrays of the others that are compared have no truth value."""
    components = [_component(image) for image in range(3)]
    last = components[2]
    components.remove(last)
    assert not any(component is last for component in components)
