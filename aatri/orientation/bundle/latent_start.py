"""A start for blocks with relative control: first without the shapes, then with shapes fitted to the points found.

Planes, lines and spheres get their start from that of their points. Where images begin metres off, so do the points,
each its own way, and a sphere fitted to them may be another one. The other observations alone give points that are
right; the unknowns of each shape follow from them by least squares (Levenberg-Marquardt).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, Poses
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.settings import BundleSettings
from aatri.progress import Reporter


def has_shapes(given: BundleInput) -> bool:
    """Whether some observations are of points and unknowns of their own alone."""
    return any(_is_shape(o) for o in given.observed)


def _is_shape(o: Observed) -> bool:
    own = {u.name for u in o.unknowns}
    groups = [group for group, _ in o.records.touches]
    return bool(own) and bool(len(o)) and POINT in groups and set(groups) <= {POINT, *own}


def start_without_shapes(given: BundleInput, settings: BundleSettings, reporter: Reporter) -> BundleInput:
    """The block with poses, points and shapes as the other observations give them.

    Raises
    ------
    GeometryError, ConvergenceError
        If the others do not determine the block.
    """
    rest = tuple(o for o in given.observed if not _is_shape(o))
    found = adjust_bundle(replace(given, observed=rest), replace(settings, covariances=False), reporter=reporter)
    xyz = np.where(np.isfinite(found.xyz_m), found.xyz_m - given.origin_m, given.xyz_m)
    poses = Poses(*(np.where(np.isfinite(new), new, old) for new, old in
                    ((found.poses.position_m - given.origin_m, given.poses.position_m),
                     (found.poses.ground_from_image, given.poses.ground_from_image))))  # fmt: skip
    observed = tuple(_fitted(o, xyz) if _is_shape(o) else o for o in given.observed)
    return replace(given, poses=poses, xyz_m=xyz, observed=observed)


def _fitted(o: Observed, xyz: Float) -> Observed:
    """The observations with the start of their own unknowns fitted to points."""
    start = dict(o.start)
    points = np.stack([block for group, block in o.records.touches if group == POINT], axis=1)
    known: Bool = np.asarray(np.isfinite(xyz[points]).all(axis=(1, 2)))
    for u in o.unknowns:
        block = next(block for group, block in o.records.touches if group == u.name)
        values = np.array(start[u.name], dtype=np.float64)
        for k in range(len(values)):
            mine = block == k
            if known[mine].all() and u.free[k].any():
                values[k] = _fitted_block(o, {POINT: xyz, **start}, u.name, k, np.flatnonzero(mine), u.free[k])
        start[u.name] = values
    return replace(o, start=start)


def _fitted_block(o: Observed, state: State, group: str, k: int, rows: Int, free: Bool) -> Float:
    """The unknowns of one shape that fit its points best."""
    values = np.array(state[group], dtype=np.float64)

    def residuals(t: Float) -> Float:
        values[k, free] = t
        return o.records.evaluate({**state, group: values}, rows)[0].ravel()

    values[k, free] = least_squares(residuals, values[k, free].copy()).x
    return np.asarray(values[k])
