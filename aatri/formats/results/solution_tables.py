"""A Solution as CSV tables: exterior, points, cameras, residuals, frame; tests, variance components, uncontrolled
observations, proposed numbers, suspects, parameters if there are any.

parameters.csv has an empty cell where a parameter was removed; parameter_covariances.csv has covariances and
correlations of the camera parameters, additional and of camera models, each pair once; frame.csv says what the
coordinates refer to.

cameras.csv has the interior orientations as adjusted, with their covariance and the convention of each camera.

point_covariances.csv holds point_1 point_2 and the nine covariances of X Y Z of the first by those of the second, m^2;
image_covariances.csv the image and the upper triangle by rows of the covariance matrix of X Y Z d1 d2 d3, where d1 d2
d3 turn the image about the axes of the ground system, R <- exp([d]x) R, in rad; what is not determined has no row.

Metres, millimetres in the image, degrees. Angles in both systems: omega-phi-kappa is R = Rx(omega) Ry(phi) Rz(kappa),
phi-omega-kappa (columns `_pok_`) is R = Ry(-phi) Rx(omega) Rz(kappa). Standard deviations are a priori: sigma0 is not
applied to them. An empty cell is not determined or not known, never 0. Numbers are written so that they read back to
the same bits. A text that a spreadsheet would take for a formula is prefixed by an apostrophe.
"""

import csv
import io
from collections.abc import Mapping
from itertools import combinations_with_replacement, product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Bool, Int, Text
from aatri.artifacts.block import NO_ROLE, Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.residuals import Residuals, Tests
from aatri.artifacts.solution import ParameterCovariances, Parameters, Solution, StripTransformations
from aatri.codes import WORDS_OF_ROLES
from aatri.formats.results.column_names import (
    ANGLES,
    SIGMAS_M,
    angle_sigmas_deg,
    angles_deg,
    named,
    parameter_units,
    standard_deviations,
)
from aatri.formats.results.interior_orientation import interior_columns
from aatri.formats.text.csv_cells import shielded
from aatri.formats.text.written_files import write_files
from aatri.frames.axes import columns_in_order
from aatri.geometry.two_point import TwoPointFrame
from aatri.observations.poses import ADDITIONAL

AXES = ("X", "Y", "Z")
OF_IMAGES = ("X_m", "Y_m", "Z_m", "d1_rad", "d2_rad", "d3_rad")


def covariance_tables(solution: Solution) -> dict[str, Mapping[str, npt.NDArray[Any]]]:
    """Columns of the tables by the names of their files; a table without rows is none."""
    points, between, images = solution.points, solution.point_covariances, solution.images
    first, second, matrices = points.id, points.id, points.covariance_m2
    if between is not None:
        pairs = between.first != between.second
        first = np.concatenate([first, points.id[between.first[pairs]]])
        second = np.concatenate([second, points.id[between.second[pairs]]])
        matrices = np.concatenate([matrices, between.covariance_m2[pairs]])
    tables: dict[str, Mapping[str, npt.NDArray[Any]]] = {}
    kept = np.isfinite(matrices).all(axis=(1, 2))
    if kept.any():
        cells = {f"{AXES[i]}{AXES[j]}_m2": matrices[kept, i, j] for i, j in product(range(3), repeat=2)}
        tables["point_covariances.csv"] = {"point_1": first[kept], "point_2": second[kept], **cells}
    kept = np.isfinite(images.covariance).all(axis=(1, 2))
    if kept.any():
        cells = {
            f"{OF_IMAGES[i]}_{OF_IMAGES[j]}": images.covariance[kept, i, j]
            for i, j in combinations_with_replacement(range(6), 2)
        }
        tables["image_covariances.csv"] = {"image": images.id[kept], **cells}
    return tables


Columns = Mapping[str, npt.NDArray[Any]]


def write_solution_tables(solution: Solution, block: Block, folder: Path) -> list[Path]:
    """Write the tables of a Solution; files of these names are replaced.

    Parameters
    ----------
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
        "residuals.csv": _residuals(solution.residuals),
        "frame.csv": _frame(block),
    }
    if solution.tests is not None:
        tables["tests.csv"] = _tests(solution.residuals, solution.tests)
    if solution.variance_components is not None:
        tables["variance_components.csv"] = named(solution.variance_components)
    if solution.uncontrolled is not None and len(solution.uncontrolled):
        u = solution.uncontrolled
        tables["uncontrolled.csv"] = named(u, "kind", "image", "point", "redundancy", "direction")
    if solution.proposed_numbers is not None and len(solution.proposed_numbers):
        n = solution.proposed_numbers
        tables["proposed_numbers.csv"] = {
            **named(n, "kind", "image", "point", "proposed"),
            "exchanged": np.where(n.exchanged, "yes", "no"),
        }
    if len(solution.suspects):
        columns = ("kind", "image", "point", "stage", "size", "sigma", "unit", "test", "verdict", "error")
        tables["suspects.csv"] = named(solution.suspects, *columns)
    if len(solution.transformations):
        tables["transformations.csv"] = named(solution.transformations)
    tp = frame_tp(solution.transformations)
    if tp is not None:
        tables["points_tp.csv"] = {
            "point": solution.points.id,
            **dict(zip(("X_tp", "Y_tp", "Z_tp"), tp.from_ground(solution.points.xyz_m[:, [1, 0, 2]]).T)),
        }
    if len(solution.parameters):
        tables["parameters.csv"] = _parameters(solution)
    if solution.parameter_covariances is not None and len(solution.parameter_covariances):
        tables["parameter_covariances.csv"] = _covariances(solution.parameters, solution.parameter_covariances)
    return write_tables(tables | covariance_tables(solution), folder)


OF_EVALUATION = (
    *("models", "set_ups", "pass_points", "strip_errors"),
    *("displacements", "parameter_changes", "layout_points"),
)
"""Tables of an Evaluation that some stages fill and others leave out."""


def write_evaluation_tables(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write figures.csv, differences.csv, and a file of every other table that the Evaluation has."""
    figures = evaluation.figures
    tables: dict[str, Columns] = {
        "figures.csv": {"name": figures.name, "value": figures.value},
        "differences.csv": named(evaluation.differences),
    }
    more = ((name, getattr(evaluation, name)) for name in OF_EVALUATION)
    tables |= {f"{name}.csv": named(rows) for name, rows in more if rows is not None}
    return write_tables(tables, folder)


def write_tables(tables: Mapping[str, Columns], folder: Path) -> list[Path]:
    """Write columns as CSV files, by name; the folder is made if it is not there."""
    write_files(folder, {name: _csv_text(columns) for name, columns in tables.items()})
    return [folder / name for name in tables]


def _exterior(solution: Solution) -> Columns:
    images, systems = solution.images, tuple(ANGLES)
    shown = named(images, "id", "position_m")
    for system in systems:
        shown |= angles_deg(images, system)
    shown |= dict(zip(SIGMAS_M, standard_deviations(images.covariance).T))
    for system in systems:
        shown |= angle_sigmas_deg(images, system)
    return shown | named(images, "image_points")


def _points(solution: Solution, block: Block) -> Columns:
    points = solution.points
    return {
        **named(points, "id", "xyz_m"),
        **dict(zip(SIGMAS_M, standard_deviations(points.covariance_m2).T)),
        "rays": points.rays,
        "role": point_roles(block),
    }


def _residuals(residuals: Residuals) -> Columns:
    active = np.where(residuals.active, "yes", "no")
    return {**named(residuals, "kind", "image", "point", "residual", "sigma", "unit"), "active": active}


def _parameters(solution: Solution) -> Columns:
    p = solution.parameters
    removed = removed_parameters(p)
    return {
        "group": p.group,
        "object": p.object,
        "name": p.name,
        "value": np.where(removed, np.nan, p.value),
        "sigma": np.where(removed, np.nan, p.sigma),
        "unit": np.array(parameter_units(solution), dtype=np.str_),
    }


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
        "object_1": p.object[first],
        "name_1": p.name[first],
        "object_2": p.object[second],
        "name_2": p.name[second],
        "covariance": covariance,
        "correlation": correlation,
    }


def _tests(residuals: Residuals, tests: Tests) -> Columns:
    by_kind = _residuals(residuals)
    return {
        **{name: by_kind[name] for name in ("kind", "image", "point")},
        **named(tests),
        "unit": by_kind["unit"],
        "active": by_kind["active"],
    }


def _frame(block: Block) -> Columns:
    """The first frame: that of all coordinates of a Solution, in right-handed order."""
    frames = block.frames
    stated = str(frames.axes[0]).split(",")
    axes = ",".join(stated[k] for k in columns_in_order(stated))
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
        return WORDS_OF_ROLES[int(code[0])]
    parts: dict[str, str] = {}
    for axis, value in zip("XYZ", code.tolist()):
        if value != NO_ROLE:
            parts[WORDS_OF_ROLES[value]] = parts.get(WORDS_OF_ROLES[value], "") + axis
    return " ".join(f"{axes}:{role}" for role, axes in parts.items())


def _csv_text(columns: Columns) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([tuple(columns), *zip(*map(_cells, columns.values()))])
    return text.getvalue()


def _cells(values: npt.NDArray[Any]) -> list[str]:
    if values.dtype.kind == "f":
        return ["" if value != value else repr(value) for value in values.tolist()]
    if values.dtype.kind == "U":
        return [shielded(text) for text in values.tolist()]
    return [str(value) for value in values.tolist()]


def frame_tp(transformations: StripTransformations) -> TwoPointFrame | None:
    """The frame tp that an absolute orientation has started from; None if it has none."""
    rows = transformations.take(transformations.model == "tp")
    if not len(rows):
        return None
    value = dict(zip(rows.parameter.tolist(), rows.value.tolist()))
    ground, tp = ([value[name] for name in names] for names in (("N1_m", "E1_m", "H1_m"), ("X1", "Y1", "Z1")))
    return TwoPointFrame(value["a"], value["b"], np.array(ground), np.array(tp))
