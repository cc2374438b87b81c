"""Orientation and set-up of each stereo pair for a plotter, with its pass points and what is left at them.

The model has the left projection centre as origin, x along the base, z up as far as that is across it, metres on the
ground (scale 1). Images are turned in it by phi, omega, kappa of the notes (R = Ry(-phi) Rx(omega) Rz(kappa)); the base
has x alone: the elements of the independent relative orientation. Turned by E = R_model' R_image, rays (x, y, -c) are
those of the epipolar images, in which a point has the same y but for the y-parallax:

    x_e = -c d_1 / d_3,     y_e = -c d_2 / d_3,     d = E (x, y, -c)

Source: Kraus, Photogrammetry (epipolar images, set-up of oriented models); lecture notes A114, A304, A1405.
"""

import numpy as np

from aatri.arrays import Float, Text, finite_rows
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.evaluation import ModelSetUps, PassPoints
from aatri.evaluation.ray_pairs import ModelRays, model_axes
from aatri.evaluation.single_models import intersected
from aatri.geometry.rotations import angles_from_rotation
from aatri.observations.poses import Poses


def set_ups(block: Block, poses: Poses, rays: ModelRays, xyz_m: Float) -> tuple[ModelSetUps, PassPoints]:
    """Set-up of every model with its points; models whose base points along the view are left out.

    Parameters
    ----------
    poses : Poses
        In the Cartesian frame of the adjustment.
    xyz_m : (n_points, 3) float64, m
        Adjusted coordinates in the same frame.
    """
    axes = model_axes(poses, rays)
    kept = finite_rows(axes.reshape(len(axes), 9))
    number = np.cumsum(kept) - 1
    rows = np.flatnonzero(kept[rays.model])
    ray_model, model = rays.model[rows], number[rays.model[rows]]
    X, _, parallax_mm = (values[rows] for values in intersected(poses, rays, xyz_m[rays.point]))
    origin, ids = poses.position_m[rays.left], block.images.id
    E = [axes.swapaxes(1, 2) @ poses.ground_from_image[image] for image in (rays.left, rays.right)]
    epipolar = [_projected(E[k][ray_model], rays.xy_mm[rows, k], rays.c_mm[rows, k]) for k in (0, 1)]
    in_model = np.einsum("nji,nj->ni", axes[ray_model], X - origin[ray_model])
    scale = -in_model[:, 2] / (1e-3 * rays.c_mm[rows, 0])
    count = int(kept.sum())
    medians = [float(np.nanmedian(scale[model == k])) if (model == k).any() else np.nan for k in range(count)]
    made = ModelSetUps(
        left=ids[rays.left[kept]],
        right=ids[rays.right[kept]],
        origin_m=origin[kept],
        base_m=(poses.position_m[rays.right] - origin)[kept],
        ground_from_model=axes[kept],
        left_rad=angles_from_rotation(E[0][kept], "phi-omega-kappa"),
        right_rad=angles_from_rotation(E[1][kept], "phi-omega-kappa"),
        epipolar_from_left=E[0][kept],
        epipolar_from_right=E[1][kept],
        scale_number=np.array(medians),
        points=np.bincount(model, minlength=count).astype(np.int32),
    )
    points = PassPoints(
        left=ids[rays.left[ray_model]],
        right=ids[rays.right[ray_model]],
        point=block.points.id[rays.point[rows]],
        role=_roles(block)[rays.point[rows]],
        ground_m=xyz_m[rays.point[rows]],
        model_m=in_model,
        left_mm=epipolar[0],
        right_mm=epipolar[1],
        parallax_um=1e3 * parallax_mm,
        residual_m=X - xyz_m[rays.point[rows]],
    )
    return made, points


def _projected(E: Float, xy_mm: Float, c_mm: Float) -> Float:
    d = np.einsum("nij,nj->ni", E, np.column_stack([xy_mm, -c_mm]))
    return np.asarray(-c_mm[:, None] * d[:, :2] / d[:, 2:])


def _roles(block: Block) -> Text:
    """control, check or new, of all points."""
    roles, g = np.full(len(block.points), "new", dtype="U7"), block.ground_points
    for role, name in ((CHECK, "check"), (CONTROL, "control")):
        roles[g.point[(g.role == role).any(axis=1)]] = name
    return roles
