"""The ground points of a block: new points, check points and control, each seen in at least two images.

Candidates at the standard positions, and at random, are photographed; those seen at least twice are kept, the random
ones up to the number wanted. Control and check points seen less often move towards the centre of the block in small
steps until they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.artifacts.block import CHECK, CONTROL
from aatri.errors import GeometryError
from aatri.simulation import earth, targets
from aatri.simulation.flight import Plan
from aatri.simulation.rays import Photography, Rays, taken
from aatri.simulation.settings import Flight, Known, Ties
from aatri.simulation.terrain import Surface

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int64]

LEAST_RAYS = 2
MOST_BATCHES = 50
STEP_IN = 0.05
"""Control seen too little moves to the centre by this share of its distance."""


@dataclass(frozen=True)
class GroundTargets:
    """All points of the block; row k of every array is point k, which is what `rays.point` holds."""

    id: list[str]
    local_m: Float  # (n, 3) E, N, h
    role: Int  # (n, 3) as in Block.ground_points, zeros for new points without known coordinates
    rays: Rays


@dataclass(frozen=True)
class _Seen:
    local_m: Float
    rays: Rays


@dataclass(frozen=True)
class Ground:
    """The surface and the false origin to which coordinates are settled."""

    surface: Surface
    false_origin_m: tuple[float, float]

    def at(self, plan_m: Float) -> Float:
        """Points of the surface at plan positions: (n, 3) E, N, h."""
        plan = earth.settled(np.column_stack([plan_m, np.zeros(len(plan_m))]), self.false_origin_m)[:, :2]
        return np.column_stack([plan, self.surface.height_m(plan)])


def ground_targets(
    photography: Photography,
    plan: Plan,
    ground: Ground,
    flight: Flight,
    ties: Ties,
    known: Known,
    rng: np.random.Generator,
) -> GroundTargets:
    """All points of the block with their rays.

    Raises
    ------
    GeometryError
        If the images overlap too little for the points asked for.
    """
    low, high = targets.extent(plan)
    control_roles = _roles(CONTROL, known.full, known.plan, known.height)
    check_roles = _roles(CHECK, known.check_full, known.check_plan, known.check_height)
    inset = 0.1 * (high - low)
    control = _within(photography, ground, targets.net(low, high, len(control_roles)), "control")
    check = _within(photography, ground, targets.net(low + inset, high - inset, len(check_roles)), "check points")
    half_side_m = 1e-3 * ties.spread_mm * flight.scale_number
    standard = targets.clusters(targets.standard_positions(plan), ties.per_position, half_side_m, rng)
    new = _seen(photography, ground.at(standard))
    if ties.new_points is None:
        shares = (1 - flight.forward_overlap / 100) * (1 - flight.side_overlap / 100)
        wanted = round(len(plan.id) * ties.random_per_image * shares)
    else:
        wanted = ties.new_points - len(check_roles) - len(new.local_m)
        new = new if wanted >= 0 else _selection(new, ties.new_points - len(check_roles))
    groups = [new, _random(photography, ground, max(wanted, 0), low, high, rng)]
    local = np.concatenate([g.local_m for g in (*groups, check, control)])
    return GroundTargets(
        id=_ids(sum(len(g.local_m) for g in groups), len(check_roles), len(control_roles)),
        local_m=local,
        role=np.concatenate([np.zeros((len(local) - len(check_roles) - len(control_roles), 3), np.int64),
                             check_roles, control_roles]),
        rays=_joined([*groups, check, control]),
    )  # fmt: skip


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


def _seen(photography: Photography, local_m: Float) -> _Seen:
    """Those of the points that are seen often enough."""
    rays = taken(photography, local_m)
    enough = np.bincount(rays.point, minlength=len(local_m)) >= LEAST_RAYS
    return _Seen(local_m[enough], rays.of_points(np.where(enough, np.cumsum(enough) - 1, -1)))


def _selection(seen: _Seen, points: int) -> _Seen:
    """Exactly so many of the points, spread evenly over their order."""
    if points < 0:
        raise GeometryError("more check points than new points", where="options of block/simulate",
                            remedy="raise ties.new_points or lower known.check_full")  # fmt: skip
    chosen = np.zeros(len(seen.local_m), dtype=bool)
    chosen[np.arange(points) * len(chosen) // max(points, 1)] = True
    return _Seen(seen.local_m[chosen], seen.rays.of_points(np.where(chosen, np.cumsum(chosen) - 1, -1)))


def _random(
    photography: Photography, ground: Ground, points: int, low_m: Float, high_m: Float, rng: np.random.Generator
) -> _Seen:
    """Exactly so many random points, each seen often enough."""
    found: list[_Seen] = []
    missing = points
    for _ in range(MOST_BATCHES):
        if missing == 0:
            break
        batch = _seen(photography, ground.at(targets.scattered(low_m, high_m, missing, rng)))
        found.append(batch)
        missing -= len(batch.local_m)
    if missing:
        raise GeometryError(
            f"{missing} of {points} random points are in fewer than {LEAST_RAYS} images",
            where="options of block/simulate",
            remedy="raise flight.forward_overlap above 50 percent or lower the number of points",
        )
    return _Seen(np.concatenate([np.zeros((0, 3)), *(f.local_m for f in found)]), _joined(found))


def _within(photography: Photography, ground: Ground, plan_m: Float, what: str) -> _Seen:
    """Points that are all seen often enough, moved towards the centre where they must be."""
    plan_m = plan_m.copy()
    for _ in range(MOST_BATCHES):
        local = ground.at(plan_m)
        seen = _seen(photography, local)
        if len(seen.local_m) == len(local):
            return seen
        rays = np.bincount(taken(photography, local).point, minlength=len(local))
        plan_m[rays < LEAST_RAYS] *= 1 - STEP_IN
    raise GeometryError(
        f"{len(local) - len(seen.local_m)} {what} are in fewer than {LEAST_RAYS} images wherever they are put",
        where="options of block/simulate",
        remedy="raise flight.forward_overlap and flight.side_overlap",
    )


def _joined(parts: list[_Seen]) -> Rays:
    """Rays of all parts, the points numbered through."""
    starts = np.cumsum([0, *(len(p.local_m) for p in parts)])
    return Rays(
        np.concatenate([np.zeros(0, np.int64), *(p.rays.image for p in parts)]),
        np.concatenate([np.zeros(0, np.int64), *(p.rays.point + s for p, s in zip(parts, starts))]),
        np.concatenate([np.zeros((0, 2)), *(p.rays.photo_mm for p in parts)]),
    )
