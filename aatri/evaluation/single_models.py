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
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.threads import in_threads
from aatri.arrays import Float, Int, sums_of
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.evaluation import Evaluation, Figures, SingleModels
from aatri.artifacts.solution import Solution
from aatri.evaluation.ray_pairs import ModelRays, StereoPairs, model_axes, stereo_pairs
from aatri.observations.poses import Poses

CHUNK = 4_000
"""Points restituted at once, which stay in the cache."""

PAIRS_AT_ONCE = 500
"""Pairs of images restituted by one thread at a time: some 100,000 points."""

CHUNKS_A_THREAD = 50
"""Chunks for which a thread of their own pays: more than `PAIRS_AT_ONCE` have, which are a thread's already."""

NEXT, AFTER = [1, 2, 0], [2, 0, 1]
"""Cyclic successors of the three coordinates, for the cofactors of a matrix."""

STEPS = 2
"""From the adjusted point the intersection has converged after two steps."""

PARALLEL = 1e-12
"""Determinant of normal equations of mean diagonal 1: about the square of the angle between the two rays, rad."""


@dataclass(frozen=True)
class _PairRays:
    """One ray each of points, coordinate by coordinate."""

    position_m: Float
    """(3, m), m."""
    ground_from_image: Float
    """(3, 3, m)."""
    xy_mm: Float
    sigma_mm: Float
    """(2, m), mm."""
    c_mm: Float
    """(m,), mm."""


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
    X, w, parallax = np.empty_like(start_m), np.empty(len(start_m)), np.empty(len(start_m))
    axes = model_axes(poses, rays)

    def chunks(first: int, last: int) -> None:
        for k in range(first, last):
            chunk = slice(k * CHUNK, (k + 1) * CHUNK)
            pair = _pair_of(poses, rays, chunk)
            X[chunk], w[chunk] = _least_squares(pair, start_m[chunk].T)
            parallax[chunk] = _y_parallax(pair, axes[rays.model[chunk]].transpose(1, 2, 0))

    in_threads(-(-len(X) // CHUNK), chunks, worth=CHUNKS_A_THREAD)
    return X, w, parallax


def _pair_of(poses: Poses, rays: ModelRays, chunk: slice) -> list[_PairRays]:
    """The left and the right rays of points."""
    model, pair = rays.model[chunk], list[_PairRays]()
    for k, images in enumerate((rays.left, rays.right)):
        image = images[model]
        R = np.ascontiguousarray(poses.ground_from_image[image].transpose(1, 2, 0))
        xy, sigma = (np.ascontiguousarray(values[chunk, k].T) for values in (rays.xy_mm, rays.sigma_mm))
        pair.append(_PairRays(poses.position_m[image].T, R, xy, sigma, rays.c_mm[chunk, k]))
    return pair


def _least_squares(pair: list[_PairRays], X: Float) -> tuple[Float, Float]:
    """Points of the two rays each, (m, 3), and the lengths of the residuals, (m,); NaN of rays that do not meet.

    x = -c u / w with (u, v, w) in the axes of the image, i, j and k: dx/dX = -c / w (i - u / w k).

    Parameters
    ----------
    X : (3, m) float64, m
        Where they begin.
    """
    m = X.shape[1]
    meet = np.ones(m, dtype=bool)
    for step in range(STEPS + 1):
        N, right, squares = np.zeros((3, 3, m)), np.zeros((3, m)), np.zeros(m)
        for ray in pair:
            R = ray.ground_from_image
            u = (R * (X - ray.position_m)[:, None]).sum(axis=0)
            scale = -ray.c_mm / u[2]
            v = (ray.xy_mm - scale * u[:2]) / ray.sigma_mm
            squares += (v**2).sum(axis=0)
            if step < STEPS:
                B = (R[:, :2] - R[:, 2:] * (u[:2] / u[2])) * (scale / ray.sigma_mm)
                N += (B[:, None] * B).sum(axis=2)
                right += (B * v).sum(axis=1)
        if step < STEPS:
            cofactors = N[NEXT][:, NEXT] * N[AFTER][:, AFTER] - N[NEXT][:, AFTER] * N[AFTER][:, NEXT]
            determinant = (N[0] * cofactors[0]).sum(axis=0)
            meet &= determinant > PARALLEL * ((N[0, 0] + N[1, 1] + N[2, 2]) / 3) ** 3
            X = X + (cofactors * right).sum(axis=1) / np.where(meet, determinant, np.inf)
    return np.where(meet, X, np.nan).T, np.where(meet, np.sqrt(squares), np.nan)


def _y_parallax(pair: list[_PairRays], axes: Float) -> Float:
    """y' - y'' in the normal case, at the scale of the left camera, (m,) mm; axes of models (3, 3, m) by columns."""
    y = []
    for ray in pair:
        in_camera = np.concatenate([ray.xy_mm, -ray.c_mm[None]])
        d = (ray.ground_from_image * in_camera).sum(axis=1)
        y.append(-pair[0].c_mm * (d * axes[:, 1]).sum(axis=0) / (d * axes[:, 2]).sum(axis=0))
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
    pairs = stereo_pairs(block, solution, poses, xyz_m)
    if pairs is None:
        return None
    reference = {role: np.full((len(block.points), 3), np.nan) for role in (CONTROL, CHECK)}
    for role, values in reference.items():
        values[block.ground_points.point] = np.where(
            block.ground_points.role == role, block.ground_points.xyz_m, np.nan
        )
    if not compared:
        reference[CHECK][:] = np.nan
    parts = dict[int, SingleModels]()

    def restitute(first: int, last: int) -> None:
        for k in range(first, last):
            rays = pairs.rays(k * PAIRS_AT_ONCE, (k + 1) * PAIRS_AT_ONCE)
            parts[k] = _restituted(pairs, rays, reference, to_block)

    in_threads(-(-len(pairs.images) // PAIRS_AT_ONCE), restitute, worth=1)
    columns = {name: [getattr(parts[k], name) for k in sorted(parts)] for name in SingleModels.__dataclass_fields__}
    models = SingleModels(**{name: np.concatenate(values) for name, values in columns.items()}) if parts else None
    return models if models is not None and len(models) else None


def _restituted(
    pairs: StereoPairs, rays: ModelRays, reference: Mapping[int, Float], to_block: Callable[[Float], Float]
) -> SingleModels:
    """Some models and what they are compared with: coordinates of control and check points, (n_points, 3) m."""
    X, w, parallax = intersected(pairs.poses, rays, pairs.xyz_m[rays.point])
    X = to_block(X)
    rows_by_role = {role: np.flatnonzero(np.isfinite(xyz[rays.point]).any(axis=1)) for role, xyz in reference.items()}
    off = {role: X[rows] - reference[role][rays.point[rows]] for role, rows in rows_by_role.items()}
    n = len(rays.left)
    first = np.searchsorted(rays.model, np.arange(n + 1))
    size = np.nan_to_num(np.abs(parallax), nan=-1.0)
    largest = np.array([a + int(size[a:b].argmax()) for a, b in itertools.pairwise(first.tolist())], dtype=np.int64)

    def of_models(values: Float, model: Int = rays.model) -> Float:
        """Root mean square of each column, model by model."""
        finite = np.isfinite(values)
        squares = np.where(finite, values, 0.0) ** 2
        total, number = (sums_of(part, model, n) for part in (squares, finite.astype(np.float64)))
        return np.sqrt(np.divide(total, number, out=np.full_like(total, np.nan), where=number > 0))

    def count(role: int) -> Int:
        weights = np.isfinite(off[role]).any(axis=1)
        return np.bincount(rays.model[rows_by_role[role]], weights=weights, minlength=n).astype(np.int32)

    ids, position_m = pairs.block.images.id, pairs.poses.position_m
    base = position_m[rays.right] - position_m[rays.left]
    return SingleModels(
        left=ids[rays.left],
        right=ids[rays.right],
        points=np.bincount(rays.model, minlength=n).astype(np.int32),
        base_m=np.linalg.norm(base, axis=1),
        parallax_rms_um=1e3 * of_models(parallax[:, None])[:, 0],
        parallax_max_um=1e3 * np.abs(parallax[largest]),
        parallax_max_at=pairs.block.points.id[rays.point[largest]],
        w_rms=of_models(w[:, None])[:, 0],
        adjusted_rms_m=of_models(X - pairs.solution.points.xyz_m[rays.point]),
        control_points=count(CONTROL),
        control_rms_m=of_models(off[CONTROL], rays.model[rows_by_role[CONTROL]]),
        check_points=count(CHECK),
        check_rms_m=of_models(off[CHECK], rays.model[rows_by_role[CHECK]]),
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
    why = "\nModels are not compared with check points: the datum is free, and they are in another frame."
    text = f"y-parallaxes of {parallax:{digits}} um RMS in {count}.{'' if compared else why}"
    return replace(
        evaluation,
        verdict=f"{evaluation.verdict}\n{text}",
        figures=Figures(
            name=np.concatenate([evaluation.figures.name, list(figures)]),
            value=np.concatenate([evaluation.figures.value, list(figures.values())]),
        ),
        models=models,
    )
