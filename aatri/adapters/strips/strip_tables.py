"""Transformations, residuals and suspects of the strip block adjustment, as tables of a Solution; the same in figures.

Figures are counts as textbooks have them, tie residuals, what lies beyond control and ties.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from aatri.adapters.limits import BEYOND_ALL_CONTROL, BEYOND_CONTROL
from aatri.adapters.strips import oriented_strips as pieces
from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.solution import StripTransformations
from aatri.artifacts.strips import Strips
from aatri.geometry.similarity import Similarity
from aatri.geometry.strip_bases import StripAxes
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.control import Control
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.similarity_ties import in_axes
from aatri.orientation.bodies.strip_polynomials import StripPolynomials, textbook_counts

AXES = ("origin_X_m", "origin_Y_m", "origin_Z_m", "half_range_U_m", "half_range_V_m", "azimuth_of_U_rad")


@dataclass(frozen=True)
class StripsOnGround:
    """Oriented strips on the ground, reduced to the origin; `rows` are those of the strip points in the Strips."""

    origin: Float
    strips: Int
    similarity: list[Similarity]
    axes: list[StripAxes]
    rows: Int
    points: BodyPoints
    control: Control


def transformation_tables(
    result: StripPolynomials, ground: StripsOnGround, strips: Strips, sigma_m: Float
) -> list[StripTransformations]:
    """Per strip: the similarity, the axes, and the coefficients a of dU, b of dV, c of dW in metres."""
    tables = []
    for k, strip in enumerate(ground.strips):
        name, axes = str(strips.strips.id[strip]), ground.axes[k]
        tables.append(pieces.similarity_rows(name, ground.similarity[k], ground.origin))
        plan, height = (int(degree) for degree in result.degree[k])
        origin_m, size_m = axes.origin_m + ground.origin, axes.half_range_m
        azimuth = np.arctan2(axes.ground_from_axes[0, 0], axes.ground_from_axes[1, 0])
        tables.append(
            StripTransformations.of(
                id=name,
                model=result.basis.model(max(plan, height)),
                parameter=AXES,
                value=[*origin_m, *size_m, azimuth],
            )
        )
        for part, degree in enumerate((plan, height)):
            of_part = np.flatnonzero((result.basis.part == part) & (result.basis.degree <= degree))
            names = tuple(result.basis.labels[c] for c in of_part)
            values, sigma = result.coefficients_m[k, of_part], sigma_m[k, of_part]
            model = result.basis.model(degree)
            tables.append(StripTransformations.of(id=name, model=model, parameter=names, value=values, sigma=sigma))
    return tables


def strip_notes(
    block: Block, strips: Strips, ground: StripsOnGround, result: StripPolynomials, names: Text
) -> Iterator[Note]:
    """Points at infinity, counts, RMS of the tie residuals of every strip, and points that are extrapolated.

    Ties carry control from strip to strip, but not beyond all of it: where no strip has any, all bend together.
    """
    distant = np.isin(strips.strip_points.strip, ground.strips)
    distant[ground.rows] = False
    if distant.any():
        ids = block.points.id[np.unique(strips.strip_points.point[distant])]
        text = "points at infinity, or so uncertain that they may be, left out of the strips that hold them so"
        yield Note("warning", text, tuple(ids.tolist()))
    equations, coefficients = textbook_counts(result, ground.points, ground.control)
    text = f"{equations} equations of control and ties, {coefficients} coefficients of {len(names)} strips, redundancy"
    yield Note("note", f"{text} {equations - coefficients} (ground points eliminated)")
    points, tied = ground.points, result.tied
    active = tied.active[: len(points.point)]
    often = np.bincount(points.point[active], minlength=len(block.points))[points.point] > 1
    v = result.point_m[points.point] - result.corrected_m
    local, _ = in_axes(points, ground.axes)
    controlled_points = often.copy()
    control = np.zeros(len(block.points), dtype=bool)
    control[ground.control.point[tied.active[len(points.point) :]]] = True
    controlled_points |= control[points.point]
    at_control = result.point_m[control & np.isfinite(result.point_m[:, 0])]
    used = np.flatnonzero(active)
    used = used[np.argsort(points.strip[used], kind="stable")]
    bounds = np.searchsorted(points.strip[used], np.arange(len(names) + 1))
    for k, name in enumerate(names):
        of_strip = used[bounds[k] : bounds[k + 1]]
        shared = of_strip[often[of_strip]]
        if len(shared):
            x, y, z = np.sqrt((v[shared] ** 2).mean(axis=0))
            largest = np.abs(v[shared]).max()
            text = f"strip {name}: RMS of {len(shared)} tie residuals X {x:.3f}, Y {y:.3f}, Z {z:.3f} m"
            yield Note("note", f"{text}, largest {largest:.3f} m")
        bends = int(result.degree[k].max()) > 0
        axes = ground.axes[k]
        controlled = ((at_control - axes.origin_m) @ axes.ground_from_axes)[:, :2] / axes.half_range_m
        off = _beyond(local[of_strip], local[of_strip[controlled_points[of_strip]]] if bends else local[:0])
        far = _beyond(local[of_strip], controlled if bends else local[:0])
        own, of_block = off > BEYOND_CONTROL, far > BEYOND_ALL_CONTROL
        for rows, by, what in ((own, off, "its control and ties"), (of_block & ~own, far, "all control of the block")):
            if rows.any():
                text = (
                    f"strip {name}: {several(int(rows.sum()), 'point', 'lies', 'lie')} beyond {what}, by up to "
                    f"{by[rows].max() / 2:.0%} of its length or width: extrapolated"
                )
                yield Note("warning", text, tuple(block.points.id[points.point[of_strip][rows]].tolist()))


def _beyond(local: Float, inside: Float) -> Float:
    """By how much of the half range points of a strip, in its axes, lie outside the range of others; 0 without any."""
    if not len(inside):
        return np.zeros(len(local))
    return np.asarray(np.maximum(local - inside.max(axis=0), inside.min(axis=0) - local).max(axis=1))
