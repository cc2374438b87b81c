"""Adjusted strips in figures: counts as textbooks have them, tie residuals, what lies beyond control and ties."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aatri.adapters.strips.strip_tables import StripsOnGround
from aatri.arrays import Text
from aatri.artifacts.block import Block
from aatri.notes import Note
from aatri.orientation.free_block.polynomial_ties import in_axes
from aatri.orientation.free_block.strip_polynomials import StripPolynomials, textbook_counts

BEYOND = 0.1
"""Share of the half range of a strip by which points may lie beyond its control and ties."""


def strip_notes(block: Block, ground: StripsOnGround, result: StripPolynomials, names: Text) -> Iterator[Note]:
    """Counts, RMS of the tie residuals of every strip, and points that are extrapolated."""
    equations, coefficients = textbook_counts(result, ground.points, ground.control)
    text = f"{equations} equations of control and ties, {coefficients} coefficients of {len(names)} strips, redundancy"
    yield Note("note", f"{text} {equations - coefficients} (ground points eliminated)")
    points, tied = ground.points, result.tied
    active = tied.active[: len(points.point)]
    often = np.bincount(points.point[active], minlength=len(block.points))[points.point] > 1
    v = result.point_m[points.point] - result.corrected_m
    local, _ = in_axes(points, ground.axes)
    known = often.copy()
    control = np.zeros(len(block.points), dtype=bool)
    control[ground.control.point[tied.active[len(points.point) :]]] = True
    known |= control[points.point]
    for k, name in enumerate(names):
        mine = (points.strip == k) & active
        shared = mine & often
        if shared.any():
            x, y, z = np.sqrt((v[shared] ** 2).mean(axis=0))
            largest = np.abs(v[shared]).max()
            text = f"strip {name}: RMS of {int(shared.sum())} tie residuals X {x:.3f}, Y {y:.3f}, Z {z:.3f} m"
            yield Note("note", f"{text}, largest {largest:.3f} m")
        inside = local[mine & known]
        if len(inside) and int(result.degree[k].max()) > 0:
            off = np.maximum(local[mine] - inside.max(axis=0), inside.min(axis=0) - local[mine]).max(axis=1)
            beyond = points.point[mine][off > BEYOND]
            if len(beyond):
                text = (f"strip {name}: {len(beyond)} points lie beyond its control and ties, by up to "
                        f"{off.max() / 2:.0%} of its length or width: extrapolated")  # fmt: skip
                yield Note("warning", text, tuple(block.points.id[beyond].tolist()))
