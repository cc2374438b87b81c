"""The compiled lanes of the collinearity equations, and the sides of the cameras that points lie on.

Of cameras with models of their own residuals are formed at the camera; models that are known:

    v = model(u, p) - (x, y)   or   v = -c (u1, u2)/u3 - corrected(x, y; p),   u = R'(X - X0)

(`camera.models.calibration`). Where no parameter of a group is unknown, the measured-side models (pinhole, brown)
correct the measurements once and for all, and what is left is a central projection; the forward models keep their
equations, with constants for parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.records import Bind, Compiled, Fill, Weigh
from aatri.adjustment.threads import in_threads, taken
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.camera.models import calibration
from aatri.camera.models.brown import brown_basis
from aatri.ids import several
from aatri.observations.image_point_rows import ImagePointRows, LinearCorrection
from aatri.observations.kernels.camera_frame import into_camera, out_of_camera
from aatri.observations.kernels.camera_models import bal, brown, opencv
from aatri.observations.kernels.collinearity import in_front, linearise
from aatri.observations.poses import CAMERA, POINT, POSE, Poses

COMPILED_MODELS = {"bal": bal, "brown": brown, "opencv": opencv}

CORRECTING = ("pinhole", "brown")
"""Models whose correction depends on the measured coordinates only."""


def compiled_lane(
    rows: ImagePointRows, corrections: Sequence[LinearCorrection], cameras: CameraRows | None = None
) -> Compiled:
    """The compiled lane, equal to the NumPy form to 1e-12.

    Of cameras with models of their own these are compiled where all are Brown's, OpenCV's or Bundler's; others are
    NumPy in between.
    """
    models = set() if cameras is None else set(cameras.model)
    model = COMPILED_MODELS.get(models.pop()) if len(models) == 1 else None

    def prepared(order: Int) -> Weigh:
        image, point = taken(_int32(rows.image), order), taken(_int32(rows.point), order)
        xy, c = taken(rows.xy_mm, order), taken(rows.c_mm, order)
        unweighted = [(k.group, k.block[order], k.basis[order]) for k in corrections]
        block = None if cameras is None else _int32(cameras.block[order])

        def weigh(weight: Float) -> Bind:
            terms = [(group, of_ray, -basis * weight[:, :, None]) for group, of_ray, basis in unweighted]

            def bind(state: State) -> Fill:
                poses: Poses = state[POSE]
                X0, R, X = (_own(a) for a in (poses.position_m, poses.ground_from_image, state[POINT]))

                parameters = _own(np.zeros((0, 0)) if cameras is None else cameras.parameters(state))

                def by_model(first: int, last: int, v: Float, J: tuple[Float, ...]) -> None:
                    assert cameras is not None
                    u, by_u = np.empty((last - first, 3)), np.empty((last - first, 2, 3))
                    into_camera(first, last, image, point, X0, R, X, u)
                    if model is not None:
                        by_camera = np.empty((last - first, 2, parameters.shape[1]))
                        model(first, last, block, xy, parameters, u, v, by_u, by_camera)
                    else:
                        v[:], by_u, by_camera = compared(cameras, parameters, order[first:last], u, xy[first:last])
                    w = weight[first:last]
                    if cameras.fixed is None:
                        np.multiply(by_camera, w[:, :, None], out=J[-2])
                    v *= w
                    out_of_camera(first, last, image, point, X0, R, X, weight, by_u, J[0], J[-1])

                def fill(first: int, last: int, v: Float, J: tuple[Float, ...]) -> None:
                    if cameras is None:
                        linearise(first, last, image, point, xy, weight, c, X0, R, X, v, J[0], J[-1])
                    else:
                        by_model(first, last, v, J)
                    for target, (group, of_ray, basis) in zip(J[1:-1], terms):
                        target[:] = basis[first:last]
                        v += np.einsum("nij,nj->ni", target, state[group][of_ray[first:last]])

                return fill

            return bind

        return weigh

    return prepared


def _own(values: Float) -> Float:
    """As the compiled functions want it: contiguous, and not one of an artifact's read-only columns."""
    return np.require(values, np.float64, ["C", "W"])


def _int32(values: Int) -> Int:
    return np.require(values, np.int32, ["C", "W"])


def side_veto(rows: ImagePointRows) -> Callable[[State, State], str]:
    """Refuses steps that move points to the other side of their camera: then the linearisation means nothing.

    Returns
    -------
    callable
        (old, new) -> why the new state is refused, or an empty text. The sides of the last accepted state are kept.
    """
    image, point = (_int32(a if rows.active.all() else a[rows.active]) for a in (rows.image, rows.point))
    seen_sides: list[tuple[State, Bool]] = []

    def sides(state: State) -> Bool:
        for seen, sides_there in seen_sides:
            if seen is state:
                return sides_there
        poses: Poses = state[POSE]
        X0, R, X = (_own(a) for a in (poses.position_m, poses.ground_from_image, state[POINT]))
        sides_there = np.empty(len(image), dtype=np.bool_)
        in_threads(len(image), lambda first, last: in_front(first, last, image, point, X0, R, X, sides_there))
        seen_sides[:] = [*seen_sides[-1:], (state, sides_there)]
        return sides_there

    def veto(old: State, new: State) -> str:
        changed = int(np.count_nonzero(sides(old) != sides(new)))
        return f"{several(changed, 'image point', 'changes', 'change')} the side of the camera" if changed else ""

    return veto


@dataclass(frozen=True)
class CameraRows:
    """Cameras with models of their own."""

    block: Int
    """(n,). Block of the group CAMERA for each ray."""
    model: tuple[str, ...]
    """(n_blocks,) str. Model of each block, see `calibration.PARAMETERS`; blocks are as wide as the widest model."""
    fixed: Float | None = None
    """(n_blocks, s). Parameters, where none of them is unknown: then the records do not touch the group."""

    def take(self, rows: Int | Bool) -> CameraRows:
        """The chosen rows."""
        return CameraRows(self.block[rows], self.model, self.fixed)

    def parameters(self, state: State) -> Float:
        """Values of all blocks."""
        return np.asarray(state[CAMERA] if self.fixed is None else self.fixed)


def known_beforehand(rows: ImagePointRows, cameras: CameraRows) -> tuple[ImagePointRows, CameraRows | None]:
    """Rays of cameras whose parameters are all known; no cameras where nothing but a central projection is left.

    Parameters
    ----------
    cameras : CameraRows
        With `known`.
    """
    values = cameras.fixed
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
