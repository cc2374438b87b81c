"""A start for blocks with relative control: first without the shapes, then with shapes fitted to the points found.

Planes, lines and cylinders get their start from that of their points. Where images begin metres off, so do the points,
each its own way, and a cylinder fitted to them may be another one, through points that nearly fit. The other
observations alone give points that are right, to which every shape is fitted anew.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.settings import BundleSettings
from aatri.progress import Reporter


def has_shapes(observed: Sequence[Observed]) -> bool:
    """Whether some observations are of points of a shape."""
    return any(map(_is_shape, observed))


def _is_shape(o: Observed) -> bool:
    return o.refitted is not None and bool(len(o))


def start_without_shapes(inputs: BundleInput, settings: BundleSettings, reporter: Reporter) -> BundleInput:
    """The block with poses, points and shapes as the other observations give them.

    Raises
    ------
    GeometryError, ConvergenceError
        If the others do not determine the block.
    """
    other_observations = tuple(o for o in inputs.observed if not _is_shape(o))
    adjusted_without = adjust_bundle(
        replace(inputs, observed=other_observations),
        replace(settings, covariances=False, weights=()),
        reporter=reporter,
    )
    xyz = np.where(np.isfinite(adjusted_without.xyz_m), adjusted_without.xyz_m - inputs.origin_m, inputs.xyz_m)
    poses = adjusted_without.poses.shifted(-inputs.origin_m).where(adjusted_without.image_adjusted, inputs.poses)
    observed = []
    for o in inputs.observed:
        if o.refitted is not None and _is_shape(o):
            fitted = o.refitted({POSE: poses, POINT: xyz})
            o = fitted.without(o.rejected) if o.rejected is not None else fitted
        observed.append(o)
    return replace(inputs, poses=poses, xyz_m=xyz, observed=tuple(observed))
