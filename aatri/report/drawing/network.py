"""The network: what was observed between which points; and standard ellipses, C = s^2 U U', of points and images.

Lines are geodetic observations and relative control; those with an observation that is rejected are drawn as such. All
ellipses of a picture are enlarged by the same round number.
"""

from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import CONTROL, Block
from aatri.artifacts.solution import Solution
from aatri.ids import several
from aatri.report.drawing.picture import Marks, Picture, Shape
from aatri.report.drawing.plan import ground_positions, rejected_control, roles
from aatri.report.drawing.scales import length_text, near, round_below, thinned
from aatri.report.drawing.vectors import times

MOST_LINES, MOST_ELLIPSES = 5000, 1500
OF_EXTENT, OF_SPACING = 0.05, 0.4
"""Half the longest axis of the largest ellipse but a few: of the extent of the picture, and of the median distance to
the next of its kind, whichever is less."""
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


def ellipse_marks(groups: dict[str, tuple[str, Float, Float, list[str]]], extent_m: float) -> tuple[list[Marks], float]:
    """Ellipses as areas, and how many times they are enlarged.

    Parameters
    ----------
    groups : {name: (colour, xy_m, covariance_m2, ids)}
        (n, 2) and (n, 3, 3); without covariance there is no ellipse.
    extent_m : float, m
        Of the picture.
    """
    shapes = {name: ellipses(covariance) for name, (_, _, covariance, _) in groups.items()}
    longest = np.concatenate([axes[:, 0] for axes, _ in shapes.values()])
    if not (longest > 0).any():
        return [], 0.0
    spacing = min(_spacing(xy) for _, xy, _, _ in groups.values())
    room = min(OF_EXTENT * extent_m, OF_SPACING * spacing)
    scale = round_below(room / float(np.quantile(longest[longest > 0], 0.95)))
    marks = []
    for name, (colour, xy, _, ids) in groups.items():
        axes, bearing = shapes[name]
        rows = np.flatnonzero((axes[:, 0] > 0) & np.isfinite(xy).all(axis=1))
        rows = rows[thinned(len(rows), MOST_ELLIPSES)]
        along = np.stack([np.sin(bearing[rows]), np.cos(bearing[rows])], axis=1)[:, None]
        across = np.stack([along[..., 1], -along[..., 0]], axis=2)
        a, b = (scale * axes[rows, k][:, None, None] for k in (0, 1))
        rim = xy[rows][:, None] + a * np.cos(CORNERS)[:, None] * along + b * np.sin(CORNERS)[:, None] * across
        tells = [f"{length_text(m)} by {length_text(n)}" for m, n in axes[rows].tolist()]
        marks.append(Marks("areas", rim, colour, name, 1.0, 0.12, ids=[ids[k] for k in rows], tells=tells))
    return marks, scale


def _spacing(xy_m: Float) -> float:
    """Median distance to the next place; endless where there is none."""
    places = np.unique(xy_m[np.isfinite(xy_m).all(axis=1)], axis=0)
    if len(places) < 2:
        return np.inf
    return float(np.median(cKDTree(places).query(places, k=2)[0][:, 1]))


def ellipses_picture(block: Block, solution: Solution) -> Picture | None:
    """Standard ellipses of projection centres, control and check points."""
    images, points, ground = solution.images, solution.points, ground_positions(block, solution)
    marked = np.flatnonzero((roles(block) > 0) & np.isfinite(ground[:, :2]).all(axis=1))
    groups = {
        "projection centres": ("blue", images.position_m[:, :2], images.covariance[:, :3, :3], images.id.tolist()),
        "control and check points": (
            "red",
            ground[marked, :2],
            points.covariance_m2[marked],
            points.id[marked].tolist(),
        ),
    }
    places = np.concatenate([xy[np.isfinite(xy).all(axis=1)] for _, xy, _, _ in groups.values()])
    if not len(places):
        return None
    main = near(places)
    low, high = places[main].min(axis=0), places[main].max(axis=0)
    groups = {
        name: (colour, np.where(((xy >= low) & (xy <= high)).all(axis=1)[:, None], xy, np.nan), covariance, ids)
        for name, (colour, xy, covariance, ids) in groups.items()
    }
    marks, scale = ellipse_marks(groups, float((high - low).max()))
    if not marks:
        return None
    caption = (
        f"Standard ellipses in plan of projection centres and of control and check points, enlarged {times(scale)}: "
        "where they are large or long, control or a cross strip is missing."
    )
    return Picture("ellipses", "Error ellipses", caption, marks)


def network_picture(block: Block, solution: Solution | None) -> Picture | None:
    """What is observed between points; None where fewer than two points are observed from each other."""
    ground = ground_positions(block, solution)[:, :2]
    lines, wrong = observed_lines(block, solution)
    both: Bool = np.asarray(np.isfinite(ground[lines]).all(axis=(1, 2)))
    lines, wrong = lines[both], wrong[both]
    if not len(lines):
        return None
    points = np.unique(lines)
    drawn = thinned(len(lines), MOST_LINES)
    right = drawn[~wrong[drawn]]
    control = (roles(block) == CONTROL)[points]
    out = np.isin(block.points.id[points], rejected_control(solution)) if solution is not None else ~control & False
    extent = float(np.ptp(ground[points], axis=0).max())
    names, rims, scale = block.points.id[points].tolist(), list[Marks](), 0.0
    if solution is not None:
        C = solution.points.covariance_m2[points]
        rims, scale = ellipse_marks({"standard ellipses": ("blue", ground[points], C, names)}, extent)
    between = [" to ".join(block.points.id[line]) for line in lines]
    marks = [
        Marks("segments", ground[lines[right]], "soft", "observed", 0.8),
        Marks(
            "segments",
            ground[lines[wrong]],
            "red",
            "with a rejected observation",
            1.2,
            dashed=True,
            ids=[between[k] for k in np.flatnonzero(wrong)],
        ),
        *rims,
    ]
    shapes: tuple[tuple[Shape, str, str, Bool], ...] = (
        ("dots", "soft", "new points", ~control),
        ("triangles", "red", "control", control & ~out),
        ("crosses", "red", "control left out", control & out),
    )
    for shape, colour, name, rows in shapes:
        ids = block.points.id[points[rows]].tolist()
        marks.append(
            Marks(shape, ground[points[rows]], colour, name, 4.0 if shape == "dots" else 1.6, ids=ids, labelled=True)
        )
    caption = f"{several(len(lines), 'line')} observed between {several(len(points), 'point')}"
    caption += f", {int(wrong.sum())} with a rejected observation" if wrong.any() else ""
    caption += f"; standard ellipses enlarged {times(scale)}" if scale else ""
    caption += f"; {several(len(drawn), 'line')} drawn" if len(drawn) < len(lines) else ""
    return Picture("network", "Network", f"{caption}.", marks, width=720.0)


def observed_lines(block: Block, solution: Solution | None) -> tuple[Int, Bool]:
    """Rows of the two points of every observed line, each once, and whether an observation of it is rejected."""
    number = {str(name): k for k, name in enumerate(block.points.id)}
    g, control, members = block.geodetic, block.relative_control, block.relative_control_members
    out = set(solution.residuals.point[~solution.residuals.active].tolist()) if solution is not None else set()
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
