"""Image points: the collinearity equations as observations.

v = computed - (measured + corrections), in mm from the principal point. Corrections of the measured coordinates are
linear in their parameters, K(x, y) p with a constant matrix K per ray: dv/dp = -K. They are

- the film correction that the fiducials of an image leave open, dx = d0 + d1 x + d2 y, dy = d3 + d4 x + d5 y for an
  affine interior orientation (4 or 8 parameters for others, `geometry.plane_transformations`), weighted by the
  covariance of the interior orientation: common to all points of an image, and without it sigma0 of film comes out too
  large;
- sets of additional parameters (self-calibration) of a camera, a session or an image.

Rays of cameras with unknown parameters of a non-linear model (`aatri.camera.models.calibration`) take the NumPy lane;
all others, nearly always all, the compiled one. Both give the same to 1e-12.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjustment.records import Records, Weigh
from aatri.adjustment.unknowns import State
from aatri.adjustment.whitening import whitener_of_sigmas
from aatri.arrays import Float, Int, Text, finite_rows
from aatri.geometry.collinearity import in_image_axes, project_derivatives
from aatri.geometry.plane_transformations import open_basis
from aatri.geometry.rotations import skew
from aatri.observations.collinearity_lane import CameraRows, compared, compiled_lane, known_beforehand, side_veto
from aatri.observations.given_coordinates import observed_priors
from aatri.observations.image_point_rows import ImagePointRows, LinearCorrection
from aatri.observations.observed import Names, ObservationSource, Observed
from aatri.observations.parameters import ParameterRows, parameter_unknowns
from aatri.observations.poses import CAMERA, POINT, POSE, Poses

if TYPE_CHECKING:
    from aatri.artifacts.block import Block
    from aatri.artifacts.image_points import ImagePoints

KIND = "image_point"


def image_points(source: ObservationSource) -> tuple[Observed, ...]:
    """Image points of the block, and what is known of the parameters of its images and cameras."""
    rays, block = source.rays, source.block
    if rays is None:
        return ()

    def names(rows: Int) -> tuple[Text, Text]:
        return block.images.id[rays.image[rows]], block.points.id[rays.point[rows]]

    return observed_image_points(rays, source.parameters, names, block.image_points.group)


def rays_of(block: Block, image_points: ImagePoints) -> ImagePointRows:
    """All measurements as rays; those without coordinates are inactive."""
    m = image_points.measurements
    camera = block.images.camera[m.image]
    return ImagePointRows(
        m.image,
        m.point,
        m.xy_mm,
        m.sigma_mm,
        _of_rays(block.cameras.principal_distance_mm, camera),
        _of_rays(block.cameras.principal_point_mm, camera),
        m.active & finite_rows(m.xy_mm),
    )


def _of_rays(of_cameras: Float, camera: Int) -> Float:
    """Values of the camera of each ray; those of the only camera are in memory once.

    Of one ray the view would be contiguous and not to be written to, which compiled functions do not take.
    """
    if len(of_cameras) == 1 and len(camera) > 1:
        return np.broadcast_to(of_cameras, (len(camera), *of_cameras.shape[1:]))
    return of_cameras[camera]


def observed_image_points(
    rays: ImagePointRows, parameters: Sequence[ParameterRows], names: Names, group: Text | None = None
) -> tuple[Observed, ...]:
    """Rays with the parameters they touch, and the priors of these."""
    corrections = [LinearCorrection(p.group, p.block, p.basis) for p in parameters if p.basis is not None]
    rays, cameras = _through_cameras(rays, parameters)
    rows = np.arange(len(rays.image))
    priors = [
        observed_priors(f"{p.group}_prior", p.group, p.ids, p.prior, p.covariance, p.weighted & p.free, p.labels)
        for p in parameters
    ]
    return (
        Observed(
            image_point_records(rays, corrections, cameras),
            rows,
            names,
            "mm",
            unknowns=tuple(parameter_unknowns(p) for p in parameters),
            start={p.group: p.start for p in parameters},
            veto=lambda chosen: side_veto(rays if len(chosen) == len(rays.image) else rays.take(chosen)),
            group=group,
        ),
        *(prior for of_group in priors for prior in of_group),
    )


def renumbered_records(rays: ImagePointRows, parameters: Sequence[ParameterRows], rows: Int, point: Int) -> Records:
    """Some rays as if they carried other numbers, with all that corrects them.

    Parameters
    ----------
    parameters : sequence of ParameterRows
        As all rays were observed with.
    rows : (k,) int
        Rays; the same may be there more than once.
    point : (k,) int
        Points in place of their own.
    """
    taken = [p.take(rows) for p in parameters]
    corrections = [LinearCorrection(p.group, p.block, p.basis) for p in taken if p.basis is not None]
    chosen, cameras = _through_cameras(rays.take(rows), taken)
    return image_point_records(replace(chosen, point=point), corrections, cameras)


def _through_cameras(
    rays: ImagePointRows, parameters: Sequence[ParameterRows]
) -> tuple[ImagePointRows, CameraRows | None]:
    """Rays with the cameras that have models of their own; corrected where these are known and allow it."""
    for p in parameters:
        if p.group == CAMERA:
            if p.free.any():
                return rays, CameraRows(p.block, p.model)
            return known_beforehand(rays, CameraRows(p.block, p.model, p.start))
    return rays, None


def film_correction(
    rows: ImagePointRows, group: str, model: Text | None = None, axes: Float | None = None, size: int = 6
) -> LinearCorrection:
    """The film corrections of each image, in photo coordinates from the fiducial centre.

    Parameters
    ----------
    model : (n_images,) str, optional
        Transformation of each image whose open parameters they are; affine if not given.
    axes : (n_images, 2, 2) float64, optional
        Its linear part, from nominal millimetres.
    size : int
        How many corrections are carried: those of the largest transformation.
    """
    photo = rows.xy_mm + rows.principal_point_mm
    if model is None or axes is None:
        return LinearCorrection(group, rows.image, open_basis("affine", photo, np.eye(2))[:, :, :size])
    basis = np.zeros((len(photo), 2, size))
    for one in np.unique(model):
        rays_of_model = np.flatnonzero(model[rows.image] == one)
        basis[rays_of_model] = open_basis(str(one), photo[rays_of_model], axes[rows.image[rays_of_model]])[:, :, :size]
    return LinearCorrection(group, rows.image, basis)


@dataclass(frozen=True)
class Collinearity:
    """The collinearity equations of image points."""

    rows: ImagePointRows
    corrections: Sequence[LinearCorrection]
    cameras: CameraRows | None

    def take(self, rows: Int) -> Collinearity:
        """Those of chosen rows."""
        cameras = None if self.cameras is None else self.cameras.take(rows)
        return Collinearity(self.rows.take(rows), [c.take(rows) for c in self.corrections], cameras)

    def compiled(self, order: Int) -> Weigh:
        """Their compiled lane in this order."""
        return compiled_lane(self.rows, self.corrections, self.cameras)(order)

    def __call__(self, state: State, chosen: Int) -> tuple[Float, tuple[Float, ...]]:
        """Residuals and Jacobians of chosen rows, by NumPy."""
        poses: Poses = state[POSE]
        image, point = self.rows.image[chosen], self.rows.point[chosen]
        X0, R, X = poses.position_m[image], poses.ground_from_image[image], state[POINT][point]
        u = in_image_axes(X0, R, X)
        v, by_u, by_camera = _at_camera(self.rows, self.cameras, state, chosen, u)
        for c in self.corrections:
            v = v - np.einsum("nij,nj->ni", c.basis[chosen], state[c.group][c.block[chosen]])
        by_point = np.einsum("nij,nkj->nik", by_u, R)
        by_pose = np.concatenate([-by_point, by_point @ skew(X - X0)], axis=2)
        return v, (by_pose, *(-c.basis[chosen] for c in self.corrections), *by_camera, by_point)


def image_point_records(
    rows: ImagePointRows, corrections: Sequence[LinearCorrection] = (), cameras: CameraRows | None = None
) -> Records:
    """Records of image points; they touch pose, corrections in their order, camera if unknown, and point."""
    touches = [(POSE, rows.image), *((c.group, c.block) for c in corrections)]
    if cameras is not None and cameras.fixed is None:
        touches.append((CAMERA, cameras.block))
    touches.append((POINT, rows.point))
    equations = Collinearity(rows, corrections, cameras)
    return Records(KIND, tuple(touches), equations, whitener_of_sigmas(rows.sigma_mm), rows.active, equations.compiled)


def _at_camera(
    rows: ImagePointRows, cameras: CameraRows | None, state: State, chosen: Int, u: Float
) -> tuple[Float, Float, tuple[Float, ...]]:
    """Computed minus measured, and its derivatives to u and to the camera where that is unknown."""
    if cameras is None:
        xy, by_u = project_derivatives(u, rows.c_mm[chosen])
        return xy - rows.xy_mm[chosen], by_u, ()
    v, by_u, by_camera = compared(cameras, cameras.parameters(state), chosen, u, rows.xy_mm[chosen])
    return v, by_u, (by_camera,) if cameras.fixed is None else ()
