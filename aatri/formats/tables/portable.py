"""Portable frames: rows of ground_points.csv in a further local frame are marks of a body, measured once in its axes.

Nothing relates such a frame to the first one, so that its coordinates are not those of points on the ground. What they
say is the shape and size of a body: distances between its marks with their covariances, and of marks in one plane that
they lie in it (`orientation.network.portable_frame`). Each frame is a body of its own.
"""

from typing import Any, NamedTuple

import numpy as np

from aatri.arrays import Int
from aatri.errors import GeometryError
from aatri.formats.tables.columns import COORDINATES, SIGMAS
from aatri.formats.tables.positions import covariance_m2, frames_of, stacked
from aatri.formats.tables.relative_control import Condition
from aatri.formats.tables.source import FILES, Source, no_repeats
from aatri.formats.text.csv_table import CsvTable
from aatri.geometry.portable_frame import BodyDistances, body_distances


class Bodies(NamedTuple):
    """What portable frames say: columns of distances with their covariances, and planes."""

    distances: dict[str, Any]
    covariances: dict[str, Any]
    planes: tuple[Condition, ...]


def without_bodies(source: Source, table: CsvTable | None) -> tuple[CsvTable | None, Bodies]:
    """The other rows of ground_points.csv, and what its portable frames say."""
    frames = list(source.settings.frames.items())
    no_bodies = Bodies({}, {}, ())
    if table is None or not any(f.crs == "local" for _, f in frames[1:]):
        return table, no_bodies
    frame_of_row = frames_of(source, table)
    local = [k for k, (_, f) in enumerate(frames) if f.crs == "local" and k not in (0, source.default_frame)]
    read = [_body(source, table, np.flatnonzero(frame_of_row == k), frames[k][0]) for k in local if k in frame_of_row]
    bodies = no_bodies
    for body in read:
        bodies = bodies if body is None else joined(bodies, body)
    return table.taken(np.flatnonzero(~np.isin(frame_of_row, local)).tolist()), bodies


def joined(first: Bodies, more: Bodies) -> Bodies:
    """Observations and covariances one after the other."""
    n = len(first.distances.get("value", ()))
    shifted = {name: np.asarray(rows) + (n if name != "value" else 0) for name, rows in more.covariances.items()}
    return Bodies(
        _after(first.distances, more.distances), _after(first.covariances, shifted), (*first.planes, *more.planes)
    )


def _after(first: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    if not first or not more:
        return first or more
    n, m = len(first["value"]), len(more["value"])  # what all rows share is one value
    return {name: np.concatenate([np.broadcast_to(first[name], n), np.broadcast_to(more[name], m)]) for name in first}


def _body(source: Source, table: CsvTable, rows: Int, name: str) -> Bodies | None:
    """What a frame says; None where it has faults, which are kept."""
    before, marks = len(source.problems), table.taken(rows.tolist())
    no_repeats(marks, ["point"], f"mark of frame {name}")
    other = [int(k) for k in rows if table.text["role"][k] not in ("", "control")]
    table.complain(
        other,
        "role",
        f"role is {{}} in frame {name}, which is local: its points are marks of a body",
        "leave the role empty; or declare how the frame lies (crs)",
    )
    xyz = stacked(marks, COORDINATES)
    lacking = rows[~np.isfinite(xyz).all(axis=1)]
    table.complain(lacking, "X", f"a mark of frame {name} lacks a coordinate", "give X, Y and Z")
    sigma, default = stacked(marks, SIGMAS), source.settings.sigma.control
    sigma = np.where(np.isnan(sigma), default or np.nan, sigma)
    table.complain(
        rows[~(sigma > 0).all(axis=1)],
        "sX",
        f"a mark of frame {name} has no standard deviation above 0",
        "give sX, sY, sZ, or sigma.control in block.yaml",
    )
    if len(source.problems) > before:
        return None
    n = len(rows)
    C = np.zeros((n, 3, n, 3))
    C[np.arange(n), :, np.arange(n), :] = covariance_m2(source, marks, sigma)
    try:
        body = body_distances(xyz * source.settings.units.ground_m, C.reshape(3 * n, 3 * n))
    except (GeometryError, np.linalg.LinAlgError) as error:
        what = error.what if isinstance(error, GeometryError) else "covariances are not positive definite"
        what = f"frame {name}, a body of {n} marks: {what}"
        source.problems.add(what, marks.where(0), "measure other marks, or leave it out")
        return None
    source.reporter.log(f"frame {name} is local: a body of {n} marks, given by {len(body.pairs)} distances")
    i, j = np.triu_indices(len(body.pairs), 1)
    plane = _plane(marks, body)
    return Bodies(
        _distances(marks, body),
        {"row_a": i, "row_b": j, "value": body.covariance_m2[i, j]},
        () if plane is None else (plane,),
    )


def _distances(marks: CsvTable, body: BodyDistances) -> dict[str, Any]:
    """Columns of geodetic observations."""
    a, b = body.pairs.T
    ids, n = np.asarray(marks.text["point"], dtype=np.str_), len(a)
    alike = {
        "type": "distance",
        "start_kind": "point",
        "end_kind": "point",
        "via": "",
        "set": "",
        "group": "",
        "reduced": "no",
        "start_height_m": np.nan,
        "end_height_m": np.nan,
        "active": True,
        "file": FILES.index("ground_points.csv"),
    }
    return {name: np.full(n, value) for name, value in alike.items()} | {
        "start": ids[a],
        "end": ids[b],
        "value": body.length_m,
        "sigma": np.sqrt(np.diagonal(body.covariance_m2)),
        "line": marks.line[a],
    }


def _plane(marks: CsvTable, body: BodyDistances) -> Condition | None:
    if not np.isfinite(body.plane_sigma_m):
        return None
    members = tuple(("points", name) for name in marks.text["point"])
    return Condition("plane", "", members, float("nan"), body.plane_sigma_m, -1)
