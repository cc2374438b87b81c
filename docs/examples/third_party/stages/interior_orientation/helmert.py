"""Interior orientation of film by a similarity (Helmert) transformation: shift, rotation and one scale.

    z = p w + q,   p = sum g conj(w - w0) (z - z0) / sum g |w - w0|^2,   q = z0 - p w0

w = u + i v measured on the comparator, z = x + i y photo coordinates of the fiducial marks, mm, w0 and z0 their means
with the weights g = 1 / variance: least squares over the marks of each image. For film that keeps its shape.

Source: Kraus, Photogrammetry 1, sec. 3.2, in complex numbers.
"""

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import (
    Corrections,
    FiducialResiduals,
    ImageIds,
    ImagePoints,
    Interior,
    Measurements,
    PointIds,
)
from aatri.artifacts.suspects import Suspects
from aatri.errors import GeometryError, InputError
from aatri.plugin import SILENT, Context, Field, Options, stage


class HelmertOptions(Options):
    scale_limit: float = Field(1e-3, gt=0, description="largest change of scale that passes without a warning")


@stage(version=1, uses=("image_points.xy", "fiducial_points.xy"))
def helmert(block: Block, *, options: HelmertOptions = HelmertOptions(), context: Context = SILENT) -> ImagePoints:
    """Photo coordinates of film by a similarity of its fiducial marks."""
    if not (block.cameras.image_coordinates == "comparator").all():
        raise InputError("a camera is not measured on a comparator", remedy="use interior_orientation/affine")
    marks, given, n = block.fiducial_points, block.image_points, len(block.images)
    count = np.bincount(marks.image, minlength=n)
    if (count < 2).any():
        raise GeometryError(f"fewer than 2 fiducial marks in image {', '.join(block.images.id[count < 2])}")

    def total(values):  # over the marks of each image
        return np.bincount(marks.image, values.real, n) + 1j * np.bincount(marks.image, values.imag, n)

    w, z = marks.xy @ [1, 1j], block.fiducials.xy_mm[marks.fiducial] @ [1, 1j]
    g = 1 / (marks.sigma_mm**2).mean(axis=1)
    w0, z0 = total(g * w) / total(g), total(g * z) / total(g)
    dw, dz = w - w0[marks.image], z - z0[marks.image]
    p = total(g * dw.conj() * dz) / total(g * abs(dw) ** 2)
    q = z0 - p * w0
    residual = p[marks.image] * w + q[marks.image] - z
    redundancy = 2 * count - 4
    sigma0 = np.sqrt(total(g * abs(residual) ** 2).real / np.where(redundancy > 0, redundancy, np.nan))
    for image in np.flatnonzero(abs(abs(p) - 1) > options.scale_limit):
        context.warn(f"image {block.images.id[image]}: scale {abs(p[image]):.6f}")

    photo = p[given.image] * (given.xy @ [1, 1j]) + q[given.image]
    deformation = abs(photo * (1 - 1 / abs(p[given.image])))
    point = block.cameras.principal_point_mm[block.images.camera[given.image]]
    return ImagePoints(
        images=ImageIds(id=block.images.id),
        points=PointIds(id=block.points.id),
        measurements=Measurements(image=given.image, point=given.point, xy_mm=xy(photo) - point,
                                  sigma_mm=given.sigma_mm, active=given.active),
        interior=Interior(image=np.arange(n), model=np.full(n, "similarity"),
                          matrix=np.stack([xy(p), xy(1j * p), xy(q)], axis=-1),
                          terms=np.zeros((n, 2)), sigma0=sigma0, redundancy=redundancy,
                          covariance=left_open(total(g).real, total(g * abs(dz) ** 2).real, z0),
                          film_scale=np.tile(1 / abs(p)[:, None], 2), film_shear_rad=np.zeros(n)),
        fiducial_residuals=FiducialResiduals(row=np.arange(len(marks)), image=marks.image, residual_mm=xy(residual),
                                             fiducial=block.fiducials.id[marks.fiducial],
                                             active=np.full(len(marks), True)),
        corrections=Corrections(name=np.array(["film_deformation", "principal_point"]),
                                largest_mm=np.array([deformation.max(initial=0), abs(point @ [1, 1j]).max(initial=0)])),
        suspects=Suspects.empty(),
    )  # fmt: skip


def xy(z):
    return np.stack([z.real, z.imag], axis=-1)


def left_open(weight_q, weight_p, z0):
    """Covariance of d0 ... d3, dx = d0 + d1 x - d2 y, dy = d3 + d2 x + d1 y, from dz = dq + dp (z - z0)."""
    o, i, x, y = 0 * z0.real, 1 + 0 * z0.real, z0.real, z0.imag
    by_qp = np.array([[i, o, -x, y], [o, o, i, o], [o, o, o, i], [o, i, -y, -x]])
    variance = 1 / np.array([weight_q, weight_q, weight_p, weight_p])
    found = np.zeros((len(z0), 8, 8))
    found[:, :4, :4] = np.einsum("ijn,jn,kjn->nik", by_qp, variance, by_qp)
    return found
