"""ground_points.csv and exterior.csv as tables: metres, radians, right-handed axes of the first frame.

Coordinates and their standard deviations follow the axes of their frame (column `frame`, else the first one). sX, sY,
sZ are standard deviations; sXY, sXZ, sYZ covariances in the square of their unit. Angles always refer to the
right-handed axes of the first frame.

A covariance from another frame is rounded so that its variances are squares of standard deviations; a block written
out and read again is then the same to the bit. The change is one unit in the last place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from aatri.artifacts.block import (
    ANTENNA,
    APPROXIMATE,
    CHECK,
    CONTROL,
    NO_ROLE,
    PROJECTION_CENTRE,
    Exterior,
    GroundPoints,
    Points,
)
from aatri.errors import AatriError, InputError
from aatri.formats.block_images import ImageTables
from aatri.formats.block_source import Source, angles_rad, choice, look_up, no_repeats, not_negative, texts, yes_no
from aatri.formats.csv_table import Column, CsvTable
from aatri.frames.axes import columns_in_order, in_right_handed_order
from aatri.frames.conversion import Frame, convert
from aatri.ids import did_you_mean, rows_of

Float = npt.NDArray[np.float64]

ID, TEXT, NUMBER = Column("id", "cell"), Column("text"), Column("number")
COORDINATES, SIGMAS, COVARIANCES = ("X", "Y", "Z"), ("sX", "sY", "sZ"), {"sXY": (0, 1), "sXZ": (0, 2), "sYZ": (1, 2)}
_POSITION = dict.fromkeys((*SIGMAS, *COVARIANCES), NUMBER)

GROUND_POINTS = {
    "point": ID, "X": Column("number", "column"), "Y": Column("number", "column"), "Z": Column("number", "column"),
    **_POSITION, "role": TEXT, "datum": TEXT, "frame": TEXT,
}  # fmt: skip
EXTERIOR = {
    "image": ID, "X": NUMBER, "Y": NUMBER, "Z": NUMBER, **_POSITION, "a1": TEXT, "a2": TEXT, "a3": TEXT,
    "s1": NUMBER, "s2": NUMBER, "s3": NUMBER, "use": TEXT, "refers_to": TEXT, "frame": TEXT, "drift_group": TEXT,
}  # fmt: skip

ROLES = {"control": CONTROL, "check": CHECK, "approximate": APPROXIMATE, "ignore": NO_ROLE}


def read_ground_points(source: Source) -> CsvTable | None:
    """ground_points.csv as it stands."""
    return source.table("ground_points.csv", GROUND_POINTS)


def ground_point_table(source: Source, table: CsvTable | None, points: Points) -> GroundPoints:
    """Ground points sorted by id."""
    if table is None:
        return GroundPoints.empty()
    no_repeats(table, ["point"], "ground point")
    frame = _frames_of(source, table)
    role = _roles(table)
    xyz = _stacked(table, COORDINATES)
    role[np.isnan(xyz)] = NO_ROLE
    for name in SIGMAS:
        not_negative(table, name, zero=True)
    needs = role == CONTROL
    default = source.settings.sigma.control
    sigma = _stacked(table, SIGMAS)
    if default is None:
        _ask_for_sigma(source, table, needs & np.isnan(sigma), "control", "ground")
    sigma = np.where(np.isnan(sigma), np.where(needs, default, 0.0) if default else 0.0, sigma)
    if source.problems:
        return GroundPoints.empty()
    _unusual(source, table, sigma)
    xyz, covariance = _positions(source, table, frame, xyz, _covariance(source, table, sigma))
    rows = GroundPoints(
        point=rows_of(table.text["point"], points.id),
        xyz_m=xyz, covariance_m2=covariance, role=_own_order(source, frame, role),
        datum=yes_no(table, "datum", False),
        file=source.file("ground_points.csv", len(table)), line=table.line,
    )  # fmt: skip
    return rows.take(np.argsort(rows.point, kind="stable"))


def exterior_table(source: Source, images: ImageTables) -> Exterior:
    """Exterior orientation sorted by image."""
    table = source.table("exterior.csv", EXTERIOR)
    if table is None:
        return Exterior.empty()
    no_repeats(table, ["image"], "image")
    image = look_up(table, "image", images.row, "image", "add it to images.csv, or mend the id")
    use = choice(table, "use", ("", "observed", "approximate"), "")
    refers = choice(table, "refers_to", ("projection_centre", "antenna"), "projection_centre")
    frame = _frames_of(source, table)
    xyz, sigma = _stacked(table, COORDINATES), _stacked(table, SIGMAS)
    position_use = _use(source, table, use, xyz, sigma, "position")
    angles, angle_sigma, angle_use = _attitudes(source, table, use, frame)
    if source.problems:
        return Exterior.empty()
    default = source.settings.sigma.position
    if default is not None:
        sigma = np.where(np.isnan(sigma), default, sigma)
    sigma[(position_use == 0)[:, None] | np.isnan(xyz)] = np.nan
    xyz, covariance = _positions(source, table, frame, xyz, _covariance(source, table, sigma))
    rows = Exterior(
        image=image, position_m=xyz, position_covariance_m2=covariance, angles_rad=angles, angle_sigma_rad=angle_sigma,
        position_use=position_use, angle_use=angle_use,
        refers_to=np.where(np.array(refers) == "antenna", ANTENNA, PROJECTION_CENTRE).reshape(-1),
        drift_group=texts(table.text["drift_group"]), file=source.file("exterior.csv", len(table)), line=table.line,
    )  # fmt: skip
    return rows.take(np.argsort(rows.image, kind="stable"))


def _stacked(table: CsvTable, names: Sequence[str]) -> Float:
    return np.stack([table.number[name] for name in names], axis=1)


def _frames_of(source: Source, table: CsvTable) -> npt.NDArray[np.int32]:
    """Number of the frame of each row, in the order of block.yaml."""
    known = {name: k for k, name in enumerate(source.settings.frames)}
    rows = look_up(table, "frame", known, "frame", "add it to `frames` in block.yaml, or mend the name")
    return np.maximum(rows, 0)


def _own_order(source: Source, frame: npt.NDArray[np.int32], role: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """Roles per X, Y, Z of the table in the order of the right-handed axes."""
    axes = [f.axes for f in source.settings.frames.values()]
    order = np.array([columns_in_order(names) for names in axes])[frame]
    ordered: npt.NDArray[np.int32] = np.take_along_axis(role, order, axis=1)
    return ordered


def _roles(table: CsvTable) -> npt.NDArray[np.int32]:
    """(n, 3) role per X, Y, Z of the table, from `control`, `XY:control Z:check` and so on."""
    known: dict[str, list[int]] = {}
    for cell in set(table.text["role"]):
        try:
            known[cell] = _role_of(cell)
        except ValueError as error:
            rows = [k for k, text in enumerate(table.text["role"]) if text == cell]
            remedy = "write control, check, approximate or ignore, or per coordinate XY:control Z:check"
            table.complain(rows, "role", f"role is {{}}: {error}", remedy)
            known[cell] = [NO_ROLE] * 3
    return np.array([known[cell] for cell in table.text["role"]], dtype=np.int32).reshape(-1, 3)


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


def _ask_for_sigma(source: Source, table: CsvTable, lacking: npt.NDArray[np.bool_], key: str, unit: str) -> None:
    if lacking.any():
        row, axis = (int(k) for k in np.argwhere(lacking)[0])
        names = SIGMAS if unit == "ground" else ("s1", "s2", "s3")
        what = f"no standard deviation in {int(lacking.any(axis=1).sum())} rows, and no sigma.{key} in block.yaml"
        measure = "0 is exact" if key == "control" else "in units.sigma_" + unit
        source.problems.append(InputError(what, where=table.where(row, names[axis]),
                                          remedy=f"add sigma: {{{key}: [a, b, c]}}, {measure}"))  # fmt: skip


def _unusual(source: Source, table: CsvTable, sigma: Float) -> None:
    """Warn of standard deviations that look like a wrong unit."""
    metres = sigma * source.settings.units.sigma_ground_m
    odd = ((metres > 0) & (metres < 1e-4)) | (metres > 1e3)
    if odd.any():
        row, axis = (int(k) for k in np.argwhere(odd)[0])
        where = table.where(row, SIGMAS[axis])
        source.reporter.warn(f"{where}: {SIGMAS[axis]} is {metres[row, axis]:g} m; check units.sigma_ground")


def _covariance(source: Source, table: CsvTable, sigma: Float) -> Float:
    """(n, 3, 3) in m^2, in the order of the table; NaN where a standard deviation is."""
    factor = source.settings.units.sigma_ground_m
    s = sigma * factor
    covariance = np.zeros((len(table), 3, 3))
    for axis in range(3):
        covariance[:, axis, axis] = s[:, axis] * s[:, axis]
    for name, (i, j) in COVARIANCES.items():
        value = np.nan_to_num(table.number[name]) * (factor * factor)
        covariance[:, i, j] = covariance[:, j, i] = np.where(np.isnan(s[:, i] + s[:, j]), np.nan, value)
    bad = []
    for k in np.flatnonzero(np.any([np.nan_to_num(table.number[name]) != 0 for name in COVARIANCES], axis=0)):
        block = np.nan_to_num(covariance[k])
        if np.linalg.eigvalsh(block).min() < -1e-12 * np.trace(block):
            bad.append(int(k))
    if bad:
        column = next(name for name in COVARIANCES if name in table.header)
        table.complain(bad, column, "sX ... sYZ form no covariance matrix: it has a negative eigenvalue",
                       "sXY, sXZ, sYZ are covariances, not standard deviations or correlations")  # fmt: skip
    undefined = np.isnan(s)
    covariance[undefined[:, :, None] | undefined[:, None, :]] = np.nan
    return covariance


def _positions(source: Source, table: CsvTable, frame: npt.NDArray[np.int32], xyz: Float,
               covariance: Float) -> tuple[Float, Float]:  # fmt: skip
    """Coordinates and covariances in the right-handed axes of the first frame, m."""
    frames = [Frame(name, tuple(f.axes), f.crs, f.vertical) for name, f in source.settings.frames.items()]
    unit = source.settings.units.ground_m
    result = in_right_handed_order(xyz * unit, frames[0].axes)
    result_covariance = in_right_handed_order(covariance, frames[0].axes)
    for number in np.unique(frame[frame > 0]).tolist():
        rows = np.flatnonzero((frame == number) & np.isfinite(xyz).any(axis=1))
        partial = rows[~np.isfinite(xyz[rows]).all(axis=1)]
        table.complain(
            partial, "frame", "frame {} needs all three coordinates", "only whole positions can be converted"
        )
        rows = np.setdiff1d(rows, partial)
        given = xyz[rows] * np.array([1.0 if a in ("latitude", "longitude") else unit for a in frames[number].axes])
        unknown = np.isnan(covariance[rows]).any(axis=(1, 2))
        try:
            moved, spread = convert(given, np.nan_to_num(covariance[rows]), frames[number], frames[0])
        except AatriError as error:
            where = table.where(int(rows[0]), "frame") if len(rows) else str(table.path)
            table.problems.append(InputError(error.what, where=where, remedy=error.remedy))
            continue
        result[rows] = moved
        spread = _with_square_variances(spread)
        spread[unknown] = np.nan
        result_covariance[rows] = spread
    return result, result_covariance


def _with_square_variances(covariance: Float) -> Float:
    rounded = (covariance + covariance.transpose(0, 2, 1)) / 2
    for axis in range(3):
        s = np.sqrt(rounded[:, axis, axis])
        rounded[:, axis, axis] = s * s
    return rounded


def _use(source: Source, table: CsvTable, use: Sequence[str], values: Float, sigma: Float,
         key: str) -> npt.NDArray[np.int32]:  # fmt: skip
    """1 where the values are observed: said so, or with a standard deviation in the row."""
    given = np.isfinite(values).any(axis=1)
    said = np.array(use, dtype=np.str_).reshape(-1)
    observed = given & ((said == "observed") | ((said == "") & np.isfinite(sigma).any(axis=1)))
    lacking = observed[:, None] & np.isfinite(values) & np.isnan(sigma)
    default = getattr(source.settings.sigma, key)
    unit = "ground" if key == "position" else "angle"
    if default is None:
        _ask_for_sigma(source, table, lacking, key, unit)
    for name in SIGMAS if key == "position" else ("s1", "s2", "s3"):
        not_negative(table, name, zero=True)
    return np.asarray(observed, dtype=np.int32)


def _attitudes(source: Source, table: CsvTable, use: Sequence[str],
               frame: npt.NDArray[np.int32]) -> tuple[Float, Float, npt.NDArray[np.int32]]:  # fmt: skip
    """Angles, their standard deviations (NaN where approximate) and use."""
    angles = np.stack([angles_rad(source, table, name) for name in ("a1", "a2", "a3")], axis=1)
    sigma = _stacked(table, ("s1", "s2", "s3"))
    angle_use = _use(source, table, use, angles, sigma, "attitude")
    given = np.isfinite(angles).any(axis=1)
    if given.any() and source.settings.rotation is None:
        where = source.document.where()
        source.problems.append(InputError(f"rotation is missing, but {table.path.name} has angles", where=where,
                                          remedy="add rotation: omega-phi-kappa (or another)"))  # fmt: skip
    table.complain(np.flatnonzero(given & (frame > 0)), "frame", "angles cannot be converted from frame {}",
                   "give angles in the first frame of block.yaml")  # fmt: skip
    factor = source.settings.units.sigma_angle_rad
    if factor is None and (angle_use == 1).any():
        where = source.document.where("units")
        source.problems.append(InputError("units.sigma_angle is missing, but there are observed angles", where=where,
                                          remedy="add units: {sigma_angle: deg} (or gon, rad, arcsec)"))  # fmt: skip
    if source.settings.sigma.attitude is not None:
        sigma = np.where(np.isnan(sigma), source.settings.sigma.attitude, sigma)
    sigma = sigma * (factor or np.nan)
    sigma[(angle_use == 0)[:, None] | np.isnan(angles)] = np.nan
    return angles, sigma, angle_use
