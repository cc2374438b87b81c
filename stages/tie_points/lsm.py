"""Least squares matching of the rays of every tie point, guided by a first orientation.

    g(A u + p) + v = a t(u + s + B u) + b      t: patch of the reference image, g: another image; A affine
    A = J_b J_a^-1,   J = d(x, y) / d(X, Y)    start, from the orientations and a level ground at the point

The reference of a point is its image point of median standard deviation; all others are measured against its patch. An
image point that correlates less than `min_correlation`, or moves by more than `max_shift_px`, is left out: it is
another place, and listed among the rejects; so are those of a point with fewer than two. Standard deviations hold what
neighbouring residuals have in common, and relief within the patch, that is not affine: of all patches of a pair
together, from the shifts of their parts. Half of the variance of noise is the reference's.

Image points of control stay. Source: Gruen 1985, South African Journal of Photogrammetry 14, 175; Ackermann 1984.
"""

import numpy as np

from aatri.adapters.interior.image_pixels import from_first_pixel, pixel_matrices, with_measured
from aatri.adapters.solution import check_same_block
from aatri.arrays import finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.features import ScanMarks
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.geometry.collinearity import collinearity
from aatri.pixels.least_squares_matching import matched_rays, median_rows, medians_of_points
from aatri.plugin import SILENT, Context, Field, Options, stage
from aatri.progress import Item


class LsmOptions(Options):
    """Options of least squares matching."""

    half_px: int = Field(10, ge=4, description="half side of a patch, px")
    min_correlation: float = Field(0.8, gt=0, lt=1, description="an image point that is less like its reference goes")
    max_shift_px: float = Field(1.5, gt=0, description="an image point that moves farther goes, px")
    smallest_sigma_px: float = Field(
        0.1, gt=0, description="no image point is more precise than this, px; photographs have more errors than patches"
    )


@stage(version=1, uses=())
def lsm(block: Block, solution: Solution, *, options: LsmOptions = LsmOptions(), context: Context = SILENT) -> Block:
    """Measure tie points anew."""
    check_same_block(block, solution=solution)
    points = block.image_points
    is_tie = finite_rows(solution.points.xyz_m)
    is_tie[block.ground_points.point] = False
    usable = points.active & is_tie[points.point] & finite_rows(solution.images.position_m)[points.image]
    rows = np.flatnonzero(usable & (block.images.path[points.image] != ""))
    reference = median_rows(points.point[rows], points.sigma_mm[rows, 0])
    own = from_first_pixel(block)
    inverse = np.linalg.inv(own[:, :, :2])
    xy_px = np.einsum("nij,nj->ni", inverse[points.image], points.xy - own[points.image, :, 2])
    to_px = np.linalg.inv(pixel_matrices(block)[:, :, :2])
    poses = solution.images.take(points.image[rows])
    c_mm = block.cameras.principal_distance_mm[block.images.camera[points.image[rows]]]
    by_ground = collinearity(
        poses.position_m, poses.ground_from_image, solution.points.xyz_m[points.point[rows]], c_mm
    )[2]
    linear = to_px[points.image[rows]] @ by_ground[:, :, :2]  # level ground at the point
    pair = np.column_stack([points.image[rows[reference]], points.image[rows]])
    other = np.flatnonzero(reference != np.arange(len(rows)))
    if not len(other):
        raise InputError("no tie point in two oriented images", where=block.name, remedy="see the Solution it takes")
    images, pair_row = np.unique(pair[other], axis=0, return_inverse=True)
    work, members = [], []
    for k, (a, b) in enumerate(images.tolist()):
        of_other = other[pair_row.ravel() == k]
        affine = linear[of_other] @ np.linalg.inv(linear[reference[of_other]])
        places = np.column_stack([xy_px[rows[reference[of_other]]], xy_px[rows[of_other]], affine.reshape(-1, 4)])
        files = tuple(str(block.images.path[i]) for i in (a, b))
        contents = [str(block.images.content[i]) for i in (a, b)]
        name = f"{block.images.id[a]} and {block.images.id[b]}"
        work.append(Item(name, files, (contents, options.half_px, places.tolist())))
        members.append(rows[of_other])
    marks = [kept.load().marks for kept in context.mapped(matched_rays, work, ScanMarks, "pairs")]
    at = np.concatenate(members)
    xy, like = (np.concatenate([getattr(f, n)[: len(f) // 2] for f in marks]) for n in ("xy_px", "correlation"))
    sigma, of_reference = (np.concatenate([np.split(f.sigma_px, 2)[k] for f in marks]) for k in (0, 1))
    moved = np.hypot(*(xy - xy_px[at]).T)
    good = (like >= options.min_correlation) & (moved <= options.max_shift_px)
    context.log(
        f"{int(good.sum())} of {len(at)} image points are matched; they moved by "
        f"{np.median(moved[good]) if good.any() else 0:.2f} px in the median"
    )
    made_px, sigma_px = xy_px.copy(), np.full((len(points), 2), np.nan)
    made_px[at[good]], sigma_px[at[good]] = xy[good], sigma[good]
    heads = rows[reference == np.arange(len(rows))]
    medians = medians_of_points(points.point[at[good]], of_reference[good], len(block.points))
    sigma_px[heads] = medians[points.point[heads]]
    sigma_px = np.maximum(sigma_px, options.smallest_sigma_px)
    measured = finite_rows(sigma_px)
    single = np.bincount(points.point[measured], minlength=len(block.points)) < 2
    measured &= ~single[points.point]
    return with_measured(
        block, np.flatnonzero(measured), made_px, sigma_px, rows[~measured[rows]], "not matched by least squares"
    )
