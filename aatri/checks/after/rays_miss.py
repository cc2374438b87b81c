"""Rays of images with observed poses miss each other by more than these poses allow.

The rays of an image share the error of its pose: sigma0^2 has the spread of a mean square of fewer degrees of freedom
than the redundancy. Simulated (150 blocks each), these are 0.8 for a pair, 1.7 for three images, 15 for two strips of
four: half as many as images are assumed.

Seen: positions, angles, mount, boresight or lever arm that are wrong; standard deviations that are too small.
Test: sigma0^2 f against chi^2 of f = images / 2 degrees of freedom at `ALARM`; for a pair (f = 1) a little more often.
"""

import numpy as np
from scipy.stats import chi2

from aatri.adjustment.statistics.limits import ALARM
from aatri.artifacts.solution import Solution
from aatri.checks.finding import Finding

MOST_NAMED = 3


def rays_miss(solution: Solution) -> list[Finding]:
    """A warning with the images whose rays are farthest off.

    Parameters
    ----------
    solution : Solution
        By observed poses, whose residuals have the standard deviations of the rays with those of their poses.
    """
    residuals = solution.residuals
    images, of_image = np.unique(residuals.image, return_inverse=True)
    freedom = max(len(images), 2) / 2
    limit = float(np.sqrt(chi2.isf(ALARM, freedom) / freedom))
    if not solution.sigma0 > limit:
        return []
    squares = np.nanmean((residuals.residual / residuals.sigma) ** 2, axis=1)
    rms = np.sqrt(np.bincount(of_image, squares) / np.bincount(of_image))
    worst = np.argsort(-rms, kind="stable")[:MOST_NAMED]
    far = ", ".join(f"{images[k]} ({rms[k]:.1f} sigma)" for k in worst)
    text = f"rays miss each other: sigma0 {solution.sigma0:.2f}, by chance {limit:.2f} at most (99.9 %, "
    text += f"{len(images)} images); largest residuals in images {far}"
    remedy = "look at their positions, angles, mount, boresight and lever arm, and at the standard deviations of these"
    return [Finding("rays_miss", "warning", text, remedy, statistic=solution.sigma0, significance=ALARM)]
