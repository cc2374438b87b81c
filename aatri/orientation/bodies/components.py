"""Free components: strips, each in a frame of its own, joined to each other by common points.

1. Components grow from single strips, the best tied pair first (component_growth).
2. All strips of a component are then adjusted together as similarities of seven unknowns each, the common points
   eliminated (tied_adjustment), one strip held; wrong ties are found by data snooping.

The frame and unit of a component are those of the strip with most points.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adjusting.tied_adjustment import TiedResult, adjust_tied
from aatri.adjusting.tied_problem import tied_problem
from aatri.adjustment.statistics.rejection import Snooping
from aatri.arrays import Bool, Float, Int, Text, sums_of
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.similarity import IDENTITY, Similarity, compose, inverse
from aatri.ids import several, shown
from aatri.observations.poses import POINT
from aatri.observations.ties import BODY, STRIP_TIE
from aatri.orientation.bodies.component_growth import BodyPoints, Tie, grow_components
from aatri.orientation.bodies.limits import GROSS_TIE, MOST_TURNED_OVER, TIE_LIMIT
from aatri.orientation.bodies.similarity_ties import similarities_of, similarity_ties


@dataclass(frozen=True)
class Component:
    """Strips joined to one free body."""

    strips: Int
    """(k,). Numbers of the strips, ascending."""
    component_from_strip: tuple[Similarity, ...]
    """For each of them."""
    rows: Int
    """(m,). Rows of its points in the BodyPoints."""
    point: Int
    """(p,). Numbers of its points, ascending."""
    xyz: Float
    """(p, 3), unit of the component."""
    covariance: Float
    """(p, 3, 3), unit of the component squared."""
    tied: TiedResult | None
    """The adjustment; None for a single strip. Its observations are the rows."""


@dataclass(frozen=True)
class FreeBlock:
    """Free components, and why they were not joined further."""

    components: tuple[Component, ...]
    """Largest first (number of points, then first strip)."""
    active: Bool
    """(n,). Rows of the BodyPoints not rejected."""
    unjoined: tuple[str, ...]
    """For each pair of components with few or bad ties: what is missing."""
    weak: tuple[bool, ...] = ()
    """For each of these: it could be joined weakly, by points nearly on a line."""
    contradicting: frozenset[frozenset[int]] = frozenset()
    """Pairs of components, by their first strips, whose common points do not fit."""


def join_strips(
    points: BodyPoints,
    names: Sequence[str],
    *,
    point_ids: Text | None = None,
    active: Bool | None = None,
    limit: float = TIE_LIMIT,
    weakly: bool = True,
    apart: Sequence[int] = (),
    word: str = "strip",
) -> FreeBlock:
    """Join strips by common points to free components.

    Parameters
    ----------
    names : (n_strips,) sequence of str
        Names of the strips, for messages.
    point_ids : str, optional
        Of all points; default: their numbers.
    active : (n,) bool, optional
        Rows to begin with; the others are tested for re-admission.
    limit : float
        Test statistic of a wrong tie.
    weakly : bool
        Also by common points nearly on a line, see component_growth.
    apart : sequence of int
        Strips that are joined to no other.
    word : str
        What messages call a strip.
    """
    use = np.ones(len(points.strip), dtype=bool) if active is None else active.copy()
    use[np.isin(points.strip, apart)] = False
    ids = np.arange(int(points.point.max(initial=-1)) + 1).astype(np.str_) if point_ids is None else point_ids
    member, pose, weak = grow_components(points.take(use), len(names), weakly=weakly)
    components, loose_strips, open_ = [], list(apart), dict[str, bool]()
    groups, turned_over = [np.flatnonzero(member == label) for label in np.unique(member)], 0
    while groups:
        strips = groups.pop()
        try:
            component = _adjusted(points, strips, [pose[k] for k in strips], use, limit, names, ids, word)
        except (GeometryError, ConvergenceError) as error:  # a strip that ties leave open, or turn over, is by itself
            turned_over += isinstance(error, ConvergenceError)
            if turned_over > MOST_TURNED_OVER:
                raise
            loose = _loosest(points.take(use & np.isin(points.strip, strips)), strips)
            groups += [strips[strips != loose], np.array([loose])]
            loose_strips.append(loose)
            open_[f"{word} {names[loose]}: {error.what}"] = False
            continue
        components.append(component)
        if component.tied is not None:
            use[component.rows] = component.tied.active
    components.sort(key=lambda c: (-len(c.point), int(c.strips[0])))
    tied = [c for c in components if not np.isin(c.strips, loose_strips).any()]
    reasons = {**_reasons(tied, weak, member, names, word), **open_}
    first = {int(member[c.strips[0]]): int(c.strips[0]) for c in tied}
    misfits = [
        frozenset(first[k] for k in pair) for pair, tie in weak.items() if tie.misfit and first.keys() >= set(pair)
    ]
    return FreeBlock(tuple(components), use, tuple(reasons), tuple(reasons.values()), frozenset(misfits))


def _adjusted(
    points: BodyPoints,
    strips: Int,
    pose: list[Similarity],
    use: Bool,
    limit: float,
    names: Sequence[str],
    point_ids: Text,
    word: str,
) -> Component:
    rows = np.flatnonzero(np.isin(points.strip, strips))
    own_points = points.take(rows)
    number, point = np.unique(own_points.point, return_inverse=True)
    if len(strips) == 1:
        # An identity pose, so that the component is the strip itself.
        order = np.argsort(point)
        return Component(strips, (IDENTITY,), rows, number, own_points.xyz[order], own_points.covariance[order], None)
    local = np.searchsorted(strips, own_points.strip)
    reference = int(np.argmax(np.bincount(local, minlength=len(strips))))
    to_held = inverse(pose[reference])
    centre = sums_of(own_points.xyz, local, len(strips)) / np.bincount(local, minlength=len(strips))[:, None]
    start = [compose(compose(to_held, p), Similarity(c, 1.0, np.eye(3))) for p, c in zip(pose, centre)]
    ties = similarity_ties(
        local,
        point,
        own_points.xyz - centre[local],
        own_points.covariance,
        names=[names[k] for k in strips],
        free=np.arange(len(strips)) != reference,
    )
    del own_points  # the ties have what they need of them
    begin = similarities_of(start)
    active = use[rows] & _plausible(ties.on_ground(begin, ties.rows), ties.spectrum(begin)[0].sum(axis=1), point)
    what = f"joining {word}s {shown(str(names[k]) for k in strips)}"
    ids = point_ids[number]
    of_ties = ties.observed(STRIP_TIE, np.array([names[k] for k in strips], dtype=np.str_)[local], ids[point], begin)
    problem = tied_problem([of_ties], {POINT: ties.places(begin, len(number))}, {POINT: ids}, what)
    tied = adjust_tied(problem, Snooping(limit), active=active)
    component_from_strip = [compose(tied.state[BODY][k], Similarity(-c, 1.0, np.eye(3))) for k, c in enumerate(centre)]
    solved = np.isfinite(tied.mean_m).all(1)
    return Component(
        strips,
        tuple(component_from_strip),
        rows,
        number[solved],
        tied.mean_m[solved],
        tied.mean_covariance_m2[solved],
        tied,
    )


def _loosest(points: BodyPoints, strips: Int) -> int:
    """The strip that shares the fewest points with the others."""
    shared = np.bincount(points.point)[points.point] > 1
    count = np.bincount(points.strip[shared], minlength=int(strips.max()) + 1)[strips]
    return int(strips[np.argmin(count)])


def _plausible(xyz: Float, variance: Float, point: Int) -> Bool:
    """Points of strips without the grossest errors, which least squares would not survive, by the robust start.

    A point is compared with the median over its strips; of two that disagree the less precise is set aside. What was
    set aside too much is re-admitted by its test.
    """
    count = np.bincount(point)
    order = np.argsort(point, kind="stable")
    median = np.stack([_medians(point[order], column[order], count) for column in xyz.T], axis=1)
    distance = np.linalg.norm(xyz - median[point], axis=1)
    shared = count[point] > 1
    if not shared.any():
        return np.ones(len(point), dtype=bool)
    least = max(GROSS_TIE * float(np.median(distance[shared])), 1e-6 * float(np.abs(xyz).max()))
    gross = shared & (distance > least)
    pair = count[point] == 2
    precise = np.lexsort((variance, point))
    first = np.zeros(len(point), dtype=bool)
    first[precise[np.diff(point[precise], prepend=-1) > 0]] = True
    return np.asarray(~(gross & ~(pair & first)))


def _medians(point: Int, value: Float, count: Int) -> Float:
    """Median of the values of each point; points ascending, each `count` times, at least once."""
    start = np.cumsum(count) - count
    total, least, most = (f.reduceat(value, start) for f in (np.add, np.minimum, np.maximum))
    median = np.where(count > 2, total - least - most, total / count)
    many = np.flatnonzero((count > 3)[point])  # few points lie in more than three strips
    if len(many):
        ranked = value[many][np.lexsort((value[many], point[many]))]
        enough = count[count > 3]
        first = np.cumsum(enough) - enough
        median[count > 3] = 0.5 * (ranked[first + (enough - 1) // 2] + ranked[first + enough // 2])
    return median


def _reasons(
    components: list[Component], weak: dict[tuple[int, int], Tie], member: Int, names: Sequence[str], word: str
) -> dict[str, bool]:
    """Why pairs of components are not joined, and whether they could be weakly."""
    components = sorted(components, key=lambda c: int(c.strips[0]))
    label = [int(member[c.strips[0]]) for c in components]
    texts = dict[str, bool]()
    for i, first in enumerate(components):
        for j, second in enumerate(components[i + 1 :], i + 1):
            tie = weak.get((min(label[i], label[j]), max(label[i], label[j])))
            between = f"{strip_names(first, names, word)} and {strip_names(second, names, word)}"
            if tie is None:
                texts[f"{between} have no common point"] = False
            elif tie.common < 3:
                texts[f"{between} have {tie.common} common point{'s' * (tie.common > 1)}, 3 are needed"] = False
            else:
                weakly = tie.joins(weakly=True)
                reason = tie.misfit or ("lie nearly on a line" if weakly else "lie on a line")
                texts[f"{between} have {several(tie.common, 'common point')} that {reason}"] = weakly
    return texts


def strip_names(component: Component, names: Sequence[str], word: str = "strip") -> str:
    """`strip 1` or `strips 1, 2`; of many the first ones and how many more there are."""
    return f"{word}{'s' * (len(component.strips) > 1)} {shown(str(names[k]) for k in component.strips)}"
