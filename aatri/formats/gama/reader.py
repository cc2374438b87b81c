"""A network of GNU Gama as a Block without images: east, north, up; metres and radians; angles clockwise.

gama's `distance` is a horizontal distance, `s-distance` a slope distance. Fixed coordinates are exact control, observed
ones (`coordinates`) control with their full covariance, others approximate values. A point adjusted in capitals carries
the datum of a free network: `datum: free, datum_over: marked` of the bundle. gama's a posteriori m0 is `sigma-apr`
times the sigma0 of a bundle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from aatri.artifacts.block import (
    APPROXIMATE,
    CONTROL,
    NO_ROLE,
    Block,
    Geodetic,
    GeodeticCovariances,
    GroundPointCovariances,
)
from aatri.artifacts.block import Frames as FrameTable
from aatri.errors import InputError
from aatri.formats.builder import Columns, block_of
from aatri.formats.gama.elements import read_network
from aatri.formats.gama.network import GivenPoint, Network, Row
from aatri.formats.screening import screen_block
from aatri.formats.tables.geodetic import geodetic_order, rejects_of, unusable
from aatri.formats.tables.source import texts
from aatri.ids import canonical, clipped, shown
from aatri.progress import SILENT, Reporter

Axes = dict[str, tuple[int, float]]
"""Of x, y, z: number of the axis of the Block, and its sign."""

Place = tuple[int, int]

AXES = {"e": (0, 1.0), "w": (0, -1.0), "n": (1, 1.0), "s": (1, -1.0), "u": (2, 1.0)}
"""Of a letter of `axes-xy`: number of the axis of the Block, and its sign."""


def read_gama(path: Path, reporter: Reporter = SILENT) -> Block:
    """Read a network.

    Raises
    ------
    InputError
        If the file is no network of gama-local.
    """
    network = read_network(path)
    axes = _axes(network.axes, path)
    points = _points(network, path)
    points |= _without_element(network.rows, points, path, reporter)
    ids = canonical(points)
    ground = _ground(network, points, ids, axes)
    rows, covariances = _geodetic(network, axes)
    reasons = unusable(rows)
    if any(p.datum for p in points.values()):
        reporter.log("points in capitals carry the datum of a free network: `datum: free, datum_over: marked`")
    block = block_of(
        name=path.stem, files=[path], cameras={}, images={}, image_points={}, points=ids, ground_points=ground,
        ground_point_covariances=_between_points(network, axes, ids),
        geodetic=replace(rows, active=np.array([not reason for reason in reasons], dtype=bool)),
        geodetic_covariances=covariances, rejects=rejects_of(rows, reasons),
        frames=FrameTable(id=texts(["local"]), axes=texts(["east,north,up"]), crs=texts(["local"]),
                          vertical=texts([""])),
    )  # fmt: skip
    return screen_block(block, reporter, 0.0)


def _axes(letters: str, path: Path) -> Axes:
    found = {axis: AXES.get(letter) for axis, letter in zip("xyz", letters.strip() + "u")}
    if len(letters.strip()) != 2 or None in found.values() or len({a[0] for a in found.values() if a}) != 3:
        raise InputError(
            f"axes-xy is {clipped(letters)!r}", where=str(path), remedy="two of n, s, e, w across each other"
        )
    return {axis: place for axis, place in found.items() if place is not None}


def _points(network: Network, path: Path) -> dict[str, GivenPoint]:
    """The points, each once; those of observations alone without coordinates."""
    found: dict[str, GivenPoint] = {}
    for p in network.points:
        if p.id in found:
            raise InputError(f"point {clipped(p.id)!r} is given twice", where=f"{path}:{p.line}", remedy="remove one")
        found[p.id] = p
    return found


def _without_element(
    rows: list[Row], points: dict[str, GivenPoint], path: Path, reporter: Reporter
) -> dict[str, GivenPoint]:
    """Points that observations name and no <point> does: new ones without coordinates, by warning."""
    found: dict[str, GivenPoint] = {}
    for row in rows:
        for name in (row.start, row.end, row.via):
            if name and name not in points and name not in found:
                found[name] = GivenPoint(name, {}, "", "", row.line)
    if found:
        first = min(p.line for p in found.values())
        reporter.warn(f"{path}:{first}: {len(found)} points have no <point>, and are taken as new ones without "
                      f"coordinates: {shown(list(found))}")  # fmt: skip
    return found


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
        "point": ids, "xyz_m": xyz, "covariance_m2": covariance, "role": role,
        "datum": np.array([bool(points[name].datum) for name in ids]), "file": np.zeros(n, np.int32),
        "line": np.array([points[name].line for name in ids], np.int32),
    }  # fmt: skip


def _observed_covariances(network: Network, axes: Axes, ids: list[str]) -> Iterator[tuple[Place, Place, float]]:
    """Covariances of observed coordinates, by row in ids and axis of the Block."""
    row = dict(zip(ids, range(len(ids))))
    for i, j, value in network.coordinate_covariance:
        (a, of_a, _), (b, of_b, _) = network.coordinates[i], network.coordinates[j]
        (s, sign_a), (t, sign_b) = axes[of_a], axes[of_b]
        yield (row[a], s), (row[b], t), sign_a * sign_b * value


def _between_points(network: Network, axes: Axes, ids: list[str]) -> GroundPointCovariances:
    found = sorted((*sorted((a, b)), value) for a, b, value in _observed_covariances(network, axes, ids)
                   if a[0] != b[0] and value != 0)  # fmt: skip
    if not found:
        return GroundPointCovariances.empty()
    a, b, value = zip(*found)
    (row_a, axis_a), (row_b, axis_b) = np.array(a, np.int32).T, np.array(b, np.int32).T
    return GroundPointCovariances(row_a=row_a, axis_a=axis_a, row_b=row_b, axis_b=axis_b, value=np.array(value))


def _geodetic(network: Network, axes: Axes) -> tuple[Geodetic, GeodeticCovariances]:
    """Observations in canonical order, and the covariances between them."""
    rows, n = network.rows, len(network.rows)
    variance = {i: value for i, j, value in network.covariances if i == j}
    sigma = np.array([np.sqrt(variance.get(k, row.sigma**2)) for k, row in enumerate(rows)])
    sign = np.ones(n)
    types = [row.type for row in rows]
    for k, row in enumerate(rows):
        if row.type in ("dx", "dy", "dz"):
            axis, sign[k] = axes[row.type[1]]
            types[k] = "d" + "XYZ"[axis]
    table = Geodetic(
        type=texts(types), start=texts(row.start for row in rows), end=texts(row.end for row in rows),
        via=texts(row.via for row in rows), start_kind=texts(["point"] * n), end_kind=texts(["point"] * n),
        value=sign * np.array([row.value for row in rows]), sigma=sigma, set=texts(row.set for row in rows),
        group=texts([""] * n), start_height_m=np.array([row.start_height_m for row in rows]),
        end_height_m=np.array([row.end_height_m for row in rows]), active=np.ones(n, dtype=bool),
        reduced=texts(["no"] * n), file=np.zeros(n, np.int32), line=np.array([row.line for row in rows], np.int32),
    )  # fmt: skip
    order = geodetic_order(table)
    place = np.argsort(order)
    found = sorted((*sorted((int(place[i]), int(place[j]))), sign[i] * sign[j] * value)
                   for i, j, value in network.covariances if i != j and value != 0)  # fmt: skip
    if not found:
        return table.take(order), GeodeticCovariances.empty()
    a, b, value = zip(*found)
    return table.take(order), GeodeticCovariances(row_a=np.array(a, np.int32), row_b=np.array(b, np.int32),
                                                  value=np.array(value))  # fmt: skip
