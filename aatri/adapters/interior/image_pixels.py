"""Image points that were found in pixels, put into a Block, and rays of pixels before they are in one."""

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from aatri.adapters.interior.film_marks import (
    film_images,
    film_interior,
    film_marks,
    of_usable,
    snooped_marks,
    unusable_film,
)
from aatri.adapters.interior.photo_coordinates import calibrated_interior
from aatri.adapters.solution import stacked
from aatri.adjustment.statistics.limits import MAX_SIGMA0
from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import Block, Cameras, FiducialPoints, MeasuredPoints, Points, Rejects
from aatri.artifacts.builder import image_point_order
from aatri.artifacts.image_points import Interior
from aatri.camera.pixels import mm_from_pixel
from aatri.errors import InputError
from aatri.tables.schema import Table, columns_of, tables_of

T = TypeVar("T", bound=Table)

CELLS = 8
"""Cells along each side of an image in which its points are counted."""


def covered_cells(block: Block) -> Float:
    """Share of the cells of each image with an active image point, (n_images,)."""
    return np.asarray(filled_cells(block, block.image_points.active).mean(axis=(1, 2)))


def filled_cells(block: Block, which: Bool) -> Bool:
    """Which cells of each image have one of these image points, (n_images, CELLS rows from below, CELLS columns)."""
    filled = np.zeros((len(block.images), CELLS**2), dtype=bool)
    filled[block.image_points.image[which], cells_of(block, CELLS)[which]] = True
    return filled.reshape(-1, CELLS, CELLS)


def cells_of(block: Block, cells: int) -> Int:
    """Number of the cell in which each image point lies, of cells x cells of its image, row by row from below, (n,)."""
    column, row = np.clip(places_in_images(block) * cells, 0, cells - 1).astype(np.int64).T
    return np.asarray(row * cells + column)


def places_in_images(block: Block, rows: Int | slice = slice(None)) -> Float:
    """Where image points lie, in widths and heights of their image from its lower left corner, (n, 2).

    Where the format is not given they lie in the middle.
    """
    cameras, of_image = block.cameras, block.images.camera[block.image_points.image[rows]]
    xy = block.image_points.xy[rows]
    share = np.zeros((len(xy), 2))
    in_use = np.unique(of_image).tolist()
    for camera in in_use:
        of_format = of_image == camera if len(in_use) > 1 else slice(None)
        if cameras.image_coordinates[camera] == "pixel":
            film = cameras.kind[camera] == "film"  # of scans the format is in mm
            size_px = cameras.format[camera] / (cameras.pixel_size_mm[camera] if film else 1.0)
            linear = mm_from_pixel(np.ones(2), str(cameras.pixel_origin[camera]), str(cameras.pixel_y[camera]), size_px)
            share[of_format] = (xy[of_format] @ linear[:, :2].T + linear[:, 2]) / size_px + 0.5
        else:
            share[of_format] = xy[of_format] / cameras.format[camera] + 0.5
    return np.nan_to_num(share, nan=0.5)


def pixel_matrices(block: Block) -> Float:
    """Matrices (n_images, 2, 3) from pixels, counted from the centre of the first, to mm from the principal point.

    Of scanned film by the measured fiducial marks, affine; NaN where an image has fewer than three that fit.

    Raises
    ------
    InputError
        If the camera of an image does not say how large its pixels are, or how many there are; if no film image has
        fiducial marks.
    """
    film = film_images(block)
    interior = calibrated_interior(block, np.flatnonzero(block.images.active & ~film))
    if film.any():
        interior = stacked([interior, _by_marks(block, np.flatnonzero(film))])
    camera = block.images.camera
    matrix = np.full((len(block.images), 2, 3), np.nan)
    matrix[interior.image] = interior.matrix
    own = from_first_pixel(block)
    matrix[:, :, 2] += (
        np.einsum("nij,nj->ni", matrix[:, :, :2], own[:, :, 2]) - block.cameras.principal_point_mm[camera]
    )
    matrix[:, :, :2] = matrix[:, :, :2] @ own[:, :, :2]
    return matrix


def _by_marks(block: Block, images: Int) -> Interior:
    """Affine interior orientation of the film images that interior_orientation/affine uses."""
    marks = film_marks(block, images)
    fit = snooped_marks(marks, "affine")
    fit = of_usable(fit, unusable_film(marks, fit, MAX_SIGMA0))
    if not fit.determined.any():
        raise InputError(
            f"none of {len(images)} film images has three measured fiducial marks that fit: pixels have no place",
            where=block.name,
            remedy="run fiducial_marks/template before tie_points, or measure the marks (fiducials.csv)",
        )
    return film_interior(marks, fit)


def from_first_pixel(block: Block) -> Float:
    """Matrices (n_images, 2, 3) to the pixel system of each image's camera from that of files: centre of the first.

    Raises
    ------
    InputError
        If the pixels of a film camera are counted from where only the size of each scan would tell.
    """
    cameras = block.cameras
    scanned = (cameras.kind == "film") & (cameras.image_coordinates == "pixel")
    for k in np.flatnonzero(
        scanned & ~np.isin(cameras.pixel_origin, ["", "top-left-corner", "top-left-centre"])
    ).tolist():
        raise InputError(
            f"pixels of scanned film are counted from {cameras.pixel_origin[k]}",
            where=f"camera {cameras.id[k]}",
            remedy="give pixel: {origin: top-left-corner} or top-left-centre, as scans are read",
        )
    shifted = [of_camera(block.cameras, k, block.cameras.format[k]) for k in range(len(block.cameras))]
    return np.array(shifted).reshape(-1, 2, 3)[block.images.camera]


def of_camera(cameras: Cameras, camera: int, format_px: Float) -> Float:
    """Matrix (2, 3) to the pixel system of a camera from that of a file of this width and height."""
    to_centre = mm_from_pixel(np.ones(2), "top-left-centre", "down", format_px)
    origin, y = str(cameras.pixel_origin[camera]), str(cameras.pixel_y[camera])
    own = mm_from_pixel(np.ones(2), origin or "top-left-corner", y or "down", format_px)
    inverse = np.linalg.inv(own[:, :2])
    return np.column_stack([inverse @ to_centre[:, :2], inverse @ (to_centre[:, 2] - own[:, 2])])


def with_fiducials(block: Block, image: Int, fiducial: Int, xy: Float, sigma_mm: Float) -> Block:
    """The block with these measured marks in the place of those that the images had.

    Parameters
    ----------
    image, fiducial : (n,) int
        Rows in images and fiducials.
    xy : (n, 2) float64
        In the pixel system of the camera.
    sigma_mm : (n, 2) float64, mm
    """
    others = block.fiducial_points.take(~np.isin(block.fiducial_points.image, image))
    further = FiducialPoints.of(image=image, fiducial=fiducial, xy=xy, sigma_mm=sigma_mm)
    rows = others.followed_by(further)
    return replace(block, fiducial_points=rows.take(np.lexsort((rows.fiducial, rows.image))))


def with_image_points(block: Block, image: Int, point: Text, xy_px: Float, sigma_px: Float, row_time_s: Float) -> Block:
    """The block with further image points.

    Parameters
    ----------
    image : (n,) int
        Rows in images.
    point : (n,) str
        Ids.
    xy_px : (n, 2) float64, px
        From the centre of the first pixel.
    sigma_px : (n,) float64, px
    row_time_s : (n,) float64, s
        From the image's time; NaN for shutters that expose all rows at once.
    """
    ids = np.unique(np.concatenate([block.points.id, point]))
    at = np.searchsorted(ids, block.points.id).astype(np.int32)
    tables: dict[str, Any] = {
        name: _renumbered(rows, at) for name in tables_of(Block) if (rows := getattr(block, name)) is not None
    }
    matrix = from_first_pixel(block)[image]
    size_mm = block.cameras.pixel_size_mm[block.images.camera[image]]
    further = MeasuredPoints.of(
        image=image,
        point=np.searchsorted(ids, point),
        xy=np.einsum("nij,nj->ni", matrix[:, :, :2], xy_px) + matrix[:, :, 2],
        sigma_mm=sigma_px[:, None] * size_mm,
        row_time_s=row_time_s,
    )
    rows = tables["image_points"].followed_by(further)
    tables |= {"points": Points(id=ids), "image_points": rows.take(image_point_order(rows))}
    return replace(block, **tables)


def with_measured(block: Block, rows: Int, xy_px: Float, sigma_px: Float, left_out: Int, reason: str) -> Block:
    """The block with other coordinates of some of its image points, and some set aside.

    Parameters
    ----------
    rows : (m,) int
        In image_points.
    xy_px, sigma_px : (n, 2) float64, px
        Of all image points, from the centre of the first pixel; those of other rows do not count.
    left_out : (k,) int
        Rows that are not used any more, and why.
    """
    points, active = block.image_points, block.image_points.active.copy()
    active[left_out] = False
    names = [f"{block.images.id[points.image[k]]}/{block.points.id[points.point[k]]}" for k in left_out.tolist()]
    further = Rejects.of(kind="image_point", id=names, reason=reason) if names else Rejects.empty()
    rejects = block.rejects.followed_by(further)
    matrix = from_first_pixel(block)[points.image[rows]]
    xy, sigma_mm = points.xy.copy(), points.sigma_mm.copy()
    xy[rows] = np.einsum("nij,nj->ni", matrix[:, :, :2], xy_px[rows]) + matrix[:, :, 2]
    sigma_mm[rows] = sigma_px[rows] * block.cameras.pixel_size_mm[block.images.camera[points.image[rows]]]
    changed = replace(points, xy=xy, sigma_mm=sigma_mm, active=active)
    return replace(block, image_points=changed.take(image_point_order(changed)), rejects=rejects)


def without_image_points(block: Block, which: Bool) -> Block:
    """The block without some of its image points, and without points that nothing names any more."""
    tables: dict[str, Any] = {name: rows for name in tables_of(Block) if (rows := getattr(block, name)) is not None}
    tables["image_points"] = block.image_points.take(~which)
    named = np.zeros(len(block.points), dtype=bool)
    for rows in tables.values():
        for name, declared in columns_of(type(rows)).items():
            if declared.refers == "points":
                named[getattr(rows, name)] = True
    at = (np.cumsum(named) - 1).astype(np.int32)
    tables = {name: _renumbered(rows, at) for name, rows in tables.items()}
    return replace(block, **(tables | {"points": Points(id=block.points.id[named])}))


def _renumbered(rows: Table, at: Int) -> Table:
    """A table with its rows in points counted anew."""
    moved = {name: at[getattr(rows, name)] for name, c in columns_of(type(rows)).items() if c.refers == "points"}
    return replace(rows, **moved) if moved else rows
