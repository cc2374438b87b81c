"""Image points: the collinearity equations as observations.

v = computed - (measured + remaining film correction), in mm from the principal point. The six interior unknowns d of an
image, where it has them, correct the measured photo coordinates (x, y from the fiducial centre),

    dx = d0 + d1 x + d2 y,    dy = d3 + d4 x + d5 y,

so that dv/dd = -(1, x, y) in each row. Their prior is the covariance of the interior orientation: what the fiducials
leave open is common to all points of an image, and without it sigma0 of film comes out too large.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.adjustment.records import Compiled, Fill, Records, whitener_of_sigmas
from aatri.adjustment.unknowns import State
from aatri.geometry.collinearity import collinearity
from aatri.observations.kernels.collinearity import count_side_changes, linearise
from aatri.observations.poses import INTERIOR, POINT, POSE, Poses

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.integer]
Bool = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class ImagePointRows:
    """Measured image points.

    Attributes
    ----------
    image, point : (n,) int32
        Blocks of unknowns.
    xy_mm : (n, 2) float64, mm, from the principal point
    sigma_mm : (n, 2) float64, mm
    c_mm : (n,) float64, mm
        Principal distance of each ray's camera.
    principal_point_mm : (n, 2) float64, mm
        Of each ray's camera, from the fiducial centre.
    active : (n,) bool
    """

    image: Int
    point: Int
    xy_mm: Float
    sigma_mm: Float
    c_mm: Float
    principal_point_mm: Float
    active: Bool


def image_point_records(rows: ImagePointRows, *, interior: bool) -> Records:
    """Records of image points; with `interior` they also touch the interior unknowns of their image."""
    photo = rows.xy_mm + rows.principal_point_mm
    by_interior = np.zeros((len(photo), 2, 6))
    by_interior[:, 0, 0] = by_interior[:, 1, 3] = -1.0
    by_interior[:, 0, 1:3] = by_interior[:, 1, 4:6] = -photo

    def evaluate(state: State, chosen: Int) -> tuple[Float, tuple[Float, ...]]:
        poses: Poses = state[POSE]
        image, point = rows.image[chosen], rows.point[chosen]
        X0, R = poses.position_m[image], poses.ground_from_image[image]
        xy, by_pose, by_point = collinearity(X0, R, state[POINT][point], rows.c_mm[chosen])
        v = xy - rows.xy_mm[chosen]
        if not interior:
            return v, (by_pose, by_point)
        film = by_interior[chosen]
        v = v + np.einsum("nij,nj->ni", film, state[INTERIOR][image])
        return v, (by_pose, film, by_point)

    film_touch = ((INTERIOR, rows.image),) if interior else ()
    touches = ((POSE, rows.image), *film_touch, (POINT, rows.point))
    whitener = whitener_of_sigmas(rows.sigma_mm)
    lane = _compiled(rows, by_interior if interior else None)
    return Records("image point", touches, evaluate, whitener, rows.active, lane)


def _compiled(rows: ImagePointRows, by_interior: Float | None) -> Compiled:
    """The compiled lane, equal to the NumPy form to 1e-12."""

    def prepared(order: Int) -> Callable[[State], Fill]:
        image, point = rows.image[order].astype(np.int32), rows.point[order].astype(np.int32)
        xy, c = np.ascontiguousarray(rows.xy_mm[order]), np.ascontiguousarray(rows.c_mm[order])
        weight = np.where(rows.active[order, None], 1.0 / rows.sigma_mm[order], 0.0)
        film = None if by_interior is None else by_interior[order] * weight[:, :, None]

        def bind(state: State) -> Fill:
            poses: Poses = state[POSE]
            X0, R = np.ascontiguousarray(poses.position_m), np.ascontiguousarray(poses.ground_from_image)
            X = np.ascontiguousarray(state[POINT])

            def fill(first: int, last: int, v: Float, J: tuple[Float, ...]) -> None:
                linearise(first, last, image, point, xy, weight, c, X0, R, X, v, J[0], J[-1])
                if film is not None:
                    J[1][:] = film[first:last]
                    v += np.einsum("nij,nj->ni", J[1], state[INTERIOR][image[first:last]])

            return fill

        return bind

    return prepared


def side_changes(rows: ImagePointRows, old: State, new: State) -> str:
    """Whether a step moves points to the other side of their camera: then the linearisation means nothing."""
    places = []
    for state in (old, new):
        poses: Poses = state[POSE]
        places += [np.ascontiguousarray(a) for a in (poses.position_m, poses.ground_from_image, state[POINT])]
    image, point = (np.ascontiguousarray(a[rows.active], dtype=np.int32) for a in (rows.image, rows.point))
    changed = count_side_changes(image, point, *places)
    return f"{changed} image points change the side of the camera" if changed else ""
