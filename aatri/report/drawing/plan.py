"""The block plan: projection centres by strip, footprints, control, check and new points.

A footprint is the image format seen from the projection centre, cut with the plane of mean terrain height.
Positions are those of the best solution there is, else those given with the block.
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.solution import Solution
from aatri.ids import rows_of, several, shown
from aatri.report.drawing.picture import Marks, Picture
from aatri.report.drawing.rays import principal_distances, seen_from, used_rays
from aatri.report.drawing.scales import near, thinned

MOST_FOOTPRINTS = 400
MOST_FAR = 5


def block_plan(block: Block, solution: Solution | None) -> Picture | None:
    """Where images and points are; None where no position is known.

    Parameters
    ----------
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
    low, high = places[main].min(axis=0), places[main].max(axis=0)
    located = np.isfinite(ground[:, :2]).all(axis=1)
    centres, ground = _within(centres, low, high), _within(ground, low, high)
    feet = feet[np.isfinite(feet).all(axis=(1, 2))]
    feet = feet[((feet >= low) & (feet <= high)).all(axis=(1, 2))]
    drawn_feet = feet[thinned(len(feet), MOST_FOOTPRINTS)]
    images = image_rows(block, centres)
    points, notes = _points(block, solution, ground, images)
    far = located & ~np.isfinite(ground[:, :2]).all(axis=1)
    if far.any():
        notes.append(f"not {shown(block.points.id[far].tolist(), MOST_FAR)}, which lie far off")
    if len(drawn_feet) < len(feet):
        notes.append(f"{len(drawn_feet)} of {len(feet)} footprints")
    details = f" Drawn: {', '.join(notes)}." if notes else ""
    caption = (
        f"Projection centres along their strips, and the points on the ground.{details}"
        if len(images)
        else f"The points whose coordinates are known.{details}"
    )
    marks = [
        Marks("areas", drawn_feet, "soft", "footprints", width=0.6, fill=0.05),
        *_flown(block, centres, images),
        *points,
    ]
    on_screen = "A click on an image or a point leaves only its rays." if len(images) else ""
    return Picture("plan", "Block plan", caption, marks, width=720.0, on_screen=on_screen)


def image_rows(block: Block, xy_m: Float) -> Int:
    """Rows of the images with a position, strip by strip along the flight."""
    order = np.lexsort((np.arange(len(xy_m)), np.nan_to_num(block.images.sequence), block.images.strip))
    return np.asarray(order[np.isfinite(xy_m[order, :2]).all(axis=1)])


def _flown(block: Block, centres: Float, order: Int) -> list[Marks]:
    """Images as dots that see points, flight lines between those of a strip, and the names of the strips."""
    strip, xy = block.images.strip[order], centres[order, :2]
    along = np.flatnonzero((strip[1:] == strip[:-1]) & (strip[1:] >= 0))
    first = np.flatnonzero((strip >= 0) & np.append(True, strip[1:] != strip[:-1])) if len(order) else order
    return [
        Marks("segments", np.stack([xy[along], xy[along + 1]], axis=1), "blue"),
        Marks("dots", xy, "blue", "images", width=5.0, ids=block.images.id[order].tolist(), sees=True),
        Marks("texts", xy[first], "blue", ids=block.strips.id[strip[first]].tolist()),
    ]


def _within(xyz: Float, low: Float, high: Float) -> Float:
    """The points with NaN for those outside of a box."""
    inside = np.asarray(((xyz[:, :2] >= low) & (xyz[:, :2] <= high)).all(axis=1))
    return np.where(inside[:, None], xyz, np.nan)


def image_positions(block: Block, solution: Solution | None) -> Float:
    """Projection centres, solved or given; NaN unknown.

    Returns
    -------
    (n, 3) float64, m
    """
    if solution is not None:
        return solution.images.position_m
    return block.positions_m


def ground_positions(block: Block, solution: Solution | None) -> Float:
    """Ground points, solved or given; NaN unknown.

    Returns
    -------
    (n, 3) float64, m
    """
    if solution is None:
        return block.given_m
    return np.where(np.isfinite(solution.points.xyz_m), solution.points.xyz_m, block.given_m)


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
    c = principal_distances(block, solution)[camera]
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


def rejected_control(solution: Solution | None) -> list[str]:
    """Ids of the control points of which a coordinate is left out."""
    if solution is None:
        return []
    s = solution.suspects
    return sorted(set(s.point[s.staying_out & (s.kind == "control")].tolist()))


def roles(block: Block) -> Int:
    """Role of every point, control before check.

    Returns
    -------
    (n,) int
    """
    return np.where(block.points_given_as(CONTROL), CONTROL, np.where(block.points_given_as(CHECK), CHECK, 0))


def _points(block: Block, solution: Solution | None, ground: Float, images: Int) -> tuple[list[Marks], list[str]]:
    rays = used_rays(block, solution)
    located, role = np.isfinite(ground[:, :2]).all(axis=1), roles(block)
    out = np.zeros(len(ground), dtype=bool)
    wrong = rows_of(rejected_control(solution), block.points.id)
    out[wrong[wrong >= 0]] = True
    marks, notes = [], []
    for shape, colour, name, mask in (
        ("dots", "soft", "new points", role == 0),
        ("circles", "green", "check points", role == CHECK),
        ("triangles", "red", "control", (role == CONTROL) & ~out),
        ("crosses", "red", "control left out", (role == CONTROL) & out),
    ):
        rows = np.flatnonzero(located & mask)
        drawn = rows[thinned(len(rows))]
        if len(drawn) < len(rows):
            notes.append(f"{len(drawn)} of {len(rows)} {name}")
        marks.append(
            Marks(
                shape,  # type: ignore[arg-type]
                ground[drawn, :2],
                colour,
                name,
                width={"dots": 2.5, "crosses": 2.5}.get(shape, 1.6),
                ids=block.points.id[drawn].tolist(),
                tells=[several(k, "ray") for k in solution.points.rays[drawn].tolist()] if solution is not None else (),
                labelled=shape != "dots",
                seen_from=seen_from(rays, drawn, images),
            )
        )
    return marks, notes
