"""A block that hangs on too little: points far less certain than their image points make them.

Control nearly on a line, or close together, determines a datum in the sense of rank, and a block turned by 4 mrad with
it. Nothing in residuals or sigma0 shows that; the standard deviations do. Where those of more than a twentieth of the
points exceed `WEAK` times what an image point measures on the ground (sigma / c times the distance), the least certain
direction of all unknowns is named, mostly a motion of the whole block.
"""

from __future__ import annotations

import numpy as np

from aatri.adjustment.conditioning import least_certain
from aatri.adjustment.constraints import factorise_constrained
from aatri.notes import Note
from aatri.observations.poses import POINT
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.seen_distances import median_distance_m

WEAK = 10.0
"""Regular blocks with control at their edges have 1 to 4."""

SHARE = 0.95


def weak_datum_notes(given: BundleInput, result: BundleResult) -> list[Note]:
    """A warning that names what a block hardly determines as a whole."""
    distance, adjusted = median_distance_m(given.rays, given.poses, given.xyz_m), result.adjusted
    if distance is None or given.given is None or given.given.image_points is None or result.free is not None:
        return []
    if not adjusted.has_factor or POINT not in result.covariances:
        return []
    m, block = given.given.image_points.measurements, given.given.block
    angle = np.nanmedian(m.sigma_mm / block.cameras.principal_distance_mm[block.images.camera[m.image]][:, None])
    sigma = np.sqrt(np.einsum("nii->n", result.point_covariance_m2) / 3)
    known, on_ground = sigma[np.isfinite(sigma) & (sigma > 0)], float(angle) * distance
    most = float(np.quantile(known, SHARE)) if len(known) else 0.0
    if not np.isfinite(on_ground) or most <= WEAK * on_ground:
        return []
    factored = adjusted.factored or factorise_constrained(adjusted.problem, adjusted.state)
    what = least_certain(adjusted.problem, factored, adjusted.state)
    text = (
        f"hardly determined: {what}; one point in twenty has a standard deviation above {most:.2g} m, "
        f"{most / on_ground:.0f} times what an image point measures: control lies nearly on a line or close together, "
        "strips hang on few points, or parameters free each other; give control spread over the block"
    )
    return [Note("warning", text)]
