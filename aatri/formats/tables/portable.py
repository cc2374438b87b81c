"""Portable frames: rows of ground_points.csv in a further local frame are marks of a body, measured once in its axes.

Nothing relates such a frame to the first one, so that its coordinates are not those of points on the ground. What they
say is the shape and size of a body: distances between its marks with their covariances, and of marks in one plane that
they lie in it (`orientation.network.portable_frame`). Each frame is a body of its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.block import Geodetic, GeodeticCovariances
from aatri.errors import GeometryError, InputError
from aatri.formats.tables.geodetic import GeodeticTables, geodetic_order
from aatri.formats.tables.positions import COORDINATES, SIGMAS, covariance_m2, frames_of, stacked
from aatri.formats.tables.relative_control import Condition
from aatri.formats.tables.source import Source, no_repeats, texts
from aatri.formats.text.csv_table import CsvTable
from aatri.geometry.portable_frame import BodyDistances, body_distances


class Bodies(NamedTuple):
    """What portable frames say: distances with their covariances, by their rows, and planes."""

    distances: Geodetic
    covariances: tuple[tuple[int, Float], ...]
    planes: tuple[Condition, ...]


def without_bodies(source: Source, table: CsvTable | None) -> tuple[CsvTable | None, Bodies]:
    """The other rows of ground_points.csv, and what its portable frames say."""
    frames = list(source.settings.frames.items())
    nothing = Bodies(Geodetic.empty(), (), ())
    if table is None or not any(f.crs == "local" for _, f in frames[1:]):
        return table, nothing
    of = frames_of(source, table)
    local = [k for k, (_, f) in enumerate(frames) if f.crs == "local" and k not in (0, source.default_frame)]
    found = [_body(source, table, np.flatnonzero(of == k), frames[k][0]) for k in local if (of == k).any()]
    made = [one for one in found if one is not None]
    rest = table.taken(np.flatnonzero(~np.isin(of, local)).tolist())
    if not made:
        return rest, nothing
    first = np.cumsum([0, *(len(rows) for rows, _, _ in made)])
    names = Geodetic.__dataclass_fields__
    rows = Geodetic(**{n: np.concatenate([getattr(rows, n) for rows, _, _ in made]) for n in names})
    covariances = tuple((int(k), c) for k, (_, c, _) in zip(first, made))
    return rest, Bodies(rows, covariances, tuple(plane for _, _, plane in made if plane is not None))


def _body(source: Source, table: CsvTable, rows: Int, name: str) -> tuple[Geodetic, Float, Condition | None] | None:
    """Distances of a frame with their covariance, and its plane; None where it has faults, which are kept."""
    before, marks = len(source.problems), table.taken(rows.tolist())
    no_repeats(marks, ["point"], f"mark of frame {name}")
    other = [int(k) for k in rows if table.text["role"][k] not in ("", "control")]
    table.complain(other, "role", f"role is {{}} in frame {name}, which is local: its points are marks of a body",
                   "leave the role empty; or declare how the frame lies (crs)")  # fmt: skip
    xyz = stacked(marks, COORDINATES)
    lacking = rows[~np.isfinite(xyz).all(axis=1)]
    table.complain(lacking, "X", f"a mark of frame {name} lacks a coordinate", "give X, Y and Z")
    sigma, default = stacked(marks, SIGMAS), source.settings.sigma.control
    sigma = np.where(np.isnan(sigma), default or np.nan, sigma)
    table.complain(rows[~(sigma > 0).all(axis=1)], "sX", f"a mark of frame {name} has no standard deviation above 0",
                   "give sX, sY, sZ, or sigma.control in block.yaml")  # fmt: skip
    if len(source.problems) > before:
        return None
    n = len(rows)
    C = np.zeros((n, 3, n, 3))
    C[np.arange(n), :, np.arange(n), :] = covariance_m2(source, marks, sigma)
    try:
        found = body_distances(xyz * source.settings.units.ground_m, C.reshape(3 * n, 3 * n))
    except (GeometryError, np.linalg.LinAlgError) as error:
        what = error.what if isinstance(error, GeometryError) else "covariances are not positive definite"
        what = f"frame {name}, a body of {n} marks: {what}"
        source.problems.append(InputError(what, where=marks.where(0), remedy="measure other marks, or leave it out"))
        return None
    source.reporter.log(f"frame {name} is local: a body of {n} marks, given by {len(found.pairs)} distances")
    return _distances(source, marks, found), found.covariance_m2, _plane(marks, found)


def _distances(source: Source, marks: CsvTable, found: BodyDistances) -> Geodetic:
    a, b = found.pairs.T
    n, none = len(a), texts([""] * len(a))
    ids = np.asarray(marks.text["point"], dtype=np.str_)
    unknown = np.full(n, np.nan)
    return Geodetic(
        type=texts(["distance"] * n), start=texts(ids[a]), end=texts(ids[b]), via=none,
        start_kind=texts(["point"] * n), end_kind=texts(["point"] * n), value=found.length_m,
        sigma=np.sqrt(np.diagonal(found.covariance_m2)), set=none, group=none, start_height_m=unknown,
        end_height_m=unknown, active=np.ones(n, dtype=bool), reduced=texts(["no"] * n),
        file=source.file("ground_points.csv", n), line=marks.line[a],
    )  # fmt: skip


def _plane(marks: CsvTable, found: BodyDistances) -> Condition | None:
    if not np.isfinite(found.plane_sigma_m):
        return None
    members = tuple(("points", name) for name in marks.text["point"])
    return Condition("plane", "", members, float("nan"), found.plane_sigma_m, -1)


def with_bodies(tables: GeodeticTables, bodies: Bodies) -> GeodeticTables:
    """Geodetic observations with the distances of portable frames, in canonical order."""
    if not len(bodies.distances):
        return tables
    old, n = tables.geodetic, len(tables.geodetic)
    names = Geodetic.__dataclass_fields__
    rows = Geodetic(**{k: np.concatenate([getattr(old, k), getattr(bodies.distances, k)]) for k in names})
    pairs, values = [np.column_stack([tables.covariances.row_a, tables.covariances.row_b])], [tables.covariances.value]
    for first, covariance in bodies.covariances:
        a, b = np.triu_indices(len(covariance), 1)
        pairs.append(np.column_stack([a, b]) + n + first)
        values.append(covariance[a, b])
    order = geodetic_order(rows)
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.arange(len(order))
    both, value = np.sort(place[np.concatenate(pairs)], axis=1), np.concatenate(values)
    sorted_ = np.lexsort((both[:, 1], both[:, 0]))
    both = both[sorted_].astype(np.int32)
    covariances = GeodeticCovariances(row_a=both[:, 0], row_b=both[:, 1], value=value[sorted_])
    return tables._replace(geodetic=rows.take(order), covariances=covariances)
