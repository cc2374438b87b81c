"""One name for a column wherever results are read: `aatri show`, DataFrames, exported CSV files.

What has several numbers a row has a column for each, with its axis and unit: X_m, sX_m, vx, wx, base_x_m, left_rad_1.

Units of the parameters in a Solution, for headers and reports.

Of a camera's own model those of `brown`, the one with an affinity `as`, are of mm; the others are of normalised
coordinates (docs/formats.md).
"""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.artifacts.solution import ImageOrientations, Solution
from aatri.camera.parameters.brown import BROWN_CONRADY
from aatri.camera.parameters.catalogue import SETS, parameter_set
from aatri.camera.parameters.parameter_set import ParameterSet
from aatri.geometry.rotations import angle_covariance, angles_from_rotation
from aatri.observations.poses import CAMERA
from aatri.tables.checked_column import Column
from aatri.tables.schema import Table, columns_of

SIGMAS_M = ("sX_m", "sY_m", "sZ_m")
ANGLES = {
    "omega-phi-kappa": ("omega_deg", "phi_deg", "kappa_deg"),
    "phi-omega-kappa": ("phi_pok_deg", "omega_pok_deg", "kappa_pok_deg"),
}
"""Of a rotation matrix, by system; standard deviations have an s before."""

_NAMES = {
    "xyz_m": ("X_m", "Y_m", "Z_m"),
    "position_m": ("X_m", "Y_m", "Z_m"),
    "sigma_m": SIGMAS_M,
    "difference_m": ("dX_m", "dY_m", "dZ_m"),
    "residual": ("vx", "vy", "vz"),
    "sigma": ("sx", "sy", "sz"),
    "test": ("wx", "wy", "wz"),
    "error": ("x", "y", "z"),
    "image_turned_rad": ("image_turned_x_rad", "image_turned_y_rad", "image_turned_z_rad"),
}
"""Columns of three numbers, by their name in the artifact."""

_SIGMAS = {
    **{f"v{axis}": f"s{axis}" for axis in "xyz"},
    **{f"d{axis}_m": f"s{axis}_m" for axis in "XYZ"},
    **dict.fromkeys(("value", "size", "x", "y", "z"), "sigma"),
}
"""Columns whose standard deviations are not called as they are, with an s before.

`size`, `x`, `y` and `z` are the errors of Suspects, `value` that of Parameters; their column is `sigma`.
"""

_IDS = {
    "ImageOrientations": "image",
    "ImageIds": "image",
    "Images": "image",
    "SolvedPoints": "point",
    "PointIds": "point",
    "Points": "point",
    "SolvedCameras": "camera",
    "Cameras": "camera",
}
"""What the column `id` of these tables is called where other tables refer to it."""

_BY_NAME = {
    **dict.fromkeys(("principal_distance", "principal_point.x", "principal_point.y", "c", "x0", "y0"), "mm"),
    **dict.fromkeys(("film correction d0", "film correction d3"), "mm"),
    **dict.fromkeys((f"film correction d{k}" for k in (1, 2, 4, 5)), "1"),
    **dict.fromkeys(("film correction d6", "film correction d7"), "1/mm"),
    **dict.fromkeys(("lever x", "lever y", "lever z", "shift X", "shift Y", "shift Z"), "m"),
    **dict.fromkeys(("drift X", "drift Y", "drift Z"), "m/s (m/image without times)"),
    **dict.fromkeys(("vx", "vy", "vz"), "m/s"),
    **dict.fromkeys([f"{turn} {k}" for turn in ("tilt", "turn") for k in (1, 2)] + ["tilt", "turn"], "m/m"),
    **dict.fromkeys([f"{place} {k}" for place in ("offset", "centre") for k in (1, 2, 3)], "m"),
    **dict.fromkeys(("offset", "east", "north", "height", "radius", "addition"), "m"),
    "scale": "1",
    "readout": "of row_time",
    "time offset": "s",
    "tau_m": "m",
    "orientation": "rad",
    **{f"boresight {axis}": "rad" for axis in "xyz"},
    **{f"mount {axis}": "m" for axis in "XYZ"},
    **{f"mount turn about {axis}": "rad" for axis in "xyz"},
    **{f"shift {angle}": "rad" for angle in ("omega", "phi", "kappa", "roll", "pitch", "heading")},
}

NORMALISED = "1 (normalised)"
_OF_BROWN = dict(zip(BROWN_CONRADY.parameters, BROWN_CONRADY.units))


def column_names(table: type[Table], name: str, declared: Column) -> tuple[str, ...]:
    """Names of the columns that a column of an artifact is shown as.

    Parameters
    ----------
    table : type
        Its table.
    name : str
        Its name in the artifact.
    """
    if not declared.shape:
        return (_IDS.get(table.__name__, name) if name == "id" else "w" if name == "test" else name,)
    if declared.shape == (3,) and name in _NAMES:
        return _NAMES[name]
    stem, _, unit = name.rpartition("_")
    if declared.shape in ((2,), (3,)) and not declared.unit.startswith("rad"):
        axes = "xyz"[: declared.shape[0]]
        return tuple(f"{stem}_{axis}_{unit}" if unit in ("m", "mm", "um") else f"{name}_{axis}" for axis in axes)
    return tuple(f"{name}_{k + 1}" for k in range(math.prod(declared.shape)))


def named(rows: Table, *columns: str) -> dict[str, npt.NDArray[Any]]:
    """Columns of a table, by default all, with those of several numbers side by side."""
    shown: dict[str, npt.NDArray[Any]] = {}
    declared = columns_of(type(rows))
    for column in columns or declared:
        names = column_names(type(rows), column, declared[column])
        flat = getattr(rows, column).reshape(len(rows), len(names))
        shown |= {name: flat[:, k] for k, name in enumerate(names)}
    return shown


def sigma_columns(head: Iterable[str]) -> dict[str, str]:
    """Columns with standard deviations, by the columns that have them; one of standard deviations is its own."""
    head = list(head)
    sigmas = {name: sigma for name in head for sigma in (_SIGMAS.get(name), f"s{name}") if sigma in head}
    return sigmas | {sigma: sigma for sigma in sigmas.values()}


def angles_deg(images: ImageOrientations, system: str) -> dict[str, Float]:
    """Angles of images in a system."""
    angles = np.degrees(angles_from_rotation(images.ground_from_image, system))
    return {name: angles[:, k] for k, name in enumerate(ANGLES[system])}


def angle_sigmas_deg(images: ImageOrientations, system: str) -> dict[str, Float]:
    """Their standard deviations; NaN where there are none."""
    sigmas = np.full((len(images), 3), np.nan)
    has_covariance = images.oriented & np.isfinite(images.covariance[:, 3:, 3:]).all(axis=(1, 2))
    if has_covariance.any():
        covariance = angle_covariance(
            images.ground_from_image[has_covariance], images.covariance[has_covariance, 3:, 3:], system
        )
        sigmas[has_covariance] = np.degrees(standard_deviations(covariance))
    return {f"s{name}": sigmas[:, k] for k, name in enumerate(ANGLES[system])}


def standard_deviations(covariances: Float) -> Float:
    """Square roots of the variances, (n, k) of (n, k, k)."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sqrt(np.einsum("nii->ni", covariances)))


def parameter_units(solution: Solution) -> list[str]:
    """Unit of each row of the parameters; empty where it depends on what the Solution does not tell."""
    units = dict(_BY_NAME)
    sets = solution.calibrated_sets
    for name in set() if sets is None else set(sets.set.tolist()):
        units |= _units_of_set(str(name), solution)
    p = solution.parameters
    own, in_mm = p.group == CAMERA, set(p.object[(p.group == CAMERA) & (p.name == "as")].tolist())
    return [
        _of_model(name, in_mm=of in in_mm) if is_own else units.get(name, "")
        for is_own, of, name in zip(own.tolist(), p.object.tolist(), p.name.tolist())
    ]


def _of_model(name: str, *, in_mm: bool) -> str:
    """Unit of a parameter of a camera's own model."""
    if name in _BY_NAME or name in ("as", "q"):
        return _BY_NAME.get(name, "1")
    return _OF_BROWN[name] if in_mm else NORMALISED


def _units_of_set(name: str, solution: Solution) -> dict[str, str]:
    if name.partition(" ")[0] not in SETS:  # a user's: its parameters are lengths at the border
        return {str(n): "mm" for n, g in zip(solution.parameters.name, solution.parameters.group) if g == "additional"}
    chosen: ParameterSet = parameter_set(name)
    return dict(zip(chosen.parameters, chosen.units))
