"""From interior orientations of the images to the artifact ImagePoints: what all variants share."""

import numpy as np

from aatri.adapters.interior.film_marks import pixel_matrix
from aatri.adapters.solution import stacked, suspect_rows
from aatri.adjustment.threads import by_rows
from aatri.arrays import Bool, Float, Int
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
from aatri.camera.pixels import half_format_mm
from aatri.errors import InputError
from aatri.geometry.plane_transformations import transform_plane
from aatri.geometry.vectors import largest_length


def image_points_of(
    block: Block,
    interior: Interior,
    *,
    fiducial_residuals: FiducialResiduals,
    suspects: Suspects,
    margin: float,
    film_deformation: Float | None = None,
) -> ImagePoints:
    """Transform all image points, subtract the principal point, and set aside what lies outside the format.

    Parameters
    ----------
    margin : float
        Share of the format by which a point may lie beyond its edge.
    film_deformation : (n, 2, 3) float64, optional
        Per image of measured film the transformation without deformation, a turn at nominal scale; NaN for others.
    """
    measured = block.image_points
    camera, row = block.images.camera[measured.image], np.full(len(block.images), -1)
    row[interior.image] = np.arange(len(interior))
    photo = measured_to_photo(interior, row[measured.image], measured.xy)
    shares = _shares_of_axes(np.concatenate([interior.matrix, np.full((1, 2, 3), np.nan)])[row])
    active = measured.active & np.isfinite(photo).all(axis=1)
    allowed = half_format_of(block)[camera] * (1 + margin)
    outside = active & (np.abs(photo) > allowed).any(axis=1)
    principal_point = block.cameras.principal_point_mm[camera]
    active &= ~outside
    corrections = {}
    if film_deformation is not None:
        rigid = film_deformation[measured.image]
        undeformed = np.einsum("nij,nj->ni", rigid[:, :, :2], measured.xy) + rigid[:, :, 2]
        corrections["film_deformation"] = largest_length(np.nan_to_num(photo - undeformed)[active])
    corrections["principal_point"] = largest_length(principal_point[active])
    return ImagePoints(
        images=ImageIds(id=block.images.id),
        points=PointIds(id=block.points.id),
        measurements=Measurements(
            image=measured.image,
            point=measured.point,
            xy_mm=photo - principal_point,
            sigma_mm=by_rows(lambda image, s: _along(shares[image], s), measured.image, measured.sigma_mm),
            active=active,
        ),
        interior=interior,
        fiducial_residuals=fiducial_residuals,
        corrections=Corrections(name=np.array(list(corrections)), largest_mm=np.array(list(corrections.values()))),
        suspects=stacked([suspects, _outside_suspects(block, photo, camera, outside)]),
    )


def calibrated_interior(block: Block, images: Int) -> Interior:
    """Interior orientation of the given images by the calibrated pixel size, or none where photo coordinates are given.

    Raises
    ------
    InputError
        If a camera's coordinates cannot be transformed without fiducial marks.
    """
    camera = block.images.camera[images]
    matrix = np.zeros((len(images), 2, 3))
    for one in np.unique(camera):
        matrix[camera == one] = _calibrated_matrix(block, int(one))
    finite = np.isfinite(matrix).all(axis=(1, 2))
    exact = {"terms": 0.0, "covariance": 0.0, "redundancy": 0}
    return Interior.of(image=images, model="calibrated", matrix=matrix, **exact).take(finite)


def measured_to_photo(interior: Interior, row: Int, uv: Float) -> Float:
    """Photo coordinates of measured points, each by the interior orientation of its image; NaN of row -1."""
    models, code = np.unique(interior.model, return_inverse=True)
    code = np.append(code, -1)

    def of_points(row: Int, uv: Float) -> Float:
        xy, of_point = np.full((len(uv), 2), np.nan), code[row]
        for k, model in enumerate(models):
            rows = np.flatnonzero(of_point == k)
            matrix, terms = interior.matrix[row[rows]], interior.terms[row[rows]]
            xy[rows] = transform_plane(str(model), matrix, terms, uv[rows, None])[:, 0]
        return xy

    return by_rows(of_points, row, uv)


def _calibrated_matrix(block: Block, camera: int) -> Float:
    cameras = block.cameras
    system = cameras.image_coordinates[camera]
    if system == "photo":
        return np.eye(2, 3)
    film = cameras.kind[camera] == "film"
    if system == "comparator" or (film and cameras.pixel_origin[camera] != "image-centre"):
        raise InputError(
            f"{system} coordinates of film have no calibrated relation to the photo system",
            where=f"camera {cameras.id[camera]}",
            remedy="measure fiducial marks and use interior_orientation/affine",
        )
    return pixel_matrix(cameras, camera, cameras.pixel_origin[camera], cameras.format[camera])


def half_format_of(block: Block) -> Float:
    """Half of the format of every camera, (n, 2) mm."""
    cameras = block.cameras
    return half_format_mm(cameras.kind == "digital", cameras.format, cameras.pixel_size_mm)


def _shares_of_axes(matrix: Float) -> Float:
    """Shares of the variances of u and v in those of x and y, (n, 2, 2), image by image."""
    squares = np.where(np.isfinite(matrix[:, :, :2]), matrix[:, :, :2], np.eye(2)) ** 2
    return np.asarray(squares / (squares[:, :, :1] + squares[:, :, 1:]))


def _along(share: Float, sigma_mm: Float) -> Float:
    """Standard deviations along the axes of the photo, (n, 2) mm."""
    return np.asarray(np.sqrt(np.einsum("nij,nj->ni", share, sigma_mm**2)))


def _outside_suspects(block: Block, photo: Float, camera: Int, outside: Bool) -> Suspects:
    rows = np.flatnonzero(outside)
    beyond = np.abs(photo[rows]) - half_format_of(block)[camera[rows]]
    measured = block.image_points
    return suspect_rows(
        "interior_orientation",
        "image_point",
        row=rows,
        image=block.images.id[measured.image[rows]],
        point=block.points.id[measured.point[rows]],
        size=beyond.max(axis=1, initial=0.0),
    )
