"""A Solution as CSV tables: exterior, points, cameras, residuals, frame; tests, variance components, uncontrolled
observations, proposed numbers, suspects, parameters if there are any.

parameters.csv has an empty cell where a parameter was removed; parameter_covariances.csv has covariances and
correlations of the camera parameters, additional and of camera models, each pair once; frame.csv says what the
coordinates refer to.

cameras.csv has the interior orientations as adjusted, with their covariance and the convention of each camera.
Metres, millimetres in the image, degrees. Angles in both systems: omega-phi-kappa is R = Rx(omega) Ry(phi) Rz(kappa),
phi-omega-kappa (columns `_pok_`) is R = Ry(-phi) Rx(omega) Rz(kappa). Standard deviations are a priori: sigma0 is not
applied to them. An empty cell is not determined or not known, never 0. Numbers are written so that they read back to
the same bits. A text that a spreadsheet would take for a formula is prefixed by an apostrophe.
"""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import APPROXIMATE, CHECK, CONTROL, NO_ROLE, Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import (
    ParameterCovariances,
    Parameters,
    Residuals,
    Solution,
    Tests,
    VarianceComponents,
)
from aatri.artifacts.suspects import Suspects
from aatri.errors import ResourceError
from aatri.formats.results.frame_tp import frame_tp
from aatri.formats.results.interior_orientation import interior_columns
from aatri.formats.results.parameter_units import parameter_units
from aatri.formats.text.csv_cells import shielded
from aatri.frames.axes import columns_in_order
from aatri.geometry.rotations import angle_covariance, angles_from_rotation
from aatri.observations.poses import ADDITIONAL
from aatri.tables.schema import columns_of, plain_columns

Columns = Mapping[str, npt.NDArray[Any]]

_ROLES = {NO_ROLE: "", CONTROL: "control", CHECK: "check", APPROXIMATE: "approximate"}


def write_solution_tables(solution: Solution, block: Block, folder: Path) -> list[Path]:
    """Write the tables of a Solution; files of these names are replaced.

    Parameters
    ----------
    solution : Solution
    block : Block
        The Block it belongs to: roles of the points.
    folder : Path
        Made if it is not there.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ResourceError
        If a file cannot be written.
    """
    tables = {
        "exterior.csv": _exterior(solution),
        "points.csv": _points(solution, block),
        "cameras.csv": interior_columns(solution, block),
        "residuals.csv": _residuals(solution),
        "frame.csv": _frame(block),
    }
    if solution.tests is not None:
        tables["tests.csv"] = _tests(solution.residuals, solution.tests)
    if solution.variance_components is not None:
        c = solution.variance_components
        tables["variance_components.csv"] = {name: getattr(c, name) for name in columns_of(VarianceComponents)}
    if solution.uncontrolled is not None and len(solution.uncontrolled):
        u = solution.uncontrolled
        tables["uncontrolled.csv"] = {
            "kind": u.kind, "image": u.image, "point": u.point, "redundancy": u.redundancy,
            **_split(("direction_x", "direction_y", "direction_z"), u.direction),
        }  # fmt: skip
    if solution.proposed_numbers is not None and len(solution.proposed_numbers):
        n = solution.proposed_numbers
        tables["proposed_numbers.csv"] = {
            "kind": n.kind, "image": n.image, "point": n.point, "proposed": n.proposed,
            "exchanged": np.where(n.exchanged, "yes", "no"),
        }  # fmt: skip
    if len(solution.suspects):
        tables["suspects.csv"] = _suspects(solution.suspects)
    if len(solution.transformations):
        tables["transformations.csv"] = plain_columns(solution.transformations)
    tp = frame_tp(solution.transformations)
    if tp is not None:
        tables["points_tp.csv"] = {
            "point": solution.points.id,
            **_split(("X_tp", "Y_tp", "Z_tp"), tp.from_ground(solution.points.xyz_m[:, [1, 0, 2]])),
        }
    if len(solution.parameters):
        tables["parameters.csv"] = _parameters(solution)
    if solution.parameter_covariances is not None and len(solution.parameter_covariances):
        tables["parameter_covariances.csv"] = _covariances(solution.parameters, solution.parameter_covariances)
    return write_tables(tables, folder)


def write_evaluation_tables(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write figures.csv, differences.csv and, of stereo models, models.csv, set_ups.csv, pass_points.csv."""
    figures, d = evaluation.figures, evaluation.differences
    tables: dict[str, Columns] = {
        "figures.csv": {"name": figures.name, "value": figures.value},
        "differences.csv": {
            "point": d.point, "kind": d.kind, **_split(("dX_m", "dY_m", "dZ_m"), d.difference_m),
            **_split(("sX_m", "sY_m", "sZ_m"), d.sigma_m), "rays": d.rays,
        },
    }  # fmt: skip
    more = (("models", evaluation.models), ("set_ups", evaluation.set_ups), ("pass_points", evaluation.pass_points))
    tables |= {f"{name}.csv": plain_columns(rows) for name, rows in more if rows is not None}
    return write_tables(tables, folder)


def write_tables(tables: Mapping[str, Columns], folder: Path) -> list[Path]:
    """Write columns as CSV files, by name; the folder is made if it is not there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return [_write(folder / name, columns) for name, columns in tables.items()]
    except OSError as error:
        raise ResourceError(f"cannot write: {error}", where=str(folder), remedy="choose another folder") from error


def _exterior(solution: Solution) -> Columns:
    images = solution.images
    sigma = _sigmas(images.covariance)
    return {
        "image": images.id,
        **_split(("X_m", "Y_m", "Z_m"), images.position_m),
        **_angles(solution, "omega-phi-kappa", ("omega_deg", "phi_deg", "kappa_deg")),
        **_angles(solution, "phi-omega-kappa", ("phi_pok_deg", "omega_pok_deg", "kappa_pok_deg")),
        **_split(("sX_m", "sY_m", "sZ_m"), sigma[:, :3]),
        **_angle_sigmas(solution, "omega-phi-kappa", ("somega_deg", "sphi_deg", "skappa_deg")),
        **_angle_sigmas(solution, "phi-omega-kappa", ("sphi_pok_deg", "somega_pok_deg", "skappa_pok_deg")),
        "image_points": images.image_points,
    }


def _points(solution: Solution, block: Block) -> Columns:
    points = solution.points
    return {
        "point": points.id,
        **_split(("X_m", "Y_m", "Z_m"), points.xyz_m),
        **_split(("sX_m", "sY_m", "sZ_m"), _sigmas(points.covariance_m2)),
        "rays": points.rays,
        "role": point_roles(block),
    }


def _residuals(solution: Solution) -> Columns:
    residuals = solution.residuals
    return {
        "kind": residuals.kind,
        "image": residuals.image,
        "point": residuals.point,
        **_split(("vx", "vy", "vz"), residuals.residual),
        **_split(("sx", "sy", "sz"), residuals.sigma),
        "unit": residuals.unit,
        "active": np.where(residuals.active, "yes", "no"),
    }


def _parameters(solution: Solution) -> Columns:
    p = solution.parameters
    removed = removed_parameters(p)
    return {
        "group": p.group, "object": p.object, "name": p.name, "value": np.where(removed, np.nan, p.value),
        "sigma": np.where(removed, np.nan, p.sigma), "unit": np.array(parameter_units(solution), dtype=np.str_),
    }  # fmt: skip


def removed_parameters(p: Parameters) -> Bool:
    """Additional parameters that were left out: they are neither estimated nor given, (n,)."""
    return np.asarray((p.group == ADDITIONAL) & (p.value == 0) & (p.sigma == 0))


def _covariances(p: Parameters, rows: ParameterCovariances) -> Columns:
    """Covariances in the product of both units, and correlations; nothing of what was removed."""
    kept = ~(removed_parameters(p)[rows.first] | removed_parameters(p)[rows.second])
    first, second, covariance = rows.first[kept], rows.second[kept], rows.covariance[kept]
    units = p.sigma[first] * p.sigma[second]
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = np.where(units > 0, covariance / units, np.nan)
    return {
        "object_1": p.object[first], "name_1": p.name[first], "object_2": p.object[second], "name_2": p.name[second],
        "covariance": covariance, "correlation": correlation,
    }  # fmt: skip


def _tests(residuals: Residuals, tests: Tests) -> Columns:
    return {
        "kind": residuals.kind, "image": residuals.image, "point": residuals.point,
        **_split(("redundancy_x", "redundancy_y", "redundancy_z"), tests.redundancy),
        **_split(("wx", "wy", "wz"), tests.test),
        **_split(("detectable_x", "detectable_y", "detectable_z"), tests.detectable),
        **_split(("external_x", "external_y", "external_z"), tests.external),
        **_split(("point_moved_x_m", "point_moved_y_m", "point_moved_z_m"), tests.point_moved_m),
        **_split(("image_moved_x_m", "image_moved_y_m", "image_moved_z_m"), tests.image_moved_m),
        **_split(("image_turned_x_rad", "image_turned_y_rad", "image_turned_z_rad"), tests.image_turned_rad),
        "unit": residuals.unit, "active": np.where(residuals.active, "yes", "no"),
    }  # fmt: skip


def _suspects(rows: Suspects) -> Columns:
    return {
        "kind": rows.kind, "image": rows.image, "point": rows.point, "stage": rows.stage, "size": rows.size,
        "sigma": rows.sigma, "unit": rows.unit, "w": rows.test, "verdict": rows.verdict,
        **_split(("x", "y", "z"), rows.error),
    }  # fmt: skip


def _frame(block: Block) -> Columns:
    """The first frame: that of all coordinates of a Solution, in right-handed order."""
    frames = block.frames
    given = str(frames.axes[0]).split(",")
    axes = ",".join(given[k] for k in columns_in_order(given))
    return {"frame": frames.id[:1], "axes": np.array([axes]), "crs": frames.crs[:1], "vertical": frames.vertical[:1]}


def point_roles(block: Block) -> Text:
    """Role of every point, as in ground_points.csv: `control`, `XY:control Z:check`; a new point has none.

    Returns
    -------
    (n,) str
    """
    roles = np.full(len(block.points), "", dtype="U48")
    codes, kind = np.unique(block.ground_points.role, axis=0, return_inverse=True)
    names = np.array([_role_text(code) for code in codes], dtype="U48")
    if len(names):
        roles[block.ground_points.point] = names[kind.ravel()]
    return roles


def _role_text(code: Int) -> str:
    if len(set(code.tolist())) == 1:
        return _ROLES[int(code[0])]
    parts: dict[str, str] = {}
    for axis, value in zip("XYZ", code.tolist()):
        if value != NO_ROLE:
            parts[_ROLES[value]] = parts.get(_ROLES[value], "") + axis
    return " ".join(f"{axes}:{role}" for role, axes in parts.items())


def _angles(solution: Solution, system: str, names: Iterable[str]) -> Columns:
    return _split(names, np.degrees(angles_from_rotation(solution.images.ground_from_image, system)))


def _angle_sigmas(solution: Solution, system: str, names: Iterable[str]) -> Columns:
    images = solution.images
    sigma = np.full((len(images), 3), np.nan)
    known = images.oriented & np.isfinite(images.covariance[:, 3:, 3:]).all(axis=(1, 2))
    if known.any():
        covariance = angle_covariance(images.ground_from_image[known], images.covariance[known, 3:, 3:], system)
        sigma[known] = np.degrees(_sigmas(covariance))
    return _split(names, sigma)


def _sigmas(covariance: Float) -> Float:
    return np.asarray(np.sqrt(np.einsum("nii->ni", covariance)))


def _split(names: Iterable[str], values: npt.NDArray[Any]) -> Columns:
    return {name: values[:, k] for k, name in enumerate(names)}


def _write(path: Path, columns: Columns) -> Path:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(_cells(values) for values in columns.values())))
    return path


def _cells(values: npt.NDArray[Any]) -> list[str]:
    if values.dtype.kind == "f":
        return ["" if value != value else repr(value) for value in values.tolist()]
    if values.dtype.kind == "U":
        return [shielded(text) for text in values.tolist()]
    return [str(value) for value in values.tolist()]
