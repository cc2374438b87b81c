"""Single-model restitution: every stereo pair by itself, with the orientations of the block held, as a plotter sets it.

The two rays of a point, measured coordinates with all corrections that the block found, meet nowhere exactly. Least
squares gives the point of the model X_m; of four coordinates one is redundant, and

    w = sqrt(v'P v)                                         is |N(0, 1)| but for the share the block has taken up
    p_y = y' - y'',   y = -c (d.e2) / (d.e3)                is the y-parallax, with e1 along the base, e3 up

remain. X_m - X of the block shows what this pair alone would have given; against control and check points, what a
plotter would find there. Pairs are neighbours in a strip; images without a strip are paired with the image with which
they share most points.

Source: Kraus, Photogrammetry (y-parallaxes of oriented pairs); the quality module of classical block programs.
"""

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aatri.arrays import Float, Int, sums_of
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.evaluation import Evaluation, Figures, SingleModels
from aatri.artifacts.solution import Solution
from aatri.evaluation.ray_pairs import ModelRays, model_axes, ray_pairs
from aatri.geometry.collinearity import in_image_axes
from aatri.observations.poses import Poses

CHUNK = 20_000
"""Points restituted at once, which stay in the cache."""

STEPS = 2
"""From the adjusted point the intersection has converged after two steps."""

PARALLEL = 1e-12
"""Determinant of normal equations of mean diagonal 1: about the square of the angle between the two rays, rad."""


def intersected(poses: Poses, rays: ModelRays, start_m: Float) -> tuple[Float, Float, Float]:
    """Points of the models, from their two rays alone.

    Parameters
    ----------
    start_m : (m, 3) float64, m

    Returns
    -------
    xyz_m : (m, 3) float64, m
    w : (m,) float64
        Length of the residuals in standard deviations.
    parallax_mm : (m,) float64, mm
        y-parallax; NaN where the base points along the view.
    """
    images = (rays.left[rays.model], rays.right[rays.model])
    X, w, parallax = np.empty_like(start_m), np.empty(len(start_m)), np.empty(len(start_m))
    for first in range(0, len(X), CHUNK):
        chunk = slice(first, first + CHUNK)
        pair = [(poses.position_m[i[chunk]], poses.ground_from_image[i[chunk]]) for i in images]
        of_chunk = replace(
            rays, model=rays.model[chunk], xy_mm=rays.xy_mm[chunk], sigma_mm=rays.sigma_mm[chunk], c_mm=rays.c_mm[chunk]
        )
        X[chunk], w[chunk] = _least_squares(pair, of_chunk, start_m[chunk])
        parallax[chunk] = y_parallax(poses, of_chunk)
    return X, w, parallax


def _least_squares(pair: list[tuple[Float, Float]], rays: ModelRays, X: Float) -> tuple[Float, Float]:
    """Points of the two rays each, and the lengths of the residuals; NaN of rays that do not meet.

    x = -c u / w with (u, v, w) in the axes of the image, i, j and k: dx/dX = -c / w (i - u / w k).
    """
    meet = np.ones(len(X), dtype=bool)
    for step in range(STEPS + 1):
        N, right, squares = np.zeros((len(X), 3, 3)), np.zeros((len(X), 3)), np.zeros(len(X))
        for k, (X0, R) in enumerate(pair):
            u = in_image_axes(X0, R, X)
            scale = -rays.c_mm[:, k] / u[:, 2]
            for axis in (0, 1):
                v = (rays.xy_mm[:, k, axis] - scale * u[:, axis]) / rays.sigma_mm[:, k, axis]
                squares += v**2
                B = R[:, :, axis] - (u[:, axis] / u[:, 2])[:, None] * R[:, :, 2]
                B *= (scale / rays.sigma_mm[:, k, axis])[:, None]
                N += np.einsum("ni,nj->nij", B, B)
                right += v[:, None] * B
        if step < STEPS:
            cofactors = np.cross(N[:, [1, 2, 0]], N[:, [2, 0, 1]])
            determinant = np.einsum("ni,ni->n", N[:, 0], cofactors[:, 0])
            meet &= determinant > PARALLEL * (np.einsum("nii->n", N) / 3) ** 3
            X = X + np.einsum("nij,nj->ni", cofactors, right) / np.where(meet, determinant, np.inf)[:, None]
    return np.where(meet[:, None], X, np.nan), np.where(meet, np.sqrt(squares), np.nan)


def y_parallax(poses: Poses, rays: ModelRays) -> Float:
    """y' - y'' in the normal case of each model, at the scale of its left camera, (m,) mm."""
    _, e2, e3 = model_axes(poses, rays)[rays.model].transpose(2, 0, 1)
    y = []
    for k, image in enumerate((rays.left[rays.model], rays.right[rays.model])):
        in_camera = np.column_stack([rays.xy_mm[:, k], -rays.c_mm[:, k]])
        d = np.einsum("nij,nj->ni", poses.ground_from_image[image], in_camera)
        y.append(-rays.c_mm[:, 0] * (d * e2).sum(axis=1) / (d * e3).sum(axis=1))
    return np.asarray(y[0] - y[1])


def single_models(
    block: Block,
    solution: Solution,
    poses: Poses,
    xyz_m: Float,
    to_block: Callable[[Float], Float],
    *,
    compared: bool,
) -> SingleModels | None:
    """Restitute every model of a block; None where it has none.

    Parameters
    ----------
    poses : Poses
        In the frame of the adjustment.
    xyz_m : (n_points, 3) float64, m
        In the same.
    to_block : callable
        Coordinates of the frame of the adjustment -> of the block.
    compared : bool
        Check points are in the frame of the solution (`alignment.in_frame_of_check`).
    """
    rays = ray_pairs(block, solution, poses, xyz_m)
    if rays is None:
        return None
    X, w, parallax = intersected(poses, rays, xyz_m[rays.point])
    X = to_block(X)
    reference = {role: np.full((len(block.points), 3), np.nan) for role in (CONTROL, CHECK)}
    for role, values in reference.items():
        values[block.ground_points.point] = np.where(
            block.ground_points.role == role, block.ground_points.xyz_m, np.nan
        )
    if not compared:
        reference[CHECK][:] = np.nan
    to_control, to_check = (X - reference[role][rays.point] for role in (CONTROL, CHECK))
    n = len(rays.left)
    first = np.searchsorted(rays.model, np.arange(n + 1))
    parts = [slice(int(a), int(b)) for a, b in itertools.pairwise(first)]
    largest = [part.start + int(np.nan_to_num(np.abs(parallax[part]), nan=-1.0).argmax()) for part in parts]

    def of_models(values: Float) -> Float:
        """Root mean square of each column, model by model."""
        finite = np.isfinite(values)
        squares = np.where(finite, values, 0.0) ** 2
        total, number = (sums_of(part, rays.model, n) for part in (squares, finite.astype(np.float64)))
        return np.sqrt(np.divide(total, number, out=np.full_like(total, np.nan), where=number > 0))

    def count(values: Float) -> Int:
        return np.bincount(rays.model, weights=np.isfinite(values).any(axis=1), minlength=n).astype(np.int32)

    ids = block.images.id
    base = poses.position_m[rays.right] - poses.position_m[rays.left]
    return SingleModels(
        left=ids[rays.left],
        right=ids[rays.right],
        points=np.bincount(rays.model, minlength=n).astype(np.int32),
        base_m=np.linalg.norm(base, axis=1),
        parallax_rms_um=1e3 * of_models(parallax[:, None])[:, 0],
        parallax_max_um=1e3 * np.array([np.abs(parallax[k]) for k in largest]),
        parallax_max_at=block.points.id[rays.point[largest]],
        w_rms=of_models(w[:, None])[:, 0],
        adjusted_rms_m=of_models(X - solution.points.xyz_m[rays.point]),
        control_points=count(to_control),
        control_rms_m=of_models(to_control),
        check_points=count(to_check),
        check_rms_m=of_models(to_check),
    )


def with_models(evaluation: Evaluation, models: SingleModels | None, *, compared: bool) -> Evaluation:
    """The evaluation with its models, their figures and a sentence, and why they are not compared with check points."""
    if models is None or not np.isfinite(models.parallax_max_um).any():
        return evaluation

    def pooled(values: Float, counts: Int) -> Float:
        finite = np.isfinite(values) & (counts > 0)[:, None]
        total = np.where(finite, counts[:, None], 0).sum(axis=0)
        squares = np.where(finite, counts[:, None] * values**2, 0.0).sum(axis=0)
        return np.sqrt(np.where(total > 0, squares / np.maximum(total, 1), np.nan))

    parallax = float(pooled(models.parallax_rms_um[:, None], models.points)[0])
    figures = {
        "single_models": float(len(models)),
        "model_parallax_rmse_um": parallax,
        "model_parallax_max_um": float(np.nanmax(models.parallax_max_um, initial=0.0)),
        "model_w_rms": float(pooled(models.w_rms[:, None], models.points)[0]),
    }
    for what, values, counts in (
        ("adjusted", models.adjusted_rms_m, models.points),
        ("control", models.control_rms_m, models.control_points),
        ("check", models.check_rms_m, models.check_points),
    ):
        figures |= {f"model_{what}_rmse_{axis}_m": float(v) for axis, v in zip("xyz", pooled(values, counts))}
    figures = {name: value for name, value in figures.items() if np.isfinite(value)}
    digits = ".2g" if parallax < 10 else ".0f"
    count = f"{len(models)} single model{'' if len(models) == 1 else 's'}"
    why = " Models are not compared with check points: the datum is free, and they are in another frame."
    return replace(
        evaluation,
        verdict=f"{evaluation.verdict} y-parallaxes of {parallax:{digits}} um RMS in {count}.{'' if compared else why}",
        figures=Figures(
            name=np.concatenate([evaluation.figures.name, list(figures)]),
            value=np.concatenate([evaluation.figures.value, list(figures.values())]),
        ),
        models=models,
    )
