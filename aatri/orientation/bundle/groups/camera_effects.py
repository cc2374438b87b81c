"""What a camera may be wrong in, as derivatives H of the residuals of its image points, made for those asked for.

    dv/dc = (x, y) / c,   dv/dx0 = (1, 0),   dv/dy0 = (0, 1),   dv/dp = -(x, y) r^2 / r0^3
    affinity:  dv/da = (-x, y) / r0,   dv/db = (-y, -x) / r0

with x, y the photo coordinates, r their distance from the principal point, r0 half the diagonal of the format.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int

AFFINITY = 4
"""First of the columns of affinity and shear, the last two."""


@dataclass(frozen=True)
class CameraEffects:
    """Derivatives by c, x0, y0, radial distortion at r0, affinity and shear at r0, (n, 2, 6)."""

    xy_mm: Float
    """(n, 2)."""
    c_mm: Float
    r0_mm: Float
    """(n,)."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """n, 2 and 6."""
        return len(self.xy_mm), 2, AFFINITY + 2

    def __getitem__(self, rows: Int | Bool | slice, /) -> Float:
        """Those of some image points."""
        xy_mm, r0_mm = self.xy_mm[rows], self.r0_mm[rows]
        H, x = np.zeros((len(xy_mm), 2, AFFINITY + 2)), xy_mm / r0_mm[:, None]
        H[:, :, 0] = xy_mm / self.c_mm[rows][:, None]
        H[:, 0, 1] = H[:, 1, 2] = 1.0
        H[:, :, 3] = -x * (x**2).sum(axis=1, keepdims=True)
        H[:, 0, AFFINITY], H[:, 1, AFFINITY] = -x[:, 0], x[:, 1]
        H[:, 0, AFFINITY + 1], H[:, 1, AFFINITY + 1] = -x[:, 1], -x[:, 0]
        return H
