"""The block plan: projection centres by strip, footprints, control, check and new points.

A footprint is the image format seen from the projection centre, cut with the plane of mean terrain height.
Positions are those of the best solution there is, else those given with the block.
"""

import numpy as np
from markupsafe import Markup

from aatri.arrays import Float
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.solution import Solution
from aatri.ids import shown as shown_ids
from aatri.report.drawing import svg
from aatri.report.drawing.labels import Labels
from aatri.report.drawing.scales import GroundPlan, length_text, near, plan_of, round_below, thinned
from aatri.report.drawing.svg import Picture

MOST_FOOTPRINTS = 400
MOST_POINT_LABELS = 300
MOST_FAR = 5


def block_plan(block: Block, solution: Solution | None) -> Picture | None:
    """The picture and its caption; None where no position is known.

    Parameters
    ----------
    block : Block
    solution : Solution or None
        The best there is.
    """
    centres = image_positions(block, solution)
    ground = ground_positions(block, solution)
    feet = footprints(block, solution)
    places = np.concatenate([x[np.isfinite(x[:, :2]).all(axis=1), :2] for x in (centres, ground, feet.reshape(-1, 2))])
    if not len(places):
        return None
    main = near(places)
    plan = plan_of(places[main])
    low, high = places[main].min(axis=0), places[main].max(axis=0)
    centres, ground = _within(centres, low, high), _within(ground, low, high)
    feet = feet[np.isfinite(feet).all(axis=(1, 2))]
    feet = feet[((feet >= low) & (feet <= high)).all(axis=(1, 2))]
    shown = feet[thinned(len(feet), MOST_FOOTPRINTS)]
    labels = Labels(plan.width_px, plan.height_px)
    lines = _flight_lines(block, centres, plan, labels)
    points, notes = _points(block, ground, plan, labels)
    far = _far_off(block, solution, ground)
    if far:
        notes.append(f"not {shown_ids(far, MOST_FAR)}, which lie far off")
    if len(shown) < len(feet):
        notes.append(f"{len(shown)} of {len(feet)} footprints")
    marks = [
        *(svg.area(plan.px(corners), "footprint") for corners in shown),
        *lines,
        *points,
        *furniture(plan),
    ]
    what = "footprints, " if len(shown) else ""
    caption = (
        f"Block plan: {what}flight lines with projection centres, control (triangles), check points (circles), "
        "new points (dots)."
    )
    if notes:
        caption += f" Drawn: {', '.join(notes)}."
    return svg.drawing(plan.width_px, plan.height_px + 34, "Block plan", *marks), caption


def _within(xyz: Float, low: Float, high: Float) -> Float:
    """The points with NaN for those outside of a box."""
    inside = np.asarray(((xyz[:, :2] >= low) & (xyz[:, :2] <= high)).all(axis=1))
    return np.where(inside[:, None], xyz, np.nan)


def _far_off(block: Block, solution: Solution | None, drawn: Float) -> list[str]:
    """Points with a role that are not drawn because they lie far off."""
    located = np.isfinite(ground_positions(block, solution)[:, :2]).all(axis=1)
    lost = located & ~np.isfinite(drawn[:, :2]).all(axis=1)
    return [str(name) for name in block.points.id[lost]]


def image_positions(block: Block, solution: Solution | None) -> Float:
    """Projection centres, solved or given; NaN unknown.

    Returns
    -------
    (n, 3) float64, m
    """
    if solution is not None:
        return solution.images.position_m
    positions = np.full((len(block.images), 3), np.nan)
    positions[block.exterior.image] = block.exterior.position_m
    return positions


def ground_positions(block: Block, solution: Solution | None) -> Float:
    """Ground points, solved or given; NaN unknown.

    Returns
    -------
    (n, 3) float64, m
    """
    coordinates = np.full((len(block.points), 3), np.nan)
    coordinates[block.ground_points.point] = block.ground_points.xyz_m
    if solution is None:
        return coordinates
    return np.where(np.isfinite(solution.points.xyz_m), solution.points.xyz_m, coordinates)


def furniture(plan: GroundPlan) -> list[Markup]:
    """Scale bar and north arrow, in the strip of 34 px below the plan."""
    length = round_below(0.25 * plan.width_px / plan.px_per_m)
    x, y = 30.0, plan.height_px + 12
    end = x + length * plan.px_per_m
    bar = np.array([[x, y - 5], [x, y], [end, y], [end, y - 5]])
    north = np.array([[plan.width_px - 24, y + 8], [plan.width_px - 24, y - 14]])
    head = north[1] + np.array([[0.0, -4.0], [4.0, 6.0], [-4.0, 6.0]])
    return [
        svg.line(bar, "axis"),
        svg.text((x + end) / 2, y + 14, length_text(length), "small", "middle"),
        svg.line(north, "axis"),
        svg.area(head, "ink"),
        svg.text(plan.width_px - 34, y + 4, "N", "small", "end"),
    ]


def footprints(block: Block, solution: Solution | None) -> Float:
    """Corners of the images on the ground; NaN where unknown, and of oblique images.

    Returns
    -------
    (n, 4, 2) float64, m
    """
    if solution is None:
        return np.full((0, 4, 2), np.nan)
    camera = block.images.camera
    digital = (block.cameras.kind == "digital")[:, None]
    size = np.where(digital, block.cameras.format * block.cameras.pixel_size_mm, block.cameras.format)[camera]
    c = block.cameras.principal_distance_mm[camera]
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    rays = np.concatenate([corners * size[:, None], np.repeat(-c, 4).reshape(-1, 4, 1)], axis=2)
    down = np.einsum("nij,nkj->nki", solution.images.ground_from_image, rays)
    height = solution.images.position_m[:, 2] - _terrain_height(block, solution)
    steep = down[..., 2] > -0.2 * np.linalg.norm(down, axis=2)  # oblique: the plane is met far away or never
    factor = np.where(steep, np.nan, -height[:, None] / np.where(steep, -1.0, down[..., 2]))
    return np.asarray(solution.images.position_m[:, None, :2] + factor[..., None] * down[..., :2])


def _terrain_height(block: Block, solution: Solution) -> float:
    if np.isfinite(block.terrain_height_m):
        return block.terrain_height_m
    z = solution.points.xyz_m[:, 2]
    return float(np.median(z[np.isfinite(z)])) if np.isfinite(z).any() else np.nan


def _flight_lines(block: Block, centres: Float, plan: GroundPlan, labels: Labels) -> list[Markup]:
    located = np.asarray(np.isfinite(centres[:, :2]).all(axis=1))
    order = np.lexsort((np.arange(len(centres)), np.nan_to_num(block.images.sequence), block.images.strip))
    order = order[located[order]]
    if not len(order):
        return []
    strip = block.images.strip[order]
    px = plan.px(centres[order])
    parts = np.split(np.arange(len(order)), np.flatnonzero(np.diff(strip)) + 1)
    flown = [part for part in parts if strip[part[0]] >= 0]
    marks = [svg.line(px[part], "flight") for part in flown if len(part) > 1]
    marks.append(svg.dots(px[thinned(len(px))], "centre"))
    for part in flown:
        marks += _strip_label(str(block.strips.id[strip[part[0]]]), px[part], labels)
    return marks


def _strip_label(name: str, px: Float, labels: Labels) -> list[Markup]:
    """Ahead of the first image, away from the second."""
    away = px[0] - px[1] if len(px) > 1 else np.array([-1.0, 0.0])
    x, y = px[0] + 12 * away / max(float(np.hypot(*away)), 1e-9)
    return labels.at(float(x), float(y) + 3, name, "end" if away[0] < 0 else "start", "small strong label")


def _points(block: Block, ground: Float, plan: GroundPlan, labels: Labels) -> tuple[list[Markup], list[str]]:
    located = np.isfinite(ground[:, :2]).all(axis=1)
    role = np.zeros(len(ground), int)
    role[block.ground_points.point[(block.ground_points.role == CHECK).any(axis=1)]] = CHECK
    role[block.ground_points.point[(block.ground_points.role == CONTROL).any(axis=1)]] = CONTROL
    marks: list[Markup] = []
    notes = []
    written: list[Markup] = []
    labels.keep_free(plan.px(ground[located & (role == CONTROL)])[:MOST_POINT_LABELS], 4.0)
    for kind, name, draw in ((0, "new", svg.dots), (CHECK, "check", svg.circles), (CONTROL, "control", svg.triangles)):
        rows = np.flatnonzero(located & (role == kind))
        shown = rows[thinned(len(rows))]
        px = plan.px(ground[shown])
        marks.append(draw(px, name))
        if len(shown) < len(rows):
            notes.append(f"{len(shown)} of {len(rows)} {name} points")
    for kind, name in ((CONTROL, "control"), (CHECK, "check")):
        rows = np.flatnonzero(located & (role == kind))[:MOST_POINT_LABELS]
        found, left = labels.around(plan.px(ground[rows]), block.points.id[rows].tolist())
        written += found
        if left:
            notes.append(f"names of {len(rows) - left} of {int((located & (role == kind)).sum())} {name} points")
    return [*marks, *written], notes
