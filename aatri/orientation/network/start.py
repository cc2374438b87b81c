"""Approximate coordinates of a network from its observations: polar, intersection, resection, traverse.

What is known grows from the points with coordinates. A point is found where two of its loci meet: rays from oriented
stations, circles of distances, circles of the angle under which it sees two known points; of several such places that
counts which fits all its observations best. Where nothing follows from what is known (a traverse oriented at its far
end, a free network), a part is built in axes of its own from one distance and laid onto its known points, turned and
shifted, or left in those axes where there are none; without any distance it has an arbitrary size. Heights follow along
height differences and zenith angles, coordinates along coordinate differences.

Source: Kahmen & Faig, Surveying, ch. 8; docs/methods/networks.md.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.orientation.network.limits import CLEARLY_BETTER
from aatri.orientation.network.meeting import Locus, fitting_point

MOST_ROUNDS = 1000

ARBITRARY_M = 100.0
"""Length of a first line where no distance is measured."""


@dataclass(frozen=True)
class NetworkObservations:
    """Observations of one type between points, rows in points."""

    start: Int
    end: Int
    """(n,)."""
    value: Float
    """(n,), m or rad."""
    via: Int
    """(n,). Vertex of an angle."""
    set: Text
    """(n,) str. Of directions."""
    rise_m: Float
    """(n,), m. Target height less instrument height."""


Network = dict[str, NetworkObservations]
"""By type of geodetic.csv."""


def approximate_coordinates(network: Network, xyz_m: Float) -> tuple[Float, set[int]]:
    """Coordinates of a network, what is known left alone.

    Parameters
    ----------
    xyz_m : (n, 3) float64, m
        NaN where unknown.

    Returns
    -------
    (n, 3) float64, m
        NaN where nothing tells it.
    doubtful : set of int
        Points whose mirror image fits their observations about as well.
    """
    doubtful: set[int] = set()
    xyz = _by_differences(network, xyz_m)
    xyz[:, 2] = _heights(network, xyz)
    xyz[:, :2] = _plan(_with_horizontal(network, xyz), xyz[:, :2], doubtful)
    xyz[:, 2] = _above(network, xyz)
    return xyz, doubtful


def _above(network: Network, xyz: Float) -> Float:
    """Heights along the network; of points with slope distances alone as if they were above what is known."""
    z = _heights(network, xyz)
    m = network.get("distance")
    if m is None:
        return z
    plan = np.linalg.norm(xyz[m.end, :2] - xyz[m.start, :2], axis=1)
    rise = np.sqrt(np.maximum(m.value**2 - np.nan_to_num(plan) ** 2, 0.0))
    for ends in ((m.start, m.end), (m.end, m.start)):
        has_rise = np.isfinite(z[ends[0]]) & ~np.isfinite(z[ends[1]]) & np.isfinite(plan)
        for point in np.unique(ends[1][has_rise]):
            z[point] = np.mean((z[ends[0]] + rise)[has_rise & (ends[1] == point)])
    return z


def _by_differences(network: Network, xyz: Float) -> Float:
    """Coordinates along coordinate differences."""
    values = xyz.copy()
    for axis, name in enumerate(("dX", "dY", "dZ")):
        if name in network:
            m = network[name]
            values[:, axis] = _along(values[:, axis], m.start, m.end, m.value)
    return values


def _along(values: Float, start: Int, end: Int, difference: Float) -> Float:
    """Values known from others by differences, repeated while anything is found; the first is 0 if none is known."""
    filled = values.copy()
    if len(start) and not np.isfinite(filled[np.r_[start, end]]).any():
        filled[start[0]] = 0.0
    while True:
        forward = np.isfinite(filled[start]) & ~np.isfinite(filled[end]) & np.isfinite(difference)
        back = ~np.isfinite(filled[start]) & np.isfinite(filled[end]) & np.isfinite(difference)
        if not forward.any() and not back.any():
            return filled
        filled[end[forward]] = filled[start[forward]] + difference[forward]
        filled[start[back]] = filled[end[back]] - difference[back]


def _heights(network: Network, xyz: Float) -> Float:
    """Heights along height differences, and zenith angles where the length of the line is known."""
    parts = [(m.start, m.end, m.value - m.rise_m) for m in [network.get("height_difference")] if m is not None]
    slope = _both_ways(network.get("distance"))
    if "zenith" in network:
        m = network["zenith"]
        plan = np.linalg.norm(xyz[m.end, :2] - xyz[m.start, :2], axis=1)
        length = np.array([slope.get((int(a), int(b)), np.nan) for a, b in zip(m.start, m.end)])
        rise = np.where(np.isfinite(length), length * np.cos(m.value), plan / np.tan(m.value))
        parts.append((m.start, m.end, rise - m.rise_m))
    if not parts:
        return xyz[:, 2]
    start, end, difference = (np.concatenate(part) for part in zip(*parts))
    return _along(xyz[:, 2], start, end, difference)


def _both_ways(m: NetworkObservations | None, turned: float = 0.0) -> dict[tuple[int, int], float]:
    """Values by their ends, there and back; back they are larger by `turned`."""
    there = {} if m is None else {(int(a), int(b)): float(v) for a, b, v in zip(m.start, m.end, m.value)}
    return {**{(b, a): v + turned for (a, b), v in there.items()}, **there}


def _with_horizontal(network: Network, xyz: Float) -> Network:
    """The network with slope distances reduced by zenith angles or heights."""
    if "distance" not in network:
        return network
    m = network["distance"]
    angles = _both_ways(network.get("zenith"))
    z = np.array([angles.get((int(a), int(b)), np.nan) for a, b in zip(m.start, m.end)])
    rise = np.nan_to_num(xyz[m.end, 2] - xyz[m.start, 2])
    by_height = np.sqrt(np.maximum(m.value**2 - rise**2, 0.0))
    plan = replace(m, value=np.where(np.isfinite(z), m.value * np.sin(np.nan_to_num(z)), by_height))
    other = network.get("horizontal_distance")
    if other is not None:
        joined = {k: np.concatenate([getattr(plan, k), getattr(other, k)]) for k in plan.__dataclass_fields__}
        plan = NetworkObservations(**joined)
    return {**network, "horizontal_distance": plan}


def _plan(network: Network, xy: Float, doubtful: set[int]) -> Float:
    """Places in plan."""
    placed = _grown(network, xy, doubtful)
    for _ in range(len(xy)):
        seed = next(_seeds(network, placed), None)
        if seed is None:
            break
        own = np.full_like(xy, np.nan)
        (a, b), length = seed
        own[a], own[b] = 0.0, (0.0, length)
        own = _grown(network, own, doubtful)
        laid = _laid(own, placed, "horizontal_distance" in network)
        if laid is None:
            if np.isfinite(placed).any():
                break
            return own
        placed = _grown(network, np.where(np.isfinite(placed), placed, laid), doubtful)
    return placed


def _seeds(network: Network, placed: Float) -> Iterator[tuple[tuple[int, int], float]]:
    """Measured distances with an end that is unknown; without any, lines of an arbitrary length."""
    if "horizontal_distance" not in network:
        for vertex, a, _, _ in _angles(network):
            if not (np.isfinite(placed[vertex]).all() and np.isfinite(placed[a]).all()):
                yield (vertex, a), ARBITRARY_M
    m = network.get("horizontal_distance")
    if m is not None:
        for a, b, value in zip(m.start.tolist(), m.end.tolist(), m.value.tolist()):
            if not (np.isfinite(placed[a]).all() and np.isfinite(placed[b]).all()):
                yield (a, b), value


def _laid(own: Float, placed: Float, sized: bool) -> Float | None:
    """A part in its own axes turned, shifted, and scaled if its size is arbitrary, onto its known points, if two."""
    both: Bool = np.asarray(np.isfinite(np.hstack([own, placed])).all(axis=1))
    if both.sum() < 2:
        return None
    p, q = (a[both] @ np.array([1, 1j]) for a in (own, placed))
    turn = ((q - q.mean()) * np.conj(p - p.mean())).sum()
    turn = turn / (abs(turn) if sized else (np.abs(p - p.mean()) ** 2).sum())
    z = (own @ np.array([1, 1j]) - p.mean()) * turn + q.mean()
    return np.column_stack([z.real, z.imag])


def _grown(network: Network, xy: Float, doubtful: set[int]) -> Float:
    """Points found from those that are known: all that are sure, else the one that is surest, again and again."""
    placed = xy.copy()
    for _ in range(MOST_ROUNDS):
        fits = {point: fit for point, loci in _loci(network, placed).items() if (fit := fitting_point(loci))}
        if not fits:
            return placed
        surest = max(fits, key=lambda point: fits[point][1])
        if fits[surest][1] < CLEARLY_BETTER:
            doubtful.add(surest)
        for point, (place, clearness) in fits.items():
            if clearness >= CLEARLY_BETTER or point == surest:
                placed[point] = place
    return placed


def _loci(network: Network, xy: Float) -> dict[int, list[Locus]]:
    """Rays and circles on which the unknown points lie."""
    placed: Bool = np.asarray(np.isfinite(xy).all(axis=1))
    loci: dict[int, list[Locus]] = {}
    m = network.get("horizontal_distance")
    for a, b, value in [] if m is None else zip(m.start.tolist(), m.end.tolist(), m.value.tolist()):
        for p, q in ((a, b), (b, a)):
            if placed[p] and not placed[q]:
                loci.setdefault(q, []).append(Locus.circle(xy[p], value))
    for station, target, bearing in _bearings(network, xy, placed):
        if placed[station] and not placed[target]:
            loci.setdefault(target, []).append(Locus.ray(xy[station], bearing))
        if placed[target] and not placed[station]:
            loci.setdefault(station, []).append(Locus.ray(xy[target], bearing + np.pi))
    for vertex, a, b, angle in _angles(network):
        if not placed[vertex] and placed[a] and placed[b]:
            loci.setdefault(vertex, []).append(Locus.seeing(xy[a], xy[b], angle))
    return loci


def _bearings(network: Network, xy: Float, placed: Bool) -> Iterator[tuple[int, int, float]]:
    """Bearings from azimuths, oriented sets and angles with one known side."""
    if "azimuth" in network:
        m = network["azimuth"]
        yield from zip(m.start.tolist(), m.end.tolist(), m.value.tolist())
    oriented = _both_ways(network.get("azimuth"), np.pi)

    def side(station: int, target: int) -> float | None:
        if placed[station] and placed[target]:
            return float(np.arctan2(*(xy[target] - xy[station])))
        return oriented.get((station, target))

    for vertex, a, b, angle in _angles(network):
        first, second = side(vertex, a), side(vertex, b)
        if first is not None and second is None:
            yield vertex, b, first + angle
        if second is not None and first is None:
            yield vertex, a, second - angle


def _angles(network: Network) -> Iterator[tuple[int, int, int, float]]:
    """Angles as measured, and those between each two directions of a set: vertex, from, to, clockwise."""
    if "angle" in network:
        m = network["angle"]
        yield from zip(m.via.tolist(), m.start.tolist(), m.end.tolist(), m.value.tolist())
    if "direction" in network:
        m = network["direction"]
        for name in dict.fromkeys(m.set.tolist()):
            rows = np.flatnonzero(m.set == name)
            for i in rows.tolist():
                for j in rows.tolist():
                    if i < j:
                        yield int(m.start[i]), int(m.end[i]), int(m.end[j]), float(m.value[j] - m.value[i])
