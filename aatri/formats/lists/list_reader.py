"""Reading of a list by its columns: orientations, positions, control, image points.

The columns are those that the user names, else those of the header, which is the first line that has the names of a
list (a remark sign before it does not count). Lines before the header or the first row are told, not read. Cells are
separated by tabulators, semicolons, commas or blanks, as the first row is; `#` begins a remark.

Angles are degrees unless the header or the user says gon or rad. omega-phi-kappa is R = Rx(omega) Ry(phi) Rz(kappa),
phi-omega-kappa R = Ry(-phi) Rx(omega) Rz(kappa), both image to ground; yaw-pitch-roll is the attitude of a camera that
looks straight down at pitch 0, its upper edge ahead, yaw clockwise from north. A matrix r11 ... r33 beside the angles
is held against them: it must be R or R'. Positions and attitudes are observed where they have standard deviations.
"""

import math
from pathlib import Path

import numpy as np

from aatri.arrays import Float
from aatri.codes import APPROXIMATE_VALUE, CONTROL, NO_ROLE, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.conventions.pixel_origins import PHOTO_MM
from aatri.formats.conventions.poses import rotation_of_carrier
from aatri.formats.limits import NOT_ORTHOGONAL
from aatri.formats.lists.list_columns import ANGLES, PRESETS, ROLES, ROTATION, ListColumns, columns_named
from aatri.formats.lists.list_form import (
    cells,
    form_of_columns,
    header_cells,
    in_stated_units,
    in_units_of,
    in_units_of_names,
    proposed,
    separator_of,
    stated_crs,
)
from aatri.formats.parts.block_parts import PLANE, BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, Reading
from aatri.formats.text.text_file import read_lines
from aatri.formats.text.text_line import TextLine, check_positive, places
from aatri.frames.conversion import Frame
from aatri.geometry.rotations import angle_axes, angle_covariance
from aatri.ids import clipped, several, shown
from aatri.progress import SILENT, Reporter

RAD = {"deg": math.pi / 180, "gon": math.pi / 200, "rad": 1.0}
GEOGRAPHIC = Frame("list", ("longitude", "latitude", "height"), "EPSG:4979")
PLACE = ("X", "Y", "Z", "longitude", "latitude", "x", "y")
BLANKS = "mend the row; a name with blanks stands in double quotes, or between tabulators, commas or semicolons"
SHOWN = 3
"""So many rows are shown as they were read."""


def read_list(
    path: Path,
    reading: Reading = AS_IT_SAYS,
    reporter: Reporter = SILENT,
    *,
    preset: str | None = None,
    observed: bool = False,
) -> BlockParts:
    """Read a list.

    Parameters
    ----------
    reading : Reading
        Its `columns`, `angle`, `rotation` and `crs` come before what the file says.
    preset : str, optional
        One of `PRESETS`, for formats that are a list of one program.
    observed : bool
        Positions and attitudes are observed, with standard deviations or without.

    Raises
    ------
    InputError
        If the columns are not known, or a row is not of them.
    """
    lines = read_lines(path, reporter)
    stated = reading.columns or preset
    form = proposed(lines) if stated is None else form_of_columns(lines, columns_named(stated), path)
    if form is None:
        what = f"its first line is {clipped(lines[0].strip(), 60)!r}, and no header tells its columns"
        remedy = (
            f"say `columns`: one of {', '.join(PRESETS)}, or the columns in their order, `image X Y Z omega phi kappa`"
        )
        raise InputError(what, where=f"{path}:1", remedy=remedy)
    columns, heading = form.columns, lines[form.header - 1]
    header = header_cells(heading, separator_of(heading, len(columns.words))) if stated is None else []
    if header:
        columns = in_units_of_names(TextLine(header, path, form.header), columns)
    rows = list[TextLine]()
    for k, text in enumerate(lines[form.header :], form.header + 1):
        if text.strip() and not text.lstrip().startswith("#"):
            row = TextLine(cells(text, form.separator), path, k)
            if not columns.fewest <= len(row.words) <= len(columns.words):
                what = f"{several(len(row.words), 'word')}, for the columns {' '.join(columns.words)}"
                raise row.error(what, "mend the row" if form.separator else BLANKS)
            in_units = None if rows else in_units_of(row, columns)
            if in_units is None:
                rows.append(row)
            else:
                columns = in_units
    if not rows:
        raise InputError("no rows below the header", where=f"{path}:{form.header}", remedy="put the data in")
    unread = [name for name, word in zip(header, columns.words) if word == "-"]
    named = form if stated is None else proposed(lines)
    parts = _Rows(in_stated_units(columns, lines, path), rows, reading).parts(path, lines, named.header if named else 0)
    if unread:
        parts.notes.append(f"columns that are not read: {shown(unread)}; `columns` says what they are")
    if observed and parts.exterior:
        parts.exterior = {**parts.exterior, "position_use": OBSERVED_VALUE, "angle_use": OBSERVED_VALUE}
    return parts


class _Rows:
    """The rows of a list by their columns."""

    def __init__(self, columns: ListColumns, rows: list[TextLine], reading: Reading) -> None:
        self.columns, self.rows, self.reading = columns, rows, reading
        self.at = {name: k for k, name in enumerate(columns.names) if name != "-"}
        self.sign = {name: -1.0 if word.startswith("-") else 1.0 for name, word in zip(columns.names, columns.words)}

    def texts(self, name: str) -> list[str]:
        """The cells of a column; empty ones where a row or the list has none."""
        k = self.at.get(name)
        return [row.words[k] if k is not None and k < len(row.words) else "" for row in self.rows]

    def numbers(self, *names: str) -> Float:
        """Columns of numbers (n, k); NaN where a cell is empty or the list has no such column.

        Angles and standard deviations that are not known may be NaN; a coordinate is left empty.
        """
        values = np.full((len(self.rows), len(names)), np.nan)
        for j, name in enumerate(names):
            for i, text in enumerate(self.texts(name)):
                if text and (text.lower() != "nan" or name in PLACE):
                    values[i, j] = self.sign[name] * self.rows[i].number(self.at[name])
        return values

    def parts(self, path: Path, lines: list[str], header: int) -> BlockParts:
        """What the list gives of a block; its columns are named in line `header`, 0: in none."""
        parts = BlockParts("table", [path], name=path.stem, notes=self._notes(lines, header))
        at = places(self.rows, [path])
        geographic = "longitude" in self.at
        xyz = self.numbers(*(("longitude", "latitude", "Z") if geographic else ("X", "Y", "Z")))
        if geographic and (bad := np.flatnonzero(np.abs(xyz[:, 1]) > 90)).size:
            raise self.rows[int(bad[0])].error(f"latitude {xyz[bad[0], 1]:g}", "longitude and latitude are degrees")
        sigma = self.numbers("sX", "sY", "sZ")
        if "sXY" in self.at:
            sigma[:, :2] = self.numbers("sXY")
        for row, of_row in zip(self.rows, sigma.tolist()):
            check_positive(row, of_row)
        has_place = {"X", "longitude"} & {*self.at}
        if "x" in self.at:
            self._measured(parts, at)
            if has_place:
                chosen = list(dict(zip(reversed(self.texts("point")), reversed(range(len(self.rows))))).values())[::-1]
                self._ground(parts, chosen, xyz, sigma, at)
        elif "point" in self.at:
            self._ground(parts, list(range(len(self.rows))), xyz, sigma, at)
        else:
            self._exterior(parts, xyz, sigma, at)
        if has_place or self.columns.system:
            crs = stated_crs(lines)
            parts.frame = GEOGRAPHIC if geographic else Frame("list", ("east", "north", "up"), crs) if crs else PLANE
        return parts

    def _notes(self, lines: list[str], header: int) -> list[str]:
        """What was read how, for the user to see that it is right."""
        system = self.reading.rotation or self.columns.system
        angles = f", angles {system} in {self.unit}" if system and self.columns.system else ""
        first = self.rows[:SHOWN]
        shown = [", ".join(f"{n} = {self.texts(n)[k]}" for n in self.at) for k in range(len(first))]
        above = enumerate(lines[: self.rows[0].line - 1], 1)
        before = [" ".join(text.split()) for k, text in above if text.strip() and k != header]
        skipped = [f"not read, before the first row: {clipped(' | '.join(before), 200)}"] if before else []
        if self.columns.in_image.get("x") == "mm":
            angles += ", image coordinates in mm from the image centre, y up"
        read = [f"columns read as {' '.join(self.columns.words)}{angles}"]
        return [*read, *(f"line {row.line}: {text}" for row, text in zip(first, shown)), *skipped]

    @property
    def unit(self) -> str:
        """Unit of angles."""
        return self.reading.angle or self.columns.angle or "deg"

    def _once(self, *columns: str) -> None:
        first: dict[str, TextLine] = {}
        for row, names in zip(self.rows, zip(*map(self.texts, columns))):
            if not all(names):
                raise row.error(f"no {' and no '.join(c for c, n in zip(columns, names) if not n)}", "give the row one")
            row.once(" in image ".join(names), first, columns[0])

    def _measured(self, parts: BlockParts, at: dict[str, list[int]]) -> None:
        self._once("point", "image")
        xy = self.numbers("x", "y")
        if (bad := np.flatnonzero(np.isnan(xy).any(axis=1))).size:
            raise self.rows[int(bad[0])].error("no image coordinates", "give x and y, or remove the row")
        units = [self.columns.in_image.get(name, "px") for name in ("x", "y")]
        if units[0] != units[1]:
            raise self.rows[0].error(f"x in {units[0]} and y in {units[1]}", "give both in px or in mm")
        if units[0] == "mm":
            parts.pixel_axes = PHOTO_MM
        parts.image_points = {"image": self.texts("image"), "point": self.texts("point"), "xy": xy, **at}
        if "sx" in self.at:
            names = ("sx", "sy" if "sy" in self.at else "sx")
            of_sigma = [self.columns.in_image.get(name, units[0]) for name in names]
            if (of_sigma[0] == "px") != (of_sigma[1] == "px"):
                raise self.rows[0].error(f"sx in {of_sigma[0]} and sy in {of_sigma[1]}", "give both in px or in mm")
            scale = [1e-3 if unit == "um" else 1.0 for unit in of_sigma]
            parts.image_points["sigma_px" if of_sigma[0] == "px" else "sigma_mm"] = self.numbers(*names) * scale

    def _ground(self, parts: BlockParts, chosen: list[int], xyz: Float, sigma: Float, at: dict[str, list[int]]) -> None:
        points = self.texts("point")
        if len(chosen) == len(points):
            self._once("point")
        first = {points[k]: k for k in chosen}
        for k, name in enumerate(points):
            if not np.array_equal(xyz[k], xyz[first[name]], equal_nan=True):
                where = self.rows[first[name]].line
                raise self.rows[k].error(f"point {name} has other coordinates than in line {where}", "mend one")
        roles = [role.casefold() for role in self.texts("role")]
        for row, role in zip(self.rows, roles):
            if role not in ROLES:
                raise row.error(f"role {clipped(role)!r}", f"roles are {', '.join(filter(None, ROLES))}")
        codes = np.array([ROLES[role] if "role" in self.at else CONTROL for role in roles])
        parts.ground_points = {
            "point": [points[k] for k in chosen],
            "xyz_m": xyz[chosen],
            "sigma_m": sigma[chosen],
            "role": np.where(np.isnan(xyz), NO_ROLE, codes[:, None])[chosen],
            **{name: [values[k] for k in chosen] for name, values in at.items()},
        }

    def _exterior(self, parts: BlockParts, xyz: Float, sigma: Float, at: dict[str, list[int]]) -> None:
        self._once("image")
        images = self.texts("image")
        parts.images = {"id": images, "camera": self.texts("camera"), "time_s": self.numbers("time")[:, 0], **at}
        observed = np.asarray(np.isfinite(sigma[:, :2]).all(axis=1))
        parts.exterior = {
            "image": images,
            "position_m": xyz,
            "sigma_m": np.where(observed[:, None], sigma, np.nan),
            "position_use": np.where(observed, OBSERVED_VALUE, APPROXIMATE_VALUE),
            **at,
        }
        if self.columns.system:
            parts.exterior |= self._attitudes(self.reading.rotation or self.columns.system)

    def _attitudes(self, system: str) -> dict[str, Float]:
        if ("yaw" in self.at) != (system == "yaw-pitch-roll"):
            raise self.rows[0].error(
                f"rotation {system}, but the columns are {' '.join(self.columns.words)}",
                "say the rotation that the columns are of",
            )
        angles, sigma = (
            np.stack([self.numbers(f"{before}{name}")[:, 0] for name in ANGLES[system]], axis=1) * RAD[self.unit]
            for before in ("", "s")
        )
        if (bad := np.flatnonzero((np.abs(angles) > 2 * math.pi).any(axis=1))).size:
            stated = (angles[bad[0]] / RAD[self.unit]).tolist()
            raise self.rows[int(bad[0])].error(f"angles {stated} go beyond a circle of {self.unit}", "say `angle`")
        if system == "yaw-pitch-roll":
            R, axes = rotation_of_carrier(angles[:, ::-1])
            axes = axes[:, :, ::-1]
        else:
            R, axes = angle_axes(angles, system)
        self._hold_against_matrix(R)
        of_rotation = np.einsum("nij,nj,nkj->nik", axes, sigma**2, axes)
        has_covariance = np.isfinite(of_rotation).all(axis=(1, 2)) & np.isfinite(R).all(axis=(1, 2))
        sigma_opk = np.full_like(angles, np.nan)
        if has_covariance.any():
            variance = angle_covariance(R[has_covariance], of_rotation[has_covariance], "omega-phi-kappa")
            sigma_opk[has_covariance] = np.sqrt(np.einsum("nii->ni", variance))
        use = np.where(has_covariance, OBSERVED_VALUE, APPROXIMATE_VALUE)
        return {"ground_from_image": R, "angle_sigma_rad": sigma_opk, "angle_use": use}

    def _hold_against_matrix(self, R: Float) -> None:
        """Refuse a list whose matrices are neither R nor R' of its angles."""
        if "r11" not in self.at:
            return
        stated = self.numbers(*ROTATION).reshape(-1, 3, 3)
        apart = np.stack([np.abs(stated - R).max(axis=(1, 2)), np.abs(stated - R.swapaxes(1, 2)).max(axis=(1, 2))])
        misfit = np.nan_to_num(apart, nan=0.0).max(axis=1)
        if misfit.min() > NOT_ORTHOGONAL:
            k = int(np.nan_to_num(apart[int(misfit.argmin())], nan=0.0).argmax())
            what = f"r11 ... r33 is neither the matrix of the angles nor its transpose: {misfit.min():.3g} beside it"
            raise self.rows[k].error(what, "say `rotation` and `angle`, or leave the matrix out of `columns`")
