"""Image points of cameras with models of their own: residuals at the camera, and models that are known.

    v = model(u, p) - (x, y)   or   v = -c (u1, u2)/u3 - corrected(x, y; p),   u = R'(X - X0)

(`camera.models.calibration`). Where no parameter of a group is unknown, the measured-side models (pinhole, brown)
correct the measurements once and for all, and what is left is a central projection; the forward models keep their
equations, with constants for parameters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.camera.models import calibration
from aatri.camera.models.brown import brown_basis
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import CAMERA

CORRECTING = ("pinhole", "brown")
"""Models whose correction depends on the measured coordinates only."""


@dataclass(frozen=True)
class CameraRows:
    """Cameras with models of their own."""

    block: Int
    """(n,). Block of the group CAMERA for each ray."""
    model: tuple[str, ...]
    """(n_blocks,) str. Model of each block, see `calibration.PARAMETERS`; blocks are as wide as the widest model."""
    known: Float | None = None
    """(n_blocks, s). Parameters, where none of them is unknown: then the records do not touch the group."""

    def take(self, rows: Int | Bool) -> CameraRows:
        """The chosen rows."""
        return CameraRows(self.block[rows], self.model, self.known)

    def parameters(self, state: State) -> Float:
        """Values of all blocks."""
        return np.asarray(state[CAMERA] if self.known is None else self.known)


def known_beforehand(rows: ImagePointRows, cameras: CameraRows) -> tuple[ImagePointRows, CameraRows | None]:
    """Rays of cameras whose parameters are all known; no cameras where nothing but a central projection is left.

    Parameters
    ----------
    cameras : CameraRows
        With `known`.
    """
    values = cameras.known
    assert values is not None
    used = np.unique(cameras.block)
    if not {cameras.model[k] for k in used} <= set(CORRECTING):
        return rows, cameras
    xy, c = rows.xy_mm.copy(), rows.c_mm.copy()
    for k in used:
        rays = np.flatnonzero(cameras.block == k)
        p = values[k]
        q = xy[rays] - p[1:3]
        if cameras.model[k] == "brown":
            q[:, 0] *= 1 + p[3]
            q = q + brown_basis(q) @ p[4 : len(calibration.PARAMETERS["brown"])]
        xy[rays], c[rays] = q, p[0]
    return replace(rows, xy_mm=xy, c_mm=c), None


def compared(cameras: CameraRows, parameters: Float, rows: Int, u: Float, xy_mm: Float) -> tuple[Float, Float, Float]:
    """Computed minus measured of some rows, and its derivatives to u and to the parameters.

    Parameters
    ----------
    parameters : (n_blocks, s) float64
    rows : (n,) int
        Rows of the cameras.
    u : (n, 3) float64
        Their points in image axes.
    xy_mm : (n, 2) float64, mm

    Returns
    -------
    v : (n, 2) float64, mm
    by_u : (n, 2, 3) float64
    by_camera : (n, 2, s) float64
    """
    block = cameras.block[rows]
    v, by_u = np.empty((len(u), 2)), np.empty((len(u), 2, 3))
    by_camera = np.zeros((len(u), 2, parameters.shape[1]))
    models = np.array(cameras.model)[block]
    for model in np.unique(models):
        rays, size = np.flatnonzero(models == model), len(calibration.PARAMETERS[str(model)])
        v[rays], by_u[rays], by_camera[rays, :, :size] = calibration.residual(
            str(model), u[rays], xy_mm[rays], parameters[block[rays], :size]
        )
    return v, by_u, by_camera
