"""One name for a column wherever results are read: `aatri show`, DataFrames, exported CSV files.

What has several numbers a row has a column for each, with its axis and unit: X_m, sX_m, vx, wx, base_x_m, left_rad_1.
"""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.artifacts.solution import ImageOrientations
from aatri.geometry.rotations import angle_covariance, angles_from_rotation
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
