"""Positions as tables give them: coordinates, standard deviations and covariances, in any declared frame.

Coordinates and their standard deviations follow the axes of their frame (column `frame`, else the first one). sX, sY,
sZ are standard deviations; sXY, sXZ, sYZ covariances in the square of their unit.

A covariance from another frame is rounded so that its variances are squares of standard deviations; a block written
out and read again is then the same to the bit. The change is one unit in the last place.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.errors import AatriError
from aatri.formats.tables.columns import COVARIANCES, SIGMAS
from aatri.formats.tables.source import Source, look_up
from aatri.formats.text.csv_table import CsvTable
from aatri.frames.axes import columns_in_order, in_right_handed_order
from aatri.frames.checks import out_of_range
from aatri.frames.conversion import Frame, with_derivatives
from aatri.ids import several


def stacked(table: CsvTable, names: Sequence[str]) -> Float:
    """Number columns side by side."""
    return np.stack([table.number[name] for name in names], axis=1)


def frames_of(source: Source, table: CsvTable) -> Int:
    """Number of the frame of each row, in the order of block.yaml."""
    number = {name: k for k, name in enumerate(source.settings.frames)}
    rows = look_up(table, "frame", number, "frame", "add it to `frames` in block.yaml, or mend the name")
    return np.where(rows < 0, source.default_frame, rows)


def in_own_order(source: Source, frame: Int, role: Int) -> Int:
    """Roles per X, Y, Z of the table in the order of the right-handed axes."""
    axes = [f.axes for f in source.settings.frames.values()]
    order = np.array([columns_in_order(names) for names in axes])[frame]
    ordered: Int = np.take_along_axis(role, order, axis=1)
    return ordered


def ask_for_sigma(source: Source, table: CsvTable, lacking: Bool, key: str, unit: str) -> None:
    """A fault if a standard deviation is neither in the row nor in block.yaml."""
    if lacking.any():
        row, axis = (int(k) for k in np.argwhere(lacking)[0])
        names = SIGMAS if unit == "ground" else ("s1", "s2", "s3")
        rows = several(int(lacking.any(axis=1).sum()), "row")
        what = f"no standard deviation in {rows}, and no sigma.{key} in block.yaml"
        measure = "0 is exact" if key == "control" else "in units.sigma_" + unit
        source.problems.add(what, table.where(row, names[axis]), f"add sigma: {{{key}: [a, b, c]}}, {measure}")


def warn_of_unusual(source: Source, table: CsvTable, sigma: Float) -> None:
    """Warn of standard deviations that look like a wrong unit."""
    metres = sigma * source.settings.units.sigma_ground_m
    odd = ((metres > 0) & (metres < 1e-4)) | (metres > 1e3)
    if odd.any():
        row, axis = (int(k) for k in np.argwhere(odd)[0])
        where = table.where(row, SIGMAS[axis])
        source.reporter.warn(f"{where}: {SIGMAS[axis]} is {metres[row, axis]:g} m; check units.sigma_ground")


def covariance_m2(source: Source, table: CsvTable, sigma: Float) -> Float:
    """(n, 3, 3) in m^2, in the order of the table; NaN where a standard deviation is."""
    factor = source.settings.units.sigma_ground_m
    s = sigma * factor
    covariance = np.zeros((len(table), 3, 3))
    for axis in range(3):
        covariance[:, axis, axis] = s[:, axis] * s[:, axis]
    for name, (i, j) in COVARIANCES.items():
        value = np.nan_to_num(table.number[name]) * (factor * factor)
        covariance[:, i, j] = covariance[:, j, i] = np.where(np.isnan(s[:, i] + s[:, j]), np.nan, value)
    undefined = np.isnan(s)
    covariance[undefined[:, :, None] | undefined[:, None, :]] = np.nan
    return covariance


def positions(source: Source, table: CsvTable, frame: Int, xyz: Float, covariance: Float) -> tuple[Float, Float, Float]:
    """Coordinates and covariances in the right-handed axes of the first frame, m.

    Returns
    -------
    xyz_m : (n, 3) float64, m
    covariance_m2 : (n, 3, 3) float64, m^2
    derivatives : (n, 3, 3) float64
        Of these coordinates by those in the right-handed axes of their own frame, in m.
    """
    frames = [Frame(name, tuple(f.axes), f.crs, f.vertical) for name, f in source.settings.frames.items()]
    unit = source.settings.units.ground_m
    result = in_right_handed_order(xyz * unit, frames[0].axes)
    result_covariance = in_right_handed_order(covariance, frames[0].axes)
    derivatives = np.tile(np.eye(3), (len(xyz), 1, 1))
    for number in np.unique(frame[frame > 0]).tolist():
        rows = np.flatnonzero((frame == number) & np.isfinite(xyz).any(axis=1))
        partial = rows[~np.isfinite(xyz[rows]).all(axis=1)]
        if number == source.default_frame:
            complete, of_axes = _as_whole(xyz, frames[number].axes, rows)
            partial = rows[~of_axes]
        else:
            complete = xyz
        table.complain(
            partial, "frame", "frame {} needs all three coordinates", "only whole positions can be converted"
        )
        wrong = rows[out_of_range(xyz[rows], frames[number].axes)]
        table.complain(
            wrong,
            "frame",
            "latitude or longitude is out of range in frame {}",
            "check the order of `axes`: X, Y, Z of the tables follow it",
        )
        rows = np.setdiff1d(rows, np.union1d(partial, wrong))
        places = complete[rows] * np.array(
            [1.0 if a in ("latitude", "longitude") else unit for a in frames[number].axes]
        )
        unknown = np.isnan(np.einsum("nii->ni", in_right_handed_order(covariance[rows], frames[0].axes)))
        try:
            undulation = None if number == source.default_frame else source.settings.undulation
            own = in_right_handed_order(np.nan_to_num(covariance[rows]), frames[number].axes)
            moved, D, levelled = _moved(places, frames[number], frames[0], undulation)
        except AatriError as error:
            where = table.where(int(rows[0]), "frame") if len(rows) else str(table.path)
            table.problems.add(error.what, where, error.remedy)
            continue
        source.levelled.update([frames[number].name] * levelled)
        absent = np.isnan(in_right_handed_order(xyz[rows], frames[number].axes))
        result[rows] = np.where(absent, np.nan, moved)
        derivatives[rows] = D
        spread = _with_square_variances(D @ own @ D.transpose(0, 2, 1))
        spread[unknown[:, :, None] | unknown[:, None, :]] = np.nan
        result_covariance[rows] = spread
    return result, result_covariance, derivatives


def _moved(xyz: Float, own: Frame, first: Frame, undulation: float | None) -> tuple[Float, Float, bool]:
    """Coordinates in the first frame, derivatives, and whether `undulation` stands for a missing geoid grid in them.

    With it the heights of the first frame are levelled ones, whereas latitude, longitude, height and geocentric
    coordinates have ellipsoidal heights.
    """
    by_grid = bool(first.vertical)
    try:
        moved, derivatives = with_derivatives(xyz, own, first)
    except AatriError:
        if undulation is None or not by_grid:
            raise
        by_grid = False
        moved, derivatives = with_derivatives(xyz, replace(own, vertical=""), replace(first, vertical=""))
    ellipsoidal = not own.vertical and ("height" in own.axes or "x" in own.axes)
    if undulation is None or by_grid or not ellipsoidal or "up" not in first.axes:
        return moved, derivatives, False
    return moved - np.array([0.0, 0.0, undulation]), derivatives, True


def _as_whole(xyz: Float, axes: Sequence[str], rows: Int) -> tuple[Float, Bool]:
    """Plan or height alone, of the frame in degrees that a map of the same heights is put before, made whole.

    The map does not depend on the height, nor the height on the map; what is filled in here is taken out again.

    Returns
    -------
    (n, 3) float64
        Height 0 where there is none, the middle of the others where there is no plan.
    (rows,) bool
        Rows with plan, height or both.
    """
    filled = xyz.copy()
    plan = np.array([k for k, a in enumerate(axes) if a != "height"])
    up = list(axes).index("height")
    has_plan, has_up = np.isfinite(xyz[rows][:, plan]).all(axis=1), np.isfinite(xyz[rows, up])
    middle = np.nanmedian(xyz[rows[has_plan]][:, plan], axis=0) if has_plan.any() else np.zeros(2)
    lone = rows[~np.isfinite(xyz[rows][:, plan]).any(axis=1)]
    filled[np.ix_(lone, plan)] = middle
    filled[rows[~has_up], up] = 0.0
    broken = np.isfinite(xyz[rows][:, plan]).any(axis=1) & ~has_plan
    return filled, (has_plan | has_up) & ~broken


def _with_square_variances(covariance: Float) -> Float:
    rounded = (covariance + covariance.transpose(0, 2, 1)) / 2
    for axis in range(3):
        s = np.sqrt(rounded[:, axis, axis])
        rounded[:, axis, axis] = s * s
    return rounded
