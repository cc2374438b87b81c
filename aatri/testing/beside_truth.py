"""What a stage gives beside the truth of the simulated example, and beside itself: `aatri.testing.check` judges by it.

A property names values of the result and how far each of them is off, in units of what is allowed. With the truth:
photo coordinates, orientations and points must be right to a share of the flying height, which every built-in method
keeps by far and no turned matrix, changed sign or other unit does. By itself: rotations are proper, covariances have no
negative variance, residuals and parallaxes are those of the result. Where a simple change puts it right, it is named.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.geometry.collinearity import in_image_axes, project
from aatri.geometry.coplanarity import RayPairs, parallax
from aatri.tables.schema import Artifact, columns_of, tables_of
from aatri.testing.properties import (
    NORMAL_MEDIAN,
    ROUNDING,
    SHARE_OF_SIGMA,
    Property,
    near,
    near_but_for_sign,
    no_covariance,
    no_rotation,
    sigma_of,
    sized,
    turned,
)

PHOTO_MM, LENGTH = 0.3, 0.01
"""Allowed: of photo coordinates, mm (the gross errors of the example have 0.2); of lengths, as a share of base or
distance. Built-in methods are off by a quarter of it at most."""

FACTOR, FACTOR_WITH_FILM = 3.0, 10.0
"""Allowed between standard deviations and what they are of; the second where errors of film and lens come on top."""


def properties(block: Block | None, inputs: Mapping[str, Artifact], made: Artifact) -> Iterator[Property]:
    """Properties of what a stage has made of an example.

    Parameters
    ----------
    block : Block, optional
        The example; without truth, or a Block, only what the result says of itself is judged.
    """
    yield from _matrices(made)
    if block is None:
        return
    if isinstance(made, ImagePoints) and block.true_images is not None:
        yield from _of_image_points(block, made)
    elif isinstance(made, Models):
        yield from _of_models(block, inputs.get("image_points"), made)
    elif isinstance(made, Strips) and block.true_images is not None:
        yield from _of_strips(_Truth(block), made)
    elif isinstance(made, Solution):
        yield from _of_solution(block, inputs.get("image_points"), made)
    elif isinstance(made, Evaluation):
        yield from _of_evaluation(block, inputs.get("solution"), made)


class _Truth:
    """True orientations and points, by the rows of the Block."""

    def __init__(self, block: Block) -> None:
        images, points = block.true_images, block.true_points
        assert images is not None
        assert points is not None
        self.position_m = np.full((len(block.images), 3), np.nan)
        self.ground_from_image = np.full((len(block.images), 3, 3), np.nan)
        self.xyz_m = np.full((len(block.points), 3), np.nan)
        self.position_m[images.image] = images.position_m
        self.ground_from_image[images.image] = images.ground_from_image
        self.xyz_m[points.point] = points.xyz_m
        self.height_m = float(np.nanmean(self.position_m[:, 2]) - np.nanmean(self.xyz_m[:, 2]))


def _matrices(made: Artifact) -> Iterator[Property]:
    """Rotations and covariances, wherever they stand."""
    for name, cls in tables_of(type(made)).items():
        rows = getattr(made, name)
        for column, declared in columns_of(cls).items() if rows is not None else ():
            if len(declared.shape) != 2 or declared.shape[0] != declared.shape[1] or name == "point_covariances":
                continue
            covariance = "covariance" in column
            property_, off = ("covariances", no_covariance) if covariance else ("rotations", no_rotation)
            yield Property(property_, f"{name}.{column}", getattr(rows, column), off)


def _of_image_points(block: Block, made: ImagePoints) -> Iterator[Property]:
    truth, m = _Truth(block), made.measurements
    image, point, used = m.image, m.point, np.flatnonzero(m.active)
    rays = in_image_axes(truth.position_m[image], truth.ground_from_image[image], truth.xyz_m[point])
    xy_mm = project(rays, block.cameras.principal_distance_mm[block.images.camera[image]])
    coordinates = Property("photo coordinates", "measurements.xy_mm", m.xy_mm[used], near(xy_mm[used], PHOTO_MM))
    yield coordinates
    if coordinates.breach():
        return  # errors that are none of chance
    size = sigma_of((m.xy_mm - xy_mm)[used])
    yield Property("standard deviations", "measurements.sigma_mm", m.sigma_mm[used], sized(size, FACTOR_WITH_FILM))


def _of_models(block: Block, photo: Artifact | None, made: Models) -> Iterator[Property]:
    o, p = made.orientations, made.model_points
    if isinstance(photo, ImagePoints):
        own_mm, sigma_mm = _parallaxes(block, photo, made)
        yield Property("residuals", "model_points.parallax_mm", p.parallax_mm, near_but_for_sign(own_mm, sigma_mm))
    if block.true_images is None:
        return
    # the errors of example blocks are those that their standard deviations say
    yield Property("standard deviations", "orientations.sigma0", o.sigma0, sized(1.0, FACTOR))
    truth = _Truth(block)
    X0, R = truth.position_m[o.left], truth.ground_from_image[o.left]
    base = np.einsum("nji,nj->ni", R, truth.position_m[o.right] - X0)
    length = np.linalg.norm(base, axis=1)
    turns = np.swapaxes(R, 1, 2) @ truth.ground_from_image[o.right]
    yield Property("orientations", "orientations.left_from_right", o.left_from_right, turned(turns))
    yield Property("orientations", "orientations.base", o.base, near(base / length[:, None], LENGTH))
    used, k = p.active, p.model[p.active]
    xyz = np.einsum("nji,nj->ni", R[k], truth.xyz_m[p.point[used]] - X0[k]) / length[k, None]
    yield Property("points", "model_points.xyz", p.xyz[used], near(xyz, LENGTH * np.linalg.norm(xyz, axis=1)))


def _parallaxes(block: Block, photo: ImagePoints, made: Models) -> tuple[Float, Float]:
    """Parallaxes that the orientations leave, and standard deviations of the right image points, mm."""
    o, p, m = made.orientations, made.model_points, photo.measurements
    row_of = {key: row for row, key in enumerate(zip(m.image.tolist(), m.point.tolist()))}
    c = block.cameras.principal_distance_mm[block.images.camera]
    own_mm, sigma_mm = np.full(len(p), np.nan), np.full(len(p), np.nan)
    for k, pair in enumerate(zip(o.left.tolist(), o.right.tolist())):
        rows = np.flatnonzero(p.model == k)
        left, right = (np.array([row_of[i, q] for q in p.point[rows].tolist()], dtype=np.int64) for i in pair)
        directions = [np.column_stack([m.xy_mm[r], np.full(len(r), -c[i])]) for r, i in zip((left, right), pair)]
        rays = RayPairs(directions[0], directions[1], m.sigma_mm[left], m.sigma_mm[right])
        own_mm[rows] = parallax(o.left_from_right[k], o.base[k], rays)[0]
        sigma_mm[rows] = m.sigma_mm[right].mean(axis=1)
    return own_mm, sigma_mm


def _of_strips(truth: _Truth, made: Strips) -> Iterator[Property]:
    """In the frame of the first image of each strip, in bases between its first two images."""
    s, p = made.strip_images, made.strip_points
    for k, name in enumerate(made.strips.id.tolist()):
        rows, points = np.flatnonzero(s.strip == k), np.flatnonzero(p.strip == k)
        if len(rows) < 2:
            continue
        first, second = s.image[rows[:2]]
        X0, R = truth.position_m[first], truth.ground_from_image[first]
        unit = np.linalg.norm(truth.position_m[second] - X0)
        position, xyz = ((X - X0) @ R / unit for X in (truth.position_m[s.image[rows]], truth.xyz_m[p.point[points]]))
        allowed = LENGTH * np.linalg.norm(xyz, axis=1).mean()
        turns = R.T @ truth.ground_from_image[s.image[rows]]
        at = f"of strip {name}"
        yield Property("orientations", f"strip_images.strip_from_image {at}", s.strip_from_image[rows], turned(turns))
        yield Property("orientations", f"strip_images.position {at}", s.position[rows], near(position, allowed))
        yield Property("points", f"strip_points.xyz {at}", p.xyz[points], near(xyz, allowed))


def _of_solution(block: Block, photo: Artifact | None, made: Solution) -> Iterator[Property]:
    i, p = made.images, made.points
    if block.true_images is not None and made.datum is None:  # a free datum is not that of the truth
        truth = _Truth(block)
        allowed_m = LENGTH * truth.height_m
        yield Property("orientations", "images.position_m", i.position_m, near(truth.position_m, allowed_m))
        off = turned(truth.ground_from_image)
        yield Property("orientations", "images.ground_from_image", i.ground_from_image, off)
        points = Property("points", "points.xyz_m", p.xyz_m, near(truth.xyz_m, allowed_m))
        yield points
        new = ~np.isin(np.arange(len(p)), block.ground_points.point)
        sigma_m = np.einsum("nii->ni", p.covariance_m2[new]).clip(0) ** 0.5
        off = sized(sigma_of((p.xyz_m - truth.xyz_m)[new]), FACTOR)
        if not points.breach():
            yield Property("standard deviations", "points.covariance_m2, as standard deviations", sigma_m, off)
    r = made.residuals
    rows = np.flatnonzero((r.kind == "control") & r.active & (r.row >= 0))
    own_m = p.xyz_m[block.ground_points.point[r.row[rows]]] - block.ground_points.xyz_m[r.row[rows]]
    sigma_m = np.where(r.sigma[rows] > 0, r.sigma[rows], np.inf)
    yield Property("residuals", "residuals of control", r.residual[rows], near(own_m, SHARE_OF_SIGMA * sigma_m))
    if isinstance(photo, ImagePoints):
        yield from _residuals_of_rays(block, photo, made)


_CORRECT_IMAGES = ("interior", "additional", "film")
"""Groups of parameters that move image points: then a ray without them says the size of a residual only."""


def _residuals_of_rays(block: Block, photo: ImagePoints, made: Solution) -> Iterator[Property]:
    r, m = made.residuals, photo.measurements
    rows = np.flatnonzero((r.kind == "image_point") & r.active & (r.row >= 0))
    image, point = m.image[r.row[rows]], m.point[r.row[rows]]
    X0, R, X = made.images.position_m[image], made.images.ground_from_image[image], made.points.xyz_m[point]
    own_mm = project(in_image_axes(X0, R, X), made.cameras.principal_distance_mm[block.images.camera[image]])
    own_mm -= m.xy_mm[r.row[rows]]
    sigma_mm = m.sigma_mm[r.row[rows]]
    corrected = np.isin(made.parameters.group, _CORRECT_IMAGES).any()
    size = NORMAL_MEDIAN * float(np.median(sigma_mm)) if len(rows) else np.nan
    off = sized(size, FACTOR_WITH_FILM) if corrected else near(own_mm, SHARE_OF_SIGMA * sigma_mm)
    yield Property("residuals", "residuals of image points", r.residual[rows, :2], off)


def _of_evaluation(block: Block, solution: Artifact | None, made: Evaluation) -> Iterator[Property]:
    row = {point: k for k, point in enumerate(block.points.id.tolist())}
    d, figures = made.differences, dict(zip(made.figures.name.tolist(), made.figures.value.tolist()))
    if isinstance(solution, Solution):
        control_m = block.given_m
        for kind in ("control", "check"):
            of_kind = d.kind == kind
            at = [row[point] for point in d.point[of_kind].tolist()]
            own_m = solution.points.xyz_m[at] - control_m[at]
            allowed_m = ROUNDING * np.linalg.norm(own_m, axis=1)
            yield Property("figures", f"differences of {kind} points", d.difference_m[of_kind], near(own_m, allowed_m))
            names = [f"{kind}_rmse_{axis}_m" for axis in "xyz"]
            if kind == "check" and at and all(name in figures for name in names):
                rmse_m = np.sqrt(np.nanmean(own_m**2, axis=0))
                values = np.array([figures[name] for name in names])
                yield Property("figures", "check_rmse_x_m, y, z", values, near(rmse_m, ROUNDING * rmse_m))
    for name, rows in (("displacements", made.displacements), ("layout_points", made.layout_points)):
        if rows is not None and block.true_points is not None:
            truth = _Truth(block)
            xyz_m = truth.xyz_m[[row[point] for point in rows.point.tolist()]]
            yield Property("points", f"{name}.xyz_m", rows.xyz_m, near(xyz_m, LENGTH * truth.height_m))
