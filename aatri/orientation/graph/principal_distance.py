"""How a component bends by what its principal distances may be wrong by.

A wrong principal distance stretches a component along the viewing direction, by which neither its rays nor a similarity
tell it: images at two heights, or images and control, lie apart by a share of their distance. With the component
adjusted once as it is and once with a principal distance that is longer by a small share, and brought back onto itself
by a similarity, the difference of its points and projection centres is the derivative.

Source: Kraus, Photogrammetry (errors of the interior orientation in a model).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adjustment.unknowns import Ids
from aatri.arrays import Float, finite_rows
from aatri.errors import AatriError
from aatri.geometry.similarity import robust_closed_form, transform
from aatri.observations.image_point_rows import ImagePointRows
from aatri.orientation.graph.component import ImageComponent
from aatri.orientation.graph.on_ground import rays_alone

STEP = 0.01
"""Share by which a principal distance is changed for the derivative."""


def with_bends(
    component: ImageComponent, rays: ImagePointRows, shares: Sequence[Float], image_ids: Ids, point_ids: Ids
) -> ImageComponent:
    """The component with what it bends by.

    Parameters
    ----------
    shares : sequence of (n,) float64
        Of each ray the standard deviation of its principal distance over this, of principal distances that are wrong by
        themselves; 0 where it is known.
    image_ids, point_ids : (n,) str
    """
    bends = list[tuple[Float, Float]]()
    for share in shares:
        largest = float(share[component.kept].max(initial=0.0))
        if largest == 0.0:
            continue
        longer = replace(rays, c_mm=rays.c_mm * (1.0 + STEP * share / largest))
        try:
            places = [np.concatenate(rays_alone(component, r, image_ids, point_ids)) for r in (rays, longer)]
        except AatriError:
            continue  # it is not determined so well that its deformation could be told
        both = np.logical_and(*map(finite_rows, places))
        onto, _ = robust_closed_form(places[1][both], places[0][both])
        bend = np.full_like(places[0], 0.0)
        bend[both] = (transform(onto, places[1][both]) - places[0][both]) * (largest / STEP)
        n = len(component.images)
        bends.append((bend[:n], bend[n:]))
    return replace(component, bends=tuple(bends))
