"""Figures of a layout from its planned adjustment: sigma of points, criterion, reliability, the next control points."""

from typing import Annotated

import numpy as np
from pydantic import Field

from aatri.adjustment.threads import one_blas_thread
from aatri.arrays import Float, Text
from aatri.artifacts.block import CONTROL, Block
from aatri.artifacts.evaluation import Differences, Evaluation, Figures, LayoutPoints
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.evaluation.design import Aim, Gain, criterion_eigenvalue, gains, next_control
from aatri.evaluation.epoch_points import solved_points
from aatri.evaluation.epochs import EpochPoints
from aatri.ids import printable, rows_of
from aatri.options import Options

MOST_POINTS = 1500
"""Of the criterion: its matrices have 8 (3 n)^2 bytes, 160 MB at 1,500."""


Sigma = Annotated[float, Field(gt=0)]
Sigmas = tuple[Sigma, Sigma, Sigma]


class CriteriaOptions(Options):
    """What a layout is meant to reach."""

    sigma_m: Sigmas | None = Field(
        None,
        description="standard deviations of X, Y, Z asked of every point, m; null: the medians of the block itself",
    )
    distance_m: float | None = Field(
        None, gt=0, description="over which errors may be alike, m; null: half the extent of the block"
    )
    control_sigma_m: Sigmas = Field((0.02, 0.02, 0.02), description="of one more control point, m; .inf: not measured")
    aim: Aim = Field("mean", description="what one more control point is to make small")
    next_points: int = Field(3, ge=0, le=20, description="control points chosen one beside the other")


def judged_layout(block: Block, solution: Solution, options: CriteriaOptions) -> Evaluation:
    """Criteria of a layout.

    Parameters
    ----------
    solution : Solution
        With `point_covariances`.

    Raises
    ------
    InputError
        If the solution has no covariances between points, or of too many.
    """
    points = solved_points(solution, "solution")
    rows = np.flatnonzero(
        np.isfinite(points.xyz_m).all(axis=1) & (np.einsum("nini->ni", points.covariance_m2) > 0).all(axis=1)
    )
    if not 0 < len(rows) <= MOST_POINTS:
        raise InputError(
            f"covariances between {len(rows)} points that are not exact; a criterion takes 1 to {MOST_POINTS}",
            where="port solution: point_covariances",
            remedy='name the points that count in `point_covariances` of the bundle: ["1*", "*5"]',
        )
    points = points.take(rows)
    C, variance = points.covariance_m2, np.einsum("nini->ni", points.covariance_m2)
    sigma_m = np.sqrt(np.median(variance, axis=0)) if options.sigma_m is None else np.array(options.sigma_m)
    half_extent_m = max(float(np.ptp(points.xyz_m, axis=0).max()) / 2, 1.0)
    distance_m = half_extent_m if options.distance_m is None else options.distance_m
    ground = block.ground_points
    full_control = block.points.id[ground.point[(ground.role == CONTROL).all(axis=1)]]
    candidates = np.flatnonzero(~np.isin(points.id, full_control))
    with one_blas_thread():  # the same bits whatever the threads
        eigenvalue, function = criterion_eigenvalue(points.xyz_m, C, sigma_m, distance_m)
        control_sigma_m = np.array(options.control_sigma_m)
        chosen = next_control(C, sigma_m, control_sigma_m, candidates, options.next_points, options.aim)
        single_gains = gains(C, sigma_m, control_sigma_m, candidates)
    largest = np.sqrt(np.linalg.eigvalsh(C[np.arange(len(rows)), :, np.arange(len(rows))])[:, -1])
    figures = {
        "images": float(solution.images.oriented.sum()),
        "control_points": float(block.ground_points.given_as(CONTROL).sum()),
        "compared_points": float(len(rows)),
        **{f"median_sigma_{a}_m": float(s) for a, s in zip("xyz", np.sqrt(np.median(variance, axis=0)))},
        **{f"largest_sigma_{a}_m": float(s) for a, s in zip("xyz", np.sqrt(variance.max(axis=0)))},
        "weakest_point_sigma_m": float(largest.max()),
        "criterion_eigenvalue": eigenvalue,
        **_reliability(solution),
    }
    figures |= {f"gain_of_control_{k}": getattr(gain, options.aim) for k, gain in enumerate(chosen, start=1)}
    table = _points(solution, points, single_gains, chosen)
    weakest = str(points.id[int(largest.argmax())])
    worst = points.id[int((function**2).sum(axis=1).argmax())], "XYZ"[int((function**2).sum(axis=0).argmax())]
    return Evaluation(
        verdict=_verdict(figures, weakest, worst, [str(points.id[gain.point]) for gain in chosen]),
        figures=Figures(name=np.array(list(figures)), value=np.array(list(figures.values()))),
        differences=Differences.empty(),
        layout_points=table,
    )


def _reliability(solution: Solution) -> dict[str, float]:
    """Detectable errors by kind, the largest effect of one, and how many observations nothing controls."""
    figures: dict[str, float] = {}
    if solution.tests is not None:
        r, t = solution.residuals, solution.tests
        for kind in ("image_point", "control", "position"):
            size = t.detectable[r.used(kind)]
            size = size[np.isfinite(size)] * (1e3 if kind == "image_point" else 1.0)
            if len(size):
                unit = "um" if kind == "image_point" else "m"
                figures[f"detectable_{kind}_median_{unit}"] = float(np.median(size))
                figures[f"detectable_{kind}_p95_{unit}"] = float(np.percentile(size, 95))
        if np.isfinite(t.external).any():
            figures["largest_external"] = float(np.nanmax(t.external))
    if solution.uncontrolled is not None:
        figures["uncontrolled_observations"] = float(len(solution.uncontrolled))
    return figures


def _points(solution: Solution, points: EpochPoints, single_gains: list[Gain], chosen: list[Gain]) -> LayoutPoints:
    n = len(points.id)
    gained, order = np.full((n, 2), np.nan), np.zeros(n, dtype=np.int32)
    gained[[gain.point for gain in single_gains]] = [(gain.mean, gain.worst) for gain in single_gains] or np.empty(
        (0, 2)
    )
    order[[gain.point for gain in chosen]] = np.arange(1, len(chosen) + 1)
    return LayoutPoints(
        point=points.id,
        xyz_m=points.xyz_m,
        sigma_m=np.sqrt(np.einsum("nini->ni", points.covariance_m2)),
        moved_m=_moved_m(solution, points.id),
        mean_gain=gained[:, 0],
        worst_gain=gained[:, 1],
        order=order,
    )


def _moved_m(solution: Solution, ids: Text) -> Float:
    """Largest effect of a detectable error of an observation of each point, axis by axis; NaN where none is known."""
    moved = np.full((len(ids), 3), np.nan)
    if solution.tests is not None:
        by_m, row = np.abs(solution.tests.point_moved_m), rows_of(solution.residuals.point, ids)
        has_effect = (row >= 0) & solution.residuals.active & np.isfinite(by_m).all(axis=1)
        np.fmax.at(moved, row[has_effect], by_m[has_effect])
    return moved


def _verdict(figures: dict[str, float], weakest: str, worst: tuple[str, str], chosen: list[str]) -> str:
    sigma = ", ".join(f"{1e3 * figures[f'median_sigma_{a}_m']:.3g}" for a in "xyz")
    text = (
        f"planned: standard deviations of {sigma} mm in X, Y and Z (median), of {printable(weakest)}, the weakest, "
        f"{1e3 * figures['weakest_point_sigma_m']:.3g} mm; at worst {np.sqrt(figures['criterion_eigenvalue']):.3g} "
        f"times the criterion, in {worst[1]} about {printable(str(worst[0]))}"
    )
    if not chosen:
        return text
    share = figures["gain_of_control_1"]
    first, *others = [printable(name) for name in chosen]
    then = f", then at {', '.join(others)}" if others else ""
    return f"{text}; control would gain most at {first}, {100 * share:.0f} % of the variance{then}"
