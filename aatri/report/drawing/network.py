"""The network: what was observed between which points, with error ellipses of the points.

Lines are geodetic observations and relative control; those with an observation that is rejected are drawn as such. The
ellipses are standard ones of the plan, C = s^2 U U', all enlarged by the same round number.
"""

from itertools import pairwise

import numpy as np
from markupsafe import Markup

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import CONTROL, Block
from aatri.artifacts.solution import Solution
from aatri.report.drawing import svg
from aatri.report.drawing.labels import Labels
from aatri.report.drawing.plan import furniture, ground_positions
from aatri.report.drawing.scales import GroundPlan, plan_of, round_below, thinned
from aatri.report.drawing.svg import Picture

MOST_LINES, MOST_ELLIPSES, MOST_NAMES = 2000, 400, 120
ELLIPSE_PX = 14.0
"""Half the longest axis of the largest ellipse but a few."""
CORNERS = np.linspace(0, 2 * np.pi, 25)[:-1]


def ellipses(covariance_m2: Float) -> tuple[Float, Float]:
    """Semi-axes of standard ellipses in plan and the bearing of the longer one.

    Parameters
    ----------
    covariance_m2 : (n, 3, 3) float64, m^2

    Returns
    -------
    axes_m : (n, 2) float64, m
        The longer one first; NaN where there is no covariance of both coordinates.
    bearing_rad : (n,) float64, rad
        Clockwise from north, 0 to pi.
    """
    C = covariance_m2[:, :2, :2]
    finite: Bool = np.asarray(np.isfinite(C).all(axis=(1, 2)))
    values, vectors = np.linalg.eigh(np.where(finite[:, None, None], C, 0.0))
    axes = np.where(finite[:, None], np.sqrt(np.maximum(values[:, ::-1], 0.0)), np.nan)
    return axes, np.asarray(np.arctan2(vectors[:, 0, 1], vectors[:, 1, 1]) % np.pi)


def network_picture(block: Block, solution: Solution) -> Picture | None:
    """The picture and its caption; None where fewer than two points are observed from each other."""
    ground = ground_positions(block, solution)
    lines, wrong = observed_lines(block, solution)
    finite: Bool = np.asarray(np.isfinite(ground[:, :2]).all(axis=1))
    both: Bool = np.asarray(finite[lines].all(axis=1))
    lines, wrong = lines[both], wrong[both]
    if not len(lines):
        return None
    points = np.unique(lines)
    plan = plan_of(ground[points, :2])
    shown = thinned(len(lines), MOST_LINES)
    ends = [plan.px(ground[lines[:, k]]) for k in range(2)]
    right = shown[~wrong[shown]]
    marks = [
        svg.segments(ends[0][right], ends[1][right], "sight"),
        svg.segments(ends[0][wrong], ends[1][wrong], "sight rejected"),
    ]
    drawn, scale = _ellipses(solution, ground, points, plan)
    is_control = np.zeros(len(ground), dtype=bool)
    is_control[block.ground_points.point[(block.ground_points.role == CONTROL).any(axis=1)]] = True
    fixed, new = points[is_control[points]], points[~is_control[points]]
    labels = Labels(plan.width_px, plan.height_px)
    names, left = labels.around(plan.px(ground[points[:MOST_NAMES]]), block.points.id[points[:MOST_NAMES]].tolist())
    marks += [
        *drawn,
        svg.dots(plan.px(ground[new]), "new"),
        svg.triangles(plan.px(ground[fixed]), "control"),
        *names,
        *furniture(plan),
    ]
    caption = f"Network: {len(lines)} lines observed between {len(points)} points, control as triangles"
    caption += f", {int(wrong.sum())} with a rejected observation" if wrong.any() else ""
    caption += f"; standard ellipses enlarged {scale:g} times" if scale else ""
    caption += f"; {len(shown)} lines drawn" if len(shown) < len(lines) else ""
    caption += f"; names of {len(points) - left - max(0, len(points) - MOST_NAMES)}" if left else ""
    return svg.drawing(plan.width_px, plan.height_px + 34, "Network", *marks), f"{caption}."


def observed_lines(block: Block, solution: Solution) -> tuple[Int, Bool]:
    """Rows of the two points of every observed line, each once, and whether an observation of it is rejected."""
    number = {str(name): k for k, name in enumerate(block.points.id)}
    g, control, members = block.geodetic, block.relative_control, block.relative_control_members
    out = {str(p) for p in solution.residuals.point[~solution.residuals.active]}
    lines: dict[tuple[int, int], bool] = {}

    def add(a: str, b: str) -> None:
        if a in number and b in number and a != b:
            i, j = sorted((number[a], number[b]))
            bad = any(f"{x}-{y}" in out or f"{x}-{y} d{axis}" in out for x, y in ((a, b), (b, a)) for axis in "XYZ")
            lines[i, j] = lines.get((i, j), False) or bad

    for a, b, via, used in zip(g.start.tolist(), g.end.tolist(), g.via.tolist(), g.active.tolist()):
        for x, y in ((via, a), (via, b)) if via else ((a, b),):
            if used:
                add(x, y)
    for k in range(len(control)):
        ids = members.id[(members.condition == k) & (members.part != "images")].tolist()
        by_pairs = (members.part[members.condition == k] == "pairs").any()
        for a, b in zip(ids[::2], ids[1::2]) if by_pairs else pairwise(ids):
            add(a, b)
    rows = np.array(sorted(lines), dtype=np.int64).reshape(-1, 2)
    return rows, np.array([lines[a, b] for a, b in rows.tolist()], dtype=bool)


def _ellipses(solution: Solution, ground: Float, points: Int, plan: GroundPlan) -> tuple[list[Markup], float]:
    axes, bearing = ellipses(solution.points.covariance_m2[points])
    rows = np.flatnonzero(axes[:, 0] > 0)
    if not len(rows):
        return [], 0.0
    rows = rows[thinned(len(rows), MOST_ELLIPSES)]
    scale = round_below(ELLIPSE_PX / (plan.px_per_m * float(np.quantile(axes[rows, 0], 0.95))))
    along = np.stack([np.sin(bearing[rows]), np.cos(bearing[rows])], axis=1)
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    marks = []
    for k, place in enumerate(points[rows]):
        a, b = scale * axes[rows[k]]
        rim = ground[place, :2] + a * np.cos(CORNERS)[:, None] * along[k] + b * np.sin(CORNERS)[:, None] * across[k]
        marks.append(svg.area(plan.px(rim), "ellipse"))
    return marks, float(scale)
