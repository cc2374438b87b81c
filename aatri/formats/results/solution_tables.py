"""A Solution as CSV tables: exterior.csv, points.csv, cameras.csv, residuals.csv and, if there are any, parameters.csv.

Metres, millimetres in the image, degrees. Angles in both systems: omega-phi-kappa is R = Rx(omega) Ry(phi) Rz(kappa),
phi-omega-kappa (columns `_pok_`) is R = Ry(-phi) Rx(omega) Rz(kappa). Standard deviations are a priori: sigma0 is not
applied to them. An empty cell is not determined or not known, never 0. Numbers are written so that they read back to
the same bits. A text that a spreadsheet would take for a formula is prefixed by an apostrophe.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import APPROXIMATE, CHECK, CONTROL, NO_ROLE, Block
from aatri.artifacts.solution import Solution
from aatri.errors import ResourceError
from aatri.geometry.rotations import AngleSystem, angle_covariance, angles_from_rotation

Columns = Mapping[str, npt.NDArray[Any]]

_ROLES = {NO_ROLE: "", CONTROL: "control", CHECK: "check", APPROXIMATE: "approximate"}
_DEGREES = 180.0 / np.pi


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
        "cameras.csv": _cameras(solution),
        "residuals.csv": _residuals(solution),
    }
    if len(solution.parameters):
        tables["parameters.csv"] = _parameters(solution)
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


def _cameras(solution: Solution) -> Columns:
    cameras = solution.cameras
    return {
        "camera": cameras.id,
        "principal_distance_mm": cameras.principal_distance_mm,
        **_split(("principal_point_x_mm", "principal_point_y_mm"), cameras.principal_point_mm),
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
    return {"group": p.group, "object": p.object, "name": p.name, "value": p.value, "sigma": p.sigma}


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


def _angles(solution: Solution, system: AngleSystem, names: Iterable[str]) -> Columns:
    return _split(names, _DEGREES * angles_from_rotation(solution.images.ground_from_image, system))


def _angle_sigmas(solution: Solution, system: AngleSystem, names: Iterable[str]) -> Columns:
    images = solution.images
    sigma = np.full((len(images), 3), np.nan)
    known = images.oriented & np.isfinite(images.covariance[:, 3:, 3:]).all(axis=(1, 2))
    if known.any():
        covariance = angle_covariance(images.ground_from_image[known], images.covariance[known, 3:, 3:], system)
        sigma[known] = _DEGREES * _sigmas(covariance)
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
        return [_harmless(text) for text in values.tolist()]
    return [str(value) for value in values.tolist()]


def _harmless(text: str) -> str:
    return "'" + text if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text
