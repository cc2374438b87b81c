"""What is to be said of an orientation: that it is weak or open, and by what critical configuration of its points.

- tiny base: the points are more than 50 bases away; short base: more than 25, where nothing else is found;
- corner: the points take up a small part of the model only;
- collinear: the model points lie near a line, so that they leave the turn about it open;
- critical cylinder: points and both projection centres lie on a circular cylinder whose axis is along the base, as the
  sides of a valley may; the right image can turn about the base and shift across it without y-parallax. Across the base
  the cylinder is a circle through the base: y^2 + z^2 = 2 a y + 2 b z.

Source: Hofmann 1953, Wunderlich 1941 (gefaehrliche Flaechen); Kraus, Photogrammetry 1, relative orientation.
"""

import numpy as np

from aatri.arrays import Bool, Float
from aatri.errors import GeometryError
from aatri.geometry.vectors import tangents

WEAK_RAD = 0.01
"""A direction or rotation less certain than this is reported: the geometry is near a singular one."""

OPEN_RAD = 0.3
"""A direction or rotation less certain than this is not determined."""

MANY_REJECTED = 0.2
"""A larger share of rejected points is reported."""

FAR, SHORT = 50.0, 25.0
"""Bases to the points beyond which the base is tiny, and short."""

IN_A_CORNER = 0.25
"""Largest extent, in bases, of points in one small part of the model."""

ON_A_LINE = 0.02
"""Extent across over extent along of points near a line."""

ON_A_CIRCLE = 0.05
"""Largest RMS deviation from the circle, as a share of the points' extent across the base."""

FLAT = 0.02
"""Points whose depth varies by a smaller share of their width lie on a plane, not on a cylinder."""

BETTER = 0.5
"""Largest RMS deviation from the circle over that from a straight line: rough ground is no cylinder."""


GENERAL = "the points lie near a line, in a corner or on a critical surface"


def critical_configuration(xyz: Float, base: Float) -> str:
    """What configuration the points have, as a clause; a general one where none of the named ones fits.

    Parameters
    ----------
    xyz : (n, 3) float64, bases
        Model points.
    base : (3,) float64, unit vector
    """
    if len(xyz) < 5 or not np.isfinite(xyz).all():
        return GENERAL
    distance = float(np.median(np.linalg.norm(xyz, axis=1)))
    if distance > FAR:
        return f"the base is tiny, 1/{distance:.0f} of the distance to the points"
    sizes = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    if sizes[1] < ON_A_LINE * sizes[0]:
        return "the points lie near a line (collinear)"
    extent = float(np.ptp(xyz, axis=0).max())
    if extent < IN_A_CORNER:
        return f"the points lie in one small part of the model, {extent:.2f} bases wide (in a corner)"
    across = xyz @ tangents(base)
    centre = np.linalg.lstsq(2 * across, (across**2).sum(axis=1))[0]
    radius = float(np.linalg.norm(centre))
    off = np.linalg.norm(across - centre, axis=1) - radius
    spread = np.linalg.svd(across - across.mean(axis=0), compute_uv=False)
    apart, straight = float(np.sqrt((off**2).mean())), float(spread[1] / np.sqrt(len(xyz)))
    near = apart < ON_A_CIRCLE * float(np.ptp(across, axis=0).max()) and apart < BETTER * straight
    if near and spread[1] > FLAT * spread[0]:
        return "points and projection centres lie near a circular cylinder along the base (critical cylinder)"
    return f"the base is short, 1/{distance:.0f} of the distance to the points" if distance > SHORT else GENERAL


def judged(
    covariance: Float, redundancy: int, sigma0: float, active: Bool, limit: float, xyz: Float, base: Float
) -> tuple[str, ...]:
    """What is to be said of an orientation; where it is weak or open, why, from its model points and base.

    Raises
    ------
    GeometryError
        If it is open.
    """
    texts = []
    largest = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    if largest > OPEN_RAD:
        raise GeometryError(
            f"the orientation is open by {largest:.2g} rad: {critical_configuration(xyz[active], base)}",
            remedy="measure points over the whole overlap, at different heights",
        )
    if largest > WEAK_RAD:
        reason = critical_configuration(xyz[active], base)
        texts.append(f"weak geometry: the orientation is uncertain by {largest:.2g} rad; {reason}")
    if redundancy == 0:
        texts.append("exactly 5 points: no redundancy, nothing is checked")
    elif redundancy == 1 and sigma0 > limit:
        texts.append(
            f"sigma0 is {sigma0:.1f} with one redundant point: there is a gross error, but which point "
            "has it cannot be told"
        )
    rejected, n = int((~active).sum()), len(active)
    if n >= 10 and rejected > MANY_REJECTED * n:
        texts.append(f"{rejected} of {n} points are rejected: mismatches, or standard deviations that are too small")
    return tuple(texts)
