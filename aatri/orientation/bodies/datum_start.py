"""Start of the orientation of a free body on the ground, by observations of any kind.

The closed form of at least three places known in full that are not on a line, with the least sum of distances, so that
wrong ones hardly disturb it. Else the body is levelled by the mean viewing direction of its images and turned through
all headings, with scale and shift by linear least squares of all observations; from each of them the seven parameters,
and the unknowns that kinds have of their own, are adjusted:

    X = T + s R x,   X0 = T + s R x0,   R_image = R R_image'        T, s, R from all records of the points and images,

a step (t, r, m) moves the body by the generators G of a similarity, so that the derivatives of a record are those to
its images and points times these,

    dv = sum J_b G_b (t, r, m),      T <- (1 + m) E T + t,   R <- E R,   s <- (1 + m) s,   E = exp([r]x)

and the end of least cost counts. Where asked for, two places known in plan, the farthest apart, turn the levelled body
instead (the frame tp, geometry.two_point).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from aatri.adjusting.added_variance import observed_components, whitener_beside
from aatri.adjustment.records import Records, whitened
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.rotations import exp_rotation, levelling
from aatri.geometry.similarity import Similarity, from_centroids, robust_closed_form, transform
from aatri.geometry.two_point import farthest_apart, two_point_frame
from aatri.ids import several
from aatri.observations.control import KIND as CONTROL
from aatri.observations.observed import Observed
from aatri.observations.poses import GENERATORS, POINT, POSE, by_similarity
from aatri.observations.positions import KIND as POSITION
from aatri.observations.ties import BODY
from aatri.orientation.bodies.datum_analysis import GivenPlaces
from aatri.orientation.bodies.free_body import FreeBody, state_of
from aatri.orientation.bodies.limits import ALL_SIDES, COLLINEAR_PLACES, MISFIT_OF_RIGHT, UPWARDS
from aatri.orientation.bodies.similarity_ties import LABELS

HEADINGS, SAME_ENDS = 12, 3
"""Starts: every 30 degrees one. So many that come to one cost, from all around, need no further ones."""

SHIFT_AND_SCALE = [0, 1, 2, 6]

LINEAR_STEPS = 3
"""Steps of shift and scale, in which distances are nearly linear."""

SMALLEST = 0.1
"""A step reduces the scale to no less than this share."""

ITERATIONS, TOLERANCE = 60, 0.1

ROUGH_M = 0.1
"""Standard deviation of the points of a body, about, beside which exact coordinates are weighed; or the median of those
of all given coordinates, if that is larger: beside positions of ten metres, exact control that is weighed as 1 mm
leaves what these alone determine to rounding."""

Observe = Callable[[Similarity], tuple[Observed, ...]]
"""Where a body lies -> the observations that concern it, of all kinds."""


def closed_start(places: GivenPlaces, x: Float, collinear: float = COLLINEAR_PLACES) -> Similarity | None:
    """Ground from body, by places known in full; None where these do not determine it. `x` are they in the body."""
    full = np.flatnonzero(places.given.all(axis=1))
    if len(full) < 3:
        return None
    spread = np.linalg.svd(x[full] - x[full].mean(axis=0), compute_uv=False)
    if spread[1] ** 2 <= collinear * spread[0] ** 2:
        return None
    return robust_closed_form(x[full], places.observed_m[full])[0]


def looks_upwards(to: Similarity, up: Float) -> bool:
    """Whether images look upwards on the ground, `up` being against their mean viewing direction in the body."""
    length = float(np.linalg.norm(up))
    return length > ALL_SIDES and float((to.rotation @ up)[2]) < -UPWARDS * length


def fits(places: GivenPlaces, x: Float, body: FreeBody, start: Similarity) -> bool:
    """Whether places lie where they are given, as near as those of right ids do; `x` are they in the body."""
    off = np.where(places.given, transform(start, x) - places.observed_m, 0.0)
    return float(np.sqrt((off**2).sum() / max(len(off), 1))) <= MISFIT_OF_RIGHT * typical_distance(body, start)


def near_start(observed: Sequence[Observed], body: FreeBody, start: Similarity, limit: float) -> Bool:
    """Which observations lie as near a start as right ids leave them; control, positions and lengths are asked, (n,).

    Least squares follow two images far apart with each other's id, or a length in another unit, until the scale is
    nothing or the block upside down; the start, of the least sum of distances of places, does not. Height differences
    count as lengths. What is off by less than `limit` standard deviations is near.
    """
    state, farthest_m = state_of(observed, body, start), MISFIT_OF_RIGHT * typical_distance(body, start)
    near = [np.ones(len(o), dtype=bool) for o in observed]
    for o, part in zip(observed, near):
        is_length = o.unit == "m" and o.records.rows == 1 and o.records.groups <= {POSE, POINT}
        if len(o) and (o.kind in (CONTROL, POSITION) or is_length):
            off_m = np.where(observed_components(o), o.records.evaluate(state, np.arange(len(o)))[0], 0.0)
            by_chance = np.abs(off_m) <= limit * np.nan_to_num(o.sigmas())
            part[:] = by_chance.all(axis=1) | (np.linalg.norm(off_m, axis=1) <= farthest_m)
    return np.concatenate(near)


def typical_distance(body: FreeBody, start: Similarity) -> float:
    """Median distance of the points from the middle of the images, on the ground, m."""
    centre, points = np.mean(body.poses.position_m[body.has[POSE]], axis=0), body.xyz[body.has[POINT]]
    return start.scale * float(np.median(np.linalg.norm(points - centre, axis=1)))


def fitted(observe: Observe, body: FreeBody, use: Bool, start: Similarity, iterations: int = ITERATIONS) -> float:
    """The cost of all observations together, half their sum of squares; infinite where a body does not come to fit."""
    try:
        return _adjusted(observe, body, use, start, iterations)[1]
    except (ConvergenceError, GeometryError):
        return float("inf")


def all_headings(body: FreeBody) -> list[Similarity]:
    """The levelled body, turned through all headings."""
    spread = 5 * np.arange(HEADINGS) % HEADINGS  # 150 degrees from one to the next: neighbours come late
    turns = [exp_rotation(np.array([0.0, 0.0, turn])) for turn in spread * 2 * np.pi / HEADINGS]
    return [Similarity(np.zeros(3), 1.0, turn @ levelling(body.up)) for turn in turns]


def searched_start(
    observe: Observe, body: FreeBody, use: Bool, offered: Similarity | None = None
) -> tuple[Similarity, float]:
    """Ground from body, by all observations together, and their cost.

    Parameters
    ----------
    use : (n,) bool
        Observations that count, kind by kind.
    offered : Similarity, optional
        A start beside the headings.

    Raises
    ------
    GeometryError
        If something of the seven is left open.
    ConvergenceError
    """
    failure: GeometryError | ConvergenceError | None = None
    ends = list[tuple[bool, float, Similarity]]()
    starts = all_headings(body)
    for start in starts if offered is None else [offered, *starts]:
        try:
            to_ground, cost = _adjusted(observe, body, use, start)
        except (ConvergenceError, GeometryError) as error:
            failure = failure or error
            continue
        ends.append((looks_upwards(to_ground, body.up), cost, to_ground))
        least = min(ends, key=lambda end: end[:2])
        same = sum(end[0] == least[0] and end[1] <= least[1] + TOLERANCE for end in ends)
        if same >= SAME_ENDS and not least[0]:
            break
    if not ends:
        raise failure or GeometryError("nothing is observed of it", remedy="give control or observed positions")
    _, cost, to_ground = min(ends, key=lambda end: end[:2])
    return to_ground, cost


def _adjusted(
    observe: Observe, body: FreeBody, use: Bool, start: Similarity, iterations: int = ITERATIONS
) -> tuple[Similarity, float]:
    first = scaled(observe(start), use, body, start)
    observed = weighed(observe(first), use)
    own = {name: value for o in observed for name, value in o.start.items()}
    unknowns = [Unknowns(BODY, np.ones((1, 7), dtype=bool), LABELS, ("as a whole",), retracted)]
    unknowns += [replace(u, generator=None) for o in observed for u in o.unknowns]
    records = [of_body(o.records, body) for o in observed]
    done = adjust_large(unknowns, records, {**own, BODY: first}, max_iterations=iterations, tolerance=TOLERANCE)
    return done.state[BODY], done.cost


def weighed(observed: Sequence[Observed], use: Bool) -> list[Observed]:
    """Those that count, exact ones nearly so."""
    edges = np.cumsum([len(o) for o in observed])[:-1]
    used = [o.take(np.flatnonzero(part)) for o, part in zip(observed, np.split(use, edges))]
    covariances = [o.covariances() for o in used]
    variance_m2 = [np.einsum("nii->ni", C)[observed_components(o)] for o, C in zip(used, covariances) if o.unit == "m"]
    rough_m2 = max(ROUGH_M**2, float(np.median(np.concatenate([np.zeros(1), *variance_m2]))))
    weights = [whitener_beside(o, C, rough_m2) for o, C in zip(used, covariances)]
    return [replace(o, records=replace(o.records, whitener=T)) for o, T in zip(used, weights)]


def scaled(observed: Sequence[Observed], use: Bool, body: FreeBody, start: Similarity) -> Similarity:
    """Shift and scale, the rotation held, from the observations without unknowns of their own.

    What these do not see by a standard deviation, if the body is shifted by its size or doubled, stays as it is.
    """
    plain = [of_body(o.records, body) for o in weighed(observed, use) if len(o) and o.records.groups <= {POSE, POINT}]
    extent = float(np.linalg.norm(np.ptp(body.places, axis=0))) if plain else 0.0
    for _ in range(LINEAR_STEPS if plain else 0):
        rows = [whitened(r, {BODY: start}, np.arange(len(r.active))) for r in plain]
        J = np.concatenate([A[0].reshape(-1, 7) for _, A in rows])
        size = np.append(np.full(3, start.scale * extent), 1.0)
        U, singular_values, Vt = np.linalg.svd(J[:, SHIFT_AND_SCALE] * size, full_matrices=False)
        along = U.T @ np.concatenate([w.ravel() for w, _ in rows])
        step = np.zeros((1, 7))
        step[0, SHIFT_AND_SCALE] = -size * (
            Vt.T @ np.divide(along, singular_values, out=np.zeros(len(singular_values)), where=singular_values > 1.0)
        )
        start = retracted(start, step)
    return start


def retracted(value: Similarity, step: Float) -> Similarity:
    """The similarity moved by shift, turn and change of scale about the origin, (1, 7)."""
    t, r, m = step[0, :3], step[0, 3:6], max(1.0 + float(step[0, 6]), SMALLEST)
    turn = exp_rotation(r)
    return Similarity(m * turn @ value.translation + t, m * value.scale, turn @ value.rotation)


def of_body(records: Records, body: FreeBody) -> Records:
    """The same records, as observations of the body."""
    is_of_body = [group in GENERATORS for group, _ in records.touches]
    others = tuple(touch for touch, of_body in zip(records.touches, is_of_body) if not of_body)

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        current = {**state, **body.on_ground(state[BODY])}
        v, jacobians = records.evaluate(current, rows)
        J = by_similarity(records, rows, jacobians, current)
        return v, (J, *(by_block for by_block, of_body in zip(jacobians, is_of_body) if not of_body))

    if not any(is_of_body):  # what is known beforehand of unknowns of their own
        return records
    touches = ((BODY, np.zeros(len(records.active), dtype=np.int32)), *others)
    return Records(records.name, touches, evaluate, records.whitener, records.active, label=records.label)


def centroid_start(places: GivenPlaces, x: Float, body: FreeBody, what: str) -> Similarity:
    """From the start by two points, the similarity of all places known in full, by centroid-reduced coordinates.

    Raises
    ------
    GeometryError
        If two are not known in plan and one in height.
    """
    first = two_point_start(places, x, body, what)
    full = np.flatnonzero(places.given.all(axis=1))
    if len(full) < 3 or closed_start(places, x) is None:
        return first
    return from_centroids(x[full], places.observed_m[full], first)


def two_point_start(places: GivenPlaces, x: Float, body: FreeBody, what: str) -> Similarity:
    """The levelled body turned to the two places known in plan that lie farthest apart, and a mean height.

    By way of tp, which is the levelled body: the ground goes to tp, and back.

    Raises
    ------
    GeometryError
        If fewer are known.
    """
    rotation = levelling(body.up)
    level, xyz_m = x @ rotation.T, places.observed_m
    plan, heights = np.flatnonzero(places.given[:, :2].all(axis=1)), np.flatnonzero(places.given[:, 2])
    if len(plan) < 2 or not len(heights):
        raise GeometryError(
            f"{what}: no initial values from {several(len(plan), 'point')} known in plan and {len(heights)} in height",
            remedy="give two points with X and Y and one with Z",
        )
    ends = plan[farthest_apart(xyz_m[plan, :2])]
    north_east = np.column_stack([xyz_m[ends, 1], xyz_m[ends, 0], np.zeros(2)])
    tp = two_point_frame(level[ends] * np.array([1.0, 1.0, 0.0]), north_east)
    corner = tp.to_ground(np.array([[0.0, 0, 0], [1.0, 0, 0]]))[:, [1, 0]]  # east, north of the origin and of X
    along = corner[1] - corner[0]
    scale = float(np.hypot(*along))
    cos, sin = along / scale
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    height = float(np.mean(xyz_m[heights, 2] - scale * level[heights, 2]))
    return Similarity(np.array([*corner[0], height]), scale, turn @ rotation)
