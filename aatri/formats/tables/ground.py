"""ground_points.csv as a table: metres, right-handed axes of the first frame, a role per coordinate.

Portable frames: rows of ground_points.csv in a further local frame are marks of a body, measured once in its axes.

Nothing relates such a frame to the first one, so that its coordinates are not those of points on the ground. What they
say is the shape and size of a body: distances between its marks with their covariances, and of marks in one plane that
they lie in it (`orientation.network.portable_frame`). Each frame is a body of its own.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.block import APPROXIMATE, CHECK, CONTROL, NO_ROLE
from aatri.errors import GeometryError
from aatri.formats.limits import SAME_PLACE_SIGMAS
from aatri.formats.tables.columns import COORDINATES, GROUND_POINTS, SIGMAS
from aatri.formats.tables.covariances import check_places, ground_point_covariances, with_own_covariances
from aatri.formats.tables.positions import (
    ask_for_sigma,
    covariance_m2,
    frames_of,
    in_own_order,
    positions,
    stacked,
    warn_of_unusual,
)
from aatri.formats.tables.relative_control import Condition
from aatri.formats.tables.source import FILES, Source, no_repeats, not_negative
from aatri.formats.text.csv_table import CsvTable
from aatri.geometry.limits import MIN_CONTROL
from aatri.geometry.portable_frame import BodyDistances, body_distances
from aatri.ids import clipped, did_you_mean

ROLES = {"control": CONTROL, "check": CHECK, "approximate": APPROXIMATE, "ignore": NO_ROLE}


def ground_point_columns(
    source: Source, table: CsvTable | None, covariances: CsvTable | None = None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """ground_points.csv, and the covariances between its rows; nothing where there are faults, which are kept."""
    if table is None:
        return {}, {}
    no_repeats(table, ["point"], "ground point")
    check_places(covariances, table)
    table = with_own_covariances(table, covariances)
    frame = frames_of(source, table)
    role = _roles(table)
    xyz = stacked(table, COORDINATES)
    role[np.isnan(xyz)] = NO_ROLE
    for name in SIGMAS:
        not_negative(table, name, zero=True)
    needs = role == CONTROL
    default = source.settings.sigma.control
    sigma = stacked(table, SIGMAS)
    _refuse_all_approximate(source, table, role, sigma)
    if default is None:
        ask_for_sigma(source, table, needs & np.isnan(sigma), "control", "ground")
    needs_sigma = needs | (role == CHECK)
    sigma = np.where(np.isnan(sigma), np.where(needs_sigma, default, 0.0) if default else 0.0, sigma)
    if source.problems:
        return {}, {}
    warn_of_unusual(source, table, sigma)
    xyz, covariance, by_own = positions(source, table, frame, xyz, covariance_m2(source, table, sigma))
    columns = source.columns(table, GROUND_POINTS)
    columns |= {"xyz_m": xyz, "covariance_m2": covariance, "role": in_own_order(source, frame, role)}
    _warn_of_same_place(source, table, columns)
    return columns, ground_point_covariances(source, table, covariances, frame, xyz, covariance, by_own)


def _refuse_all_approximate(source: Source, table: CsvTable, role: Int, sigma: Float) -> None:
    """Standard deviations of control, but no point is control: the roles are wrong, or the block loses its datum."""
    if np.isin(role, (CONTROL, CHECK)).any() or not (role == APPROXIMATE).any() or any(table.text["datum"]):
        return
    in_rows = bool(np.isfinite(sigma).any())
    only_control = len(table) >= MIN_CONTROL and not (source.folder / "exterior.csv").exists()
    if in_rows or (only_control and source.settings.sigma.control is not None):
        place = "its rows have" if in_rows else "sigma.control in block.yaml gives"
        what = f"no ground point is control or check, all are approximate, but {place} standard deviations of control"
        source.problems.add(
            what,
            table.where(0, "role"),
            "write role control; or leave out the standard deviations, if these are start values only",
        )


def _warn_of_same_place(source: Source, table: CsvTable, columns: Mapping[str, Any]) -> None:
    """Point out control points of two ids at one place; those of equal coordinates are counted once later."""
    full = np.flatnonzero((columns["role"] == CONTROL).all(axis=1))
    xyz_m = columns["xyz_m"]
    if len(full) < 2:
        return
    from scipy.spatial import cKDTree  # slow to import

    sigma = np.sqrt(np.trace(columns["covariance_m2"][full], axis1=1, axis2=2))
    near = cKDTree(xyz_m[full]).query_pairs(SAME_PLACE_SIGMAS * float(sigma.max()))
    for a, b in sorted(near):
        gap = float(np.linalg.norm(xyz_m[full[a]] - xyz_m[full[b]]))
        if 0 < gap <= SAME_PLACE_SIGMAS * float(np.hypot(sigma[a], sigma[b])):
            names = [clipped(table.text["point"][full[k]]) for k in (a, b)]
            where = table.where(int(full[b]))
            source.reporter.warn(f"{where}: control points {names[0]} and {names[1]} are {gap:.3g} m apart: one place?")


def _roles(table: CsvTable) -> Int:
    """(n, 3) role per X, Y, Z of the table, from `control`, `XY:control Z:check` and so on."""
    roles: dict[str, list[int]] = {}
    for cell in set(table.text["role"]):
        try:
            roles[cell] = _role_of(cell)
        except ValueError as error:
            rows = [k for k, text in enumerate(table.text["role"]) if text == cell]
            remedy = "write control, check, approximate or ignore, or per coordinate XY:control Z:check"
            table.complain(rows, "role", f"role is {{}}: {error}", remedy)
            roles[cell] = [NO_ROLE] * 3
    return np.array([roles[cell] for cell in table.text["role"]], dtype=np.int32).reshape(-1, 3)


def _role_of(cell: str) -> list[int]:
    if not cell:
        return [CONTROL] * 3
    if ":" not in cell:
        return [_role_named(cell)] * 3
    roles: list[int] = [NO_ROLE] * 3
    seen = ""
    for part in cell.split():
        axes, _, name = part.partition(":")
        for axis in axes:
            if axis not in "XYZ" or axis in seen:
                raise ValueError(f"{axes!r} does not name coordinates once each")
            roles["XYZ".index(axis)] = _role_named(name)
            seen += axis
    return roles


def _role_named(name: str) -> int:
    if name not in ROLES:
        raise ValueError(f"unknown role {name!r}{did_you_mean(name, ROLES)}")
    return ROLES[name]


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
