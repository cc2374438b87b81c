"""Radial distortion that a bundle does not carry: found in its residuals, with the bend of the heights it makes.

    dr = p (r / r_0)^3,     r_0 half the diagonal of the format, p in mm

Seen: nothing. Images that look straight down on nearly flat ground take a radial distortion up into their orientations:
the model bends into a bowl, control at its edges fits, and the residuals stay small (a thousandth of the squares of the
distortion is left in them). Test: the score test of p (`adjustment.covariance.score`) weighs it with the covariance of
the whole block, and says what an adjustment with p would change, the heights first of all. Told is what is significant
and bends heights by more than their standard deviation; where nothing is found, what could be there unseen.

Source: James and Robson 2014 (doming of vertical blocks); docs/methods/self_calibration.md.
"""

import numpy as np

from aatri.adapters.cameras.unknowns import additional_parameters
from aatri.adjustment.covariance.score import moved, score, with_factor
from aatri.camera.parameters.brown import BROWN_CONRADY
from aatri.camera.parameters.parameter_set import chosen
from aatri.checks.finding import Finding
from aatri.checks.limits import MOST_POINTS_OF_SCORE, UNSEEN_BEND, UNSEEN_DISTORTION
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import FILM, POINT
from aatri.orientation.bundle.result import BundleResult
from aatri.units import about

RADIAL = chosen(BROWN_CONRADY, ("k1",))


def hidden_distortion(source: ObservationSource, result: BundleResult, *, tests: bool) -> list[Finding]:
    """What the image points of each camera say of a radial distortion that would bend the block.

    Parameters
    ----------
    source : ObservationSource
        What the observations of the block were taken from.
    result : BundleResult
        With covariances. Nothing is said where parameters of cameras are estimated.
    tests : bool
        Observations are tested too.
    """
    rays = next((o for o in result.observations if o.observed.kind == IMAGE_POINT), None)
    if rays is None or source.image_points is None or not _asked(result, tests):
        return []
    rows = np.flatnonzero(rays.used)
    radial = additional_parameters(source.block, source.image_points, RADIAL, "camera", None)
    assert radial.basis is not None
    derivative = np.zeros((len(rows), 2, len(radial.ids)))
    derivative[np.arange(len(rows)), :, radial.block[rows]] = -radial.basis[rows, :, 0]
    records, adjusted = rays.observed.records, with_factor(result.adjusted)
    scores = score(adjusted, records, rows, derivative)
    findings = []
    sigma2 = result.point_covariance_m2[:, 2, 2]
    height_m = float(np.sqrt(np.median(sigma2[np.isfinite(sigma2) & (sigma2 > 0)])))
    for k, camera in enumerate(radial.ids):
        one = scores.joint(0, [k])
        if one.rank:
            size_mm = UNSEEN_DISTORTION * float(np.sqrt(one.covariance[0, 0])) * max(1.0, result.adjusted.sigma0)
            bend_m = float(np.abs(moved(adjusted, records, rows, size_mm * derivative[:, :, k])[POINT][:, 2]).max())
            if bend_m > UNSEEN_BEND * height_m:
                text = (
                    f"a radial distortion of {1e3 * size_mm:.2g} um at the corner of the format would go unseen, and "
                )
                text += f"bend heights by {about(bend_m)}"
                where = f"camera {camera}"
                findings.append(Finding("hidden_distortion", "note", text, "calibrate the lens", where=where))
    return findings


def _asked(result: BundleResult, tests: bool) -> bool:
    adjusted = result.adjusted
    if not adjusted.has_factor or adjusted.down_weighted or adjusted.redundancy < 1 or result.free is not None:
        return False
    if len(result.xyz_m) > MOST_POINTS_OF_SCORE and not tests:
        return False
    sigma2 = result.point_covariance_m2[:, 2, 2]
    carried = any(p.given.group != FILM and p.given.free.any() for p in result.parameters)
    return bool((np.isfinite(sigma2) & (sigma2 > 0)).any()) and not carried
