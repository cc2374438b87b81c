"""Whether a component fits what is observed of the ground as well as its rays let it: it bends.

A similarity takes a component for rigid. Its rays hold it so but nearby: a strip bends and twists with its length, and
a few control points that a similarity fits say nothing of the rest of it. The adjustment of all its rays together with
what is observed of the ground has this bend in it. With v'P v = W and redundancy r of that adjustment, W0 and r0 of the
rays alone, without a datum, and s0 their standard deviation over the one a priori,

    (W - W0) / s0^2  ~  chi^2(r - r0)

where nothing contradicts them.

Source: Koch, Parameter Estimation and Hypothesis Testing, 4.2 (the increase of W by further observations).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics.global_test import sigma0_interval
from aatri.adjustment.statistics.limits import ALARM
from aatri.adjustment.unknowns import Ids
from aatri.arrays import Float
from aatri.errors import AatriError
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.image_points import observed_image_points
from aatri.observations.observed import Observed, named
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.settings import BundleSettings
from aatri.orientation.graph.component import ImageComponent


def fits_bent(
    component: ImageComponent,
    rays: ImagePointRows,
    observed: Sequence[Observed],
    image_ids: Ids,
    point_ids: Ids,
    beside: Sequence[Observed] = (),
) -> bool:
    """Whether what is observed of the ground fits a component that bends as its rays let it.

    Parameters
    ----------
    component : ImageComponent
        On the ground, reduced to the origin.
    observed : sequence of Observed
        Of the ground, with the priors of their own unknowns.
    beside : sequence of Observed, optional
        The same without some, which are tested alone: beside all others a few gross errors would pass.
    image_ids, point_ids : (n,) str
    """
    rays_only = _rays_of(component, rays, image_ids, point_ids)
    try:
        without = replace(rays_only, observed=(*rays_only.observed, *beside))
        settings = BundleSettings(covariances=False) if beside else BundleSettings("minimal", covariances=False)
        free = adjust_bundle(without, settings).adjusted
        with_ground = replace(rays_only, observed=(*rays_only.observed, *observed))
        adjusted = adjust_bundle(with_ground, BundleSettings(covariances=False)).adjusted
    except AatriError:
        return False  # so far off that no adjustment reaches it
    further = adjusted.redundancy - free.redundancy
    s2 = free.cost / free.redundancy if free.redundancy else 1.0
    return further < 1 or (adjusted.cost - free.cost) / further <= s2 * sigma0_interval(further, ALARM)[1] ** 2


def rays_alone(component: ImageComponent, rays: ImagePointRows, image_ids: Ids, point_ids: Ids) -> tuple[Float, Float]:
    """Projection centres and points of a component adjusted by its rays, held minimally; NaN where it has none."""
    inputs = _rays_of(component, rays, image_ids, point_ids)
    result = adjust_bundle(inputs, BundleSettings("minimal", covariances=False))
    return result.poses.position_m, result.xyz_m


def _rays_of(component: ImageComponent, rays: ImagePointRows, image_ids: Ids, point_ids: Ids) -> BundleInput:
    """A component and the rays that fit it, with their spread, as input of a bundle."""
    images, points = np.asarray(image_ids, dtype=np.str_), np.asarray(point_ids, dtype=np.str_)
    as_seen = replace(rays, active=component.kept, sigma_mm=component.ray_spread * rays.sigma_mm)
    of_rays = observed_image_points(as_seen, (), named(image=images[rays.image], point=points[rays.point]))
    return BundleInput(image_ids, point_ids, of_rays, component.poses, component.xyz, np.zeros(3), as_seen)
