"""The ground points of a block: new points, check points and control, each seen in at least two images.

Candidates at the standard positions, and at random, are photographed; those seen at least twice are kept, the random
ones up to the number wanted. Control and check points seen less often move towards the centre of the block in small
steps until they are.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import CHECK, CONTROL
from aatri.simulation import earth, targets
from aatri.simulation.earth import Surface
from aatri.simulation.flight import FlightPlan
from aatri.simulation.measured import Streams
from aatri.simulation.rays import Photography, SimulatedRays, taken
from aatri.simulation.settings import ControlOptions, FlightOptions, TieOptions, refused
from aatri.simulation.structures import Structure

LEAST_RAYS = 2
MOST_BATCHES = 50
CHECK_INSET = 0.1
"""The net of check points lies inside that of the control by this share of the block."""
STEP_IN = 0.05
"""Control seen too little moves to the centre by this share of its distance."""


@dataclass(frozen=True)
class GroundTargets:
    """All points of the block; row k of every array is point k, which is what `rays.point` holds."""

    id: list[str]
    local_m: Float  # (n, 3) E, N, h
    role: Int  # (n, 3) as in Block.ground_points, zeros for new points without known coordinates
    rays: SimulatedRays
    structures: list[Structure]
    in_structure: Bool  # (n,)


@dataclass(frozen=True)
class _SeenPoints:
    local_m: Float
    rays: SimulatedRays


@dataclass(frozen=True)
class GroundSurface:
    """The surface and the false origin to which coordinates are settled."""

    surface: Surface
    false_origin_m: tuple[float, float]

    def at(self, plan_m: Float) -> Float:
        """Points of the surface at plan positions: (n, 3) E, N, h."""
        plan = earth.settled(np.column_stack([plan_m, np.zeros(len(plan_m))]), self.false_origin_m)[:, :2]
        return np.column_stack([plan, self.surface.height_m(plan)])


def ground_targets(
    photography: Photography,
    plan: FlightPlan,
    ground: GroundSurface,
    flight: FlightOptions,
    ties: TieOptions,
    options: ControlOptions,
    planned: list[Structure],
    streams: Streams,
) -> GroundTargets:
    """All points of the block with their rays.

    Raises
    ------
    GeometryError
        If the images overlap too little for the points asked for.
    """
    if options.layout and planned:
        raise refused(
            "known.layout leaves no place for points of relative control",
            "leave out known.layout or the figures of `survey`",
        )
    if options.layout:
        return _laid_out(photography, targets.standard_rows(plan), ground, options.layout)
    low, high = targets.extent(plan)
    rng = streams["points"]
    inset = CHECK_INSET * (high - low)
    control_role = _roles(CONTROL, options.full, options.plan, options.height)
    check_role = _roles(CHECK, options.check_full, options.check_plan, options.check_height)
    control = _within(photography, ground, targets.net(low, high, len(control_role)), "control points")
    check = _within(photography, ground, targets.net(low + inset, high - inset, len(check_role)), "check points")
    half_side_m = 1e-3 * ties.spread_mm * flight.scale_number
    clusters = targets.clusters(targets.standard_positions(plan), ties.per_position, half_side_m, rng)
    standard = _seen(photography, ground.at(clusters))
    if ties.new_points is None:
        mean_rays = 1 / ((1 - flight.forward_overlap / 100) * (1 - flight.side_overlap / 100))
        more = round(len(plan.id) * ties.random_per_image / mean_rays)
    else:
        unknown = ties.new_points - len(check_role)
        standard = _at_most(standard, unknown)
        more = unknown - len(standard.local_m)
    structures = [_standing(photography, ground, s, (low, high), streams["structure"]) for s in planned]
    erected = np.concatenate([np.zeros((0, 3)), *(s.local_m for s in structures)])
    of_structures = _SeenPoints(erected, taken(photography, erected))
    parts = [standard, _random(photography, ground, more, low, high, rng), of_structures, check, control]
    new, known_points = len(standard.local_m) + more, len(check_role) + len(control_role)
    ids = _ids(new, len(check_role), len(control_role))
    return GroundTargets(
        id=[*ids[:new], *(name for s in structures for name in s.ids()), *ids[new:]],
        local_m=np.concatenate([part.local_m for part in parts]),
        role=np.concatenate([np.zeros((new + len(erected), 3), np.int64), check_role, control_role]),
        rays=_joined(parts),
        structures=structures,
        in_structure=np.repeat([False, True, False], [new, len(erected), known_points]),
    )


def _standing(
    photography: Photography,
    ground: GroundSurface,
    planned: Structure,
    area: tuple[Float, Float],
    rng: np.random.Generator,
) -> Structure:
    """A structure at a random place where all its points are seen often enough, clear of the ground."""
    clear = np.array([0.0, 0.0, np.abs(planned.offset_m).max()])
    for _ in range(MOST_BATCHES):
        place = ground.at(targets.scattered(*area, 1, rng))[0] + clear
        standing = planned.standing(photography, place)
        if (_counts(taken(photography, standing.local_m), len(standing.local_m)) >= LEAST_RAYS).all():
            return standing
    raise refused(
        f"{planned.type}: nowhere are all of {len(planned.offset_m)} points in {LEAST_RAYS} images",
        "raise flight.forward_overlap or lower survey.shape_size_m",
    )


_LETTERS = {"X": (1, 1, 1), "P": (1, 1, 0), "Z": (0, 0, 1), "o": (0, 0, 0)}


def _laid_out(
    photography: Photography, rows: list[Float], ground: GroundSurface, layout: tuple[str, ...]
) -> GroundTargets:
    """Points at the standard positions, as the letters of the layout have them."""
    if [len(row) for row in rows] != [len(row) for row in layout] or set("".join(layout)) - {*_LETTERS, "-"}:
        raise refused(
            f"the layout is of rows of {', '.join(str(len(row)) for row in layout)} letters, the standard positions of "
            f"rows of {', '.join(str(len(row)) for row in rows)}",
            "known.layout: one row of letters X P Z o - for each row of positions, from north",
        )
    letters = np.array(list("".join(layout)))
    order = [*np.flatnonzero(letters == "o"), *np.flatnonzero(np.isin(letters, ["X", "P", "Z"]))]
    role = CONTROL * np.array([_LETTERS[str(letters[k])] for k in order], dtype=np.int64)
    local = ground.at(np.concatenate(rows)[order])
    rays = taken(photography, local)
    if (_counts(rays, len(local)) < LEAST_RAYS).any():
        raise refused(
            f"standard positions are in fewer than {LEAST_RAYS} images",
            "raise flight.forward_overlap above 50 percent, or leave them out: -",
        )
    new = int((letters == "o").sum())
    none = np.zeros(len(order), dtype=bool)
    return GroundTargets(_ids(new, 0, len(order) - new), local, role, rays, [], none)


def _roles(role: int, full: int, plan: int, height: int) -> Int:
    kinds = np.repeat(np.array([[1, 1, 1], [1, 1, 0], [0, 0, 1]]), [full, plan, height], axis=0)
    return np.asarray(role * kinds, dtype=np.int64)


def _ids(new: int, check: int, control: int) -> list[str]:
    first = 10 ** len(str(new))
    width = [max(2, len(str(n))) for n in (check, control)]
    return [
        *(str(first + k + 1) for k in range(new)),
        *(f"CHK{k + 1:0{width[0]}d}" for k in range(check)),
        *(f"GCP{k + 1:0{width[1]}d}" for k in range(control)),
    ]


def _seen(photography: Photography, local_m: Float) -> _SeenPoints:
    """Those of the points that are seen often enough."""
    rays = taken(photography, local_m)
    return _chosen(_SeenPoints(local_m, rays), _counts(rays, len(local_m)) >= LEAST_RAYS)


def _counts(rays: SimulatedRays, points: int) -> Int:
    return np.bincount(rays.point, minlength=points)


def _chosen(seen: _SeenPoints, mask: Bool) -> _SeenPoints:
    """The points of the mask, numbered anew."""
    return _SeenPoints(seen.local_m[mask], seen.rays.of_points(np.where(mask, np.cumsum(mask) - 1, -1)))


def _at_most(seen: _SeenPoints, points: int) -> _SeenPoints:
    """So many of the points, spread evenly over their order, if there are more."""
    if points < 0:
        raise refused("there are more check points than new points", "raise ties.new_points or lower known.check_full")
    number = len(seen.local_m)
    mask = np.zeros(number, dtype=bool)
    mask[np.arange(min(points, number)) * number // max(min(points, number), 1)] = True
    return _chosen(seen, mask)


def _random(
    photography: Photography, ground: GroundSurface, points: int, low_m: Float, high_m: Float, rng: np.random.Generator
) -> _SeenPoints:
    """Exactly so many random points, each seen often enough."""
    standing: list[_SeenPoints] = []
    missing = points
    for _ in range(MOST_BATCHES):
        if missing == 0:
            break
        batch = _seen(photography, ground.at(targets.scattered(low_m, high_m, missing, rng)))
        standing.append(batch)
        missing -= len(batch.local_m)
    if missing:
        raise refused(
            f"{missing} of {points} random points are in fewer than {LEAST_RAYS} images",
            "raise flight.forward_overlap above 50 percent or lower the number of points",
        )
    return _SeenPoints(np.concatenate([np.zeros((0, 3)), *(f.local_m for f in standing)]), _joined(standing))


def _within(photography: Photography, ground: GroundSurface, plan_m: Float, what: str) -> _SeenPoints:
    """Points that are all seen often enough, moved towards the centre where they must be."""
    plan_m = plan_m.copy()
    few = np.zeros(len(plan_m), dtype=bool)
    for _ in range(MOST_BATCHES):
        plan_m[few] *= 1 - STEP_IN
        local = ground.at(plan_m)
        rays = taken(photography, local)
        few = _counts(rays, len(local)) < LEAST_RAYS
        if not few.any():
            return _SeenPoints(local, rays)
    raise refused(
        f"{few.sum()} {what} are in fewer than {LEAST_RAYS} images wherever they are put",
        "raise flight.forward_overlap and flight.side_overlap",
    )


def _joined(parts: list[_SeenPoints]) -> SimulatedRays:
    """Rays of all parts, the points numbered through."""
    starts = np.cumsum([0, *(len(p.local_m) for p in parts)])
    return SimulatedRays(
        np.concatenate([np.zeros(0, np.int64), *(p.rays.image for p in parts)]),
        np.concatenate([np.zeros(0, np.int64), *(p.rays.point + s for p, s in zip(parts, starts))]),
        np.concatenate([np.zeros((0, 2)), *(p.rays.photo_mm for p in parts)]),
    )
