"""Geodetic observations and relative control of a Solution: the network drawn, its points, residuals, tests, shapes.

Planes, lines and round shapes of the relative control are told as they came out: how they lie, and how well their
points do. The unknowns of a shape count from where it was at the start. What can be told without that is how its
adjusted points lie: with equal standard deviations the plane of the adjustment is the one that fits them best,

    (X - mean) = U S V',     normal = the last row of V',     direction of a line = the first
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.ids import shown
from aatri.report.drawing.network import ellipses, observed_lines
from aatri.report.sections.observations import of_the_network
from aatri.report.sections.parts import present
from aatri.report.sections.tables import Columns, PageTable, all_rows, axes, lengths
from aatri.units import DASH, decimals, digits, together

PLANES = ("plane", "vertical_plane", "horizontal_plane", "equal_height")
LINES = ("line", "plumb_line", "horizontal_line")
ROUND = ("sphere", "cylinder")
MOST_NAMED = 4
STEEP = 1e-6
"""Sine of a nadir distance below which an axis has no bearing."""


def tables(block: Block, solution: Solution) -> list[PageTable]:
    """Points, observations and shapes of a network or of relative control."""
    return present(_points(block, solution), of_the_network(solution), shapes_table(block, solution))


def _points(block: Block, solution: Solution) -> PageTable | None:
    """Coordinates of the observed points with standard deviations and ellipses."""
    rows = np.unique(observed_lines(block, solution)[0])
    points = solution.points
    rows = rows[np.isfinite(points.xyz_m[rows]).any(axis=1)]
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.einsum("nii->ni", points.covariance_m2))
    semi_axes_m, bearing_rad = ellipses(points.covariance_m2)
    bearing_deg = np.where(semi_axes_m[:, 0] > semi_axes_m[:, 1], np.degrees(bearing_rad), np.nan)
    columns: Columns = {
        "point": points.id,
        **axes(
            ("X m", "Y m", "Z m"),
            points.xyz_m,
            digits(decimals(float(np.median(sigma[sigma > 0])) if (sigma > 0).any() else np.nan)),
        ),
        **lengths("sX sY sZ", sigma),
        **lengths("ellipse_a b", semi_axes_m),
        "bearing deg": (bearing_deg, digits(0)),
    }
    return all_rows("Points of the network, with standard ellipses in plan", columns, rows, kept=True)


def shapes_table(block: Block, solution: Solution) -> PageTable | None:
    """How each plane, line and round shape lies, with the residuals of its points."""
    control, residuals = block.relative_control, solution.residuals
    conditions = np.flatnonzero(np.isin(control.type, (*PLANES, *LINES, *ROUND)))
    members = block.relative_control_members
    members_of = {int(c): np.flatnonzero(members.condition == c) for c in conditions}
    of_kind = {c: residuals.of_kind(str(control.type[c])) for c in members_of}
    rows = {c: of_kind[c][np.isin(residuals.row[of_kind[c]], m)] for c, m in members_of.items()}
    conditions = np.array([c for c in conditions if len(rows[int(c)])], dtype=np.int64)
    lying = [_lying(str(control.type[c]), _points_of_shape(solution, rows[int(c)])) for c in conditions]

    v = [residuals.residual[rows[int(c)]][residuals.active[rows[int(c)]]] for c in conditions]
    columns: Columns = {
        "shape": control.type[conditions],
        "points": [shown(members.id[members_of[int(c)]].tolist(), MOST_NAMED) for c in conditions],
        "normal or axis": lying,
        "sigma": ["exact" if m == 0 else together([m]) for m in control.sigma[conditions].tolist()],
        "used": np.array([len(of_shape) for of_shape in v]),
        "rejected": np.array([len(rows[int(c)]) - len(of_shape) for c, of_shape in zip(conditions, v)]),
        **lengths("RMS_residual", np.array([np.sqrt(np.nanmean(r**2)) if r.size else np.nan for r in v])),
        **lengths("largest", np.array([np.nanmax(np.abs(r)) if r.size else np.nan for r in v])),
    }
    return all_rows("Planes, lines and round shapes", columns)


def _points_of_shape(solution: Solution, rows: Int) -> Float:
    """Adjusted coordinates of the points of some residuals in use, (n, 3) m."""
    residuals, ids = solution.residuals, solution.points.id
    order = np.argsort(ids, kind="stable")
    names = residuals.point[rows[residuals.active[rows]]]
    xyz = solution.points.xyz_m[order[np.searchsorted(ids[order], names)]]
    return np.asarray(xyz[np.isfinite(xyz).all(axis=1)])


def _lying(type_: str, xyz: Float) -> str:
    """Bearing and slope of the normal of a plane or of the direction of a line; nothing of round shapes."""
    if type_ in ROUND or len(xyz) < (2 if type_ in LINES else 3):
        return DASH
    axes = np.linalg.svd(xyz - xyz.mean(axis=0))[2]
    axis = axes[0] if type_ in LINES else axes[2]
    axis = axis if axis[2] >= 0 else -axis
    slope = np.degrees(np.arcsin(min(1.0, float(axis[2]))))
    if np.hypot(axis[0], axis[1]) < STEEP:
        return "vertical"
    return f"bearing {np.degrees(np.arctan2(axis[0], axis[1])) % 360:.3f}, slope {slope:.3f} deg"
