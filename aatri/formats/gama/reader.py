"""A network of GNU Gama as a Block without images: east, north, up; metres and radians; angles clockwise.

gama's `distance` is a horizontal distance, `s-distance` a slope distance. Fixed coordinates are exact control, observed
ones (`coordinates`) control with their full covariance, others approximate values. A point adjusted in capitals carries
the datum of a free network: `datum: free, datum_over: marked` of the bundle. gama's a posteriori m0 is `sigma-apr`
times the sigma0 of a bundle.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from aatri.artifacts.block import APPROXIMATE, CONTROL, NO_ROLE, Block, Frames
from aatri.artifacts.builder import Columns, block_of
from aatri.errors import InputError
from aatri.formats.gama.elements import GivenPoint, Network, Row
from aatri.ids import canonical, clipped, shown
from aatri.progress import SILENT, Reporter

Axes = dict[str, tuple[int, float]]
"""Of x, y, z: number of the axis of the Block, and its sign."""

Place = tuple[int, int]

AXES = {"e": (0, 1.0), "w": (0, -1.0), "n": (1, 1.0), "s": (1, -1.0), "u": (2, 1.0)}
"""Of a letter of `axes-xy`: number of the axis of the Block, and its sign."""


def read_gama(path: Path, reporter: Reporter = SILENT) -> Block:
    """Read a network."""
    network = Network(path)
    axes = _axes(network.axes, path)
    points = _points(network, path)
    points |= _without_element(network.rows, points, path, reporter)
    if any(p.datum for p in points.values()):
        reporter.log("points in capitals carry the datum of a free network: `datum: free, datum_over: marked`")
    ids = canonical(points)
    # of each observation, how it counts along the axes of the Block
    sign = [axes[row.type[1]][1] if row.type in ("dx", "dy", "dz") else 1.0 for row in network.rows]
    of_rows = [(i, j, sign[i] * sign[j] * value) for i, j, value in network.covariances if i != j and value]
    pairs = [(*a, *b, value) for a, b, value in _observed_covariances(network, axes, ids) if a[0] != b[0] and value]
    return block_of(
        name=path.stem,
        files=[path],
        points=ids,
        ground_points=_ground(network, points, ids, axes),
        ground_point_covariances=dict(zip(("row_a", "axis_a", "row_b", "axis_b", "value"), zip(*pairs))) or None,
        geodetic=_geodetic(network, axes, sign),
        geodetic_covariances=dict(zip(("row_a", "row_b", "value"), zip(*of_rows))) or None,
        frames=Frames.of(id="local", axes="east,north,up", crs="local", vertical=""),
    )


def _axes(letters: str, path: Path) -> Axes:
    place_of = {axis: AXES.get(letter) for axis, letter in zip("xyz", letters.strip() + "u")}
    if len(letters.strip()) != 2 or None in place_of.values() or len({a[0] for a in place_of.values() if a}) != 3:
        raise InputError(
            f"axes-xy is {clipped(letters)!r}", where=str(path), remedy="two of n, s, e, w across each other"
        )
    return {axis: place for axis, place in place_of.items() if place is not None}


def _points(network: Network, path: Path) -> dict[str, GivenPoint]:
    """The points, each once; those of observations alone without coordinates."""
    points: dict[str, GivenPoint] = {}
    for p in network.points:
        if p.id in points:
            raise InputError(f"point {clipped(p.id)!r} is given twice", where=f"{path}:{p.line}", remedy="remove one")
        points[p.id] = p
    return points


def _without_element(
    rows: list[Row], points: dict[str, GivenPoint], path: Path, reporter: Reporter
) -> dict[str, GivenPoint]:
    """Points that observations name and no <point> does: new ones without coordinates, by warning."""
    new: dict[str, GivenPoint] = {}
    for row in rows:
        for name in (row.start, row.end, row.via):
            if name and name not in points and name not in new:
                new[name] = GivenPoint(name, {}, "", "", row.line)
    if new:
        first = min(p.line for p in new.values())
        reporter.warn(
            f"{path}:{first}: no <point>, taken as new ones without coordinates ({len(new)}): {shown(list(new))}"
        )
    return new


def _ground(network: Network, points: dict[str, GivenPoint], ids: list[str], axes: Axes) -> Columns:
    """Given coordinates; those of one point with their own covariance."""
    n = len(ids)
    xyz, role = np.full((n, 3), np.nan), np.full((n, 3), NO_ROLE, dtype=np.int32)
    covariance = np.zeros((n, 3, 3))
    observed = {(name, letter) for name, letter, _ in network.coordinates}
    for k, name in enumerate(ids):
        p = points[name]
        for letter, value in p.xyz.items():
            axis, sign = axes[letter]
            xyz[k, axis] = sign * value
            role[k, axis] = CONTROL if letter in p.fixed or (name, letter) in observed else APPROXIMATE
    for (a, i), (b, j), value in _observed_covariances(network, axes, ids):
        if a == b:
            covariance[a, i, j] = covariance[a, j, i] = value
    return {
        "point": ids,
        "xyz_m": xyz,
        "covariance_m2": covariance,
        "role": role,
        "datum": [bool(points[name].datum) for name in ids],
        "line": [points[name].line for name in ids],
    }


def _observed_covariances(network: Network, axes: Axes, ids: list[str]) -> Iterator[tuple[Place, Place, float]]:
    """Covariances of observed coordinates, by row in ids and axis of the Block."""
    row = dict(zip(ids, range(len(ids))))
    for i, j, value in network.coordinate_covariance:
        (a, of_a, _), (b, of_b, _) = network.coordinates[i], network.coordinates[j]
        (s, sign_a), (t, sign_b) = axes[of_a], axes[of_b]
        yield (row[a], s), (row[b], t), sign_a * sign_b * value


def _geodetic(network: Network, axes: Axes, sign: list[float]) -> Columns:
    """Observations in the axes of the Block."""
    rows = network.rows
    variance = {i: value for i, j, value in network.covariances if i == j}
    return {
        "type": ["d" + "XYZ"[axes[r.type[1]][0]] if r.type in ("dx", "dy", "dz") else r.type for r in rows],
        "start": [r.start for r in rows],
        "end": [r.end for r in rows],
        "via": [r.via for r in rows],
        "value": [s * r.value for s, r in zip(sign, rows)],
        "set": [r.set for r in rows],
        "sigma": [np.sqrt(variance.get(k, r.sigma**2)) for k, r in enumerate(rows)],
        "start_height_m": [r.start_height_m for r in rows],
        "end_height_m": [r.end_height_m for r in rows],
        "line": [r.line for r in rows],
    }
