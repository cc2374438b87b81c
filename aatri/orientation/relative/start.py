"""Start of a relative orientation from parallel images, and the cases that have no orientation.

Start: both images look the same way, the right one turned by kappa about the common axis. With q = (x, y) / c as
complex numbers, points of equal depth obey q1 = a q2 + t, a = s exp(i kappa). Robustly fitted (weights 1 / |residual|),
it gives R = Rz(kappa) and a base along t.

No orientation: too few points; the same coordinates in both images; images that differ by a rotation only (no base);
points on a line.

Source: docs/formulas.md 3.3.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.errors import GeometryError
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.vectors import unit
from aatri.orientation.relative.kernels.start import FITS

LINE = 3.0
"""Points lie on a line if they are no farther from it than this many standard deviations, root mean square."""

NO_BASE = 2.0
"""There is no base if a rotation alone fits within this many standard deviations, in the median."""


def parallel_start(rays: RayPairs) -> tuple[Float, Float]:
    """Rotation and base of two images that look the same way.

    Returns
    -------
    left_from_right : (3, 3) float64
    base : (3,) float64, unit vector
    """
    q1, q2 = _plane(rays.left), _plane(rays.right)
    weight = np.ones(len(q1))
    for _ in range(FITS):
        total = weight.sum()
        m1, m2 = (weight * q1).sum() / total, (weight * q2).sum() / total
        d1, d2 = q1 - m1, q2 - m2
        a = (weight * d1 * d2.conj()).sum() / max((weight * np.abs(d2) ** 2).sum(), 1e-300)
        misfit = np.abs(d1 - a * d2)
        weight = 1.0 / np.maximum(misfit, 1e-3 * max(float(np.median(misfit)), 1e-9))
    turn = a / max(abs(a), 1e-300) if abs(a) > 0 else 1.0
    R = np.array([[turn.real, -turn.imag, 0.0], [turn.imag, turn.real, 0.0], [0.0, 0.0, 1.0]])
    t = m1 - turn * m2
    return R, unit([t.real, t.imag, 0.0]) if abs(t) > 1e-12 else np.array([1.0, 0.0, 0.0])


def refuse_degenerate(rays: RayPairs, min_points: int) -> None:
    """Refuse point sets that determine no orientation.

    Raises
    ------
    GeometryError
        With the reason.
    """
    n = len(rays.left)
    if n < min_points:
        raise GeometryError(f"{n} common points, {min_points} are needed", remedy="measure more points in the overlap")
    if np.array_equal(rays.left[:, :2], rays.right[:, :2]):
        raise GeometryError(
            "identical coordinates in both images",
            remedy="one image's measurements were copied to the other; measure it",
        )
    for side, u, sigma in (("left", rays.left, rays.left_sigma), ("right", rays.right, rays.right_sigma)):
        across = np.linalg.svd(u[:, :2] - u[:, :2].mean(axis=0), compute_uv=False)[1] / np.sqrt(n)
        if across < LINE * float(np.median(sigma)):
            raise GeometryError(f"all points lie on a line in the {side} image", remedy="measure points beside it")
    turned = _rotation_misfit(rays)
    if turned < NO_BASE:
        raise GeometryError(
            "no base: a rotation alone explains the images", remedy="use images taken from different places"
        )


def _plane(u: Float) -> npt.NDArray[np.complex128]:
    return np.asarray((u[:, 0] + 1j * u[:, 1]) / -u[:, 2])


def _rotation_misfit(rays: RayPairs) -> float:
    """Median misfit, in standard deviations, of the best rotation of the right rays onto the left ones."""
    u1, u2 = unit(rays.left), unit(rays.right)
    turned = u2 @ nearest_rotation(u1.T @ u2).T
    sine = np.linalg.norm(np.cross(u1, turned), axis=1)
    sigma = np.hypot(rays.left_sigma.mean(axis=1) / np.linalg.norm(rays.left, axis=1),
                     rays.right_sigma.mean(axis=1) / np.linalg.norm(rays.right, axis=1))  # fmt: skip
    return float(np.median(sine / sigma))
