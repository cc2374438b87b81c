"""exterior.csv as a table: metres and radians, right-handed axes of the first frame.

Angles always refer to the right-handed axes of the first frame, whatever the order of the axes in the tables.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from aatri.arrays import Float, Int
from aatri.formats.tables.columns import COORDINATES, EXTERIOR, SIGMAS
from aatri.formats.tables.positions import ask_for_sigma, covariance_m2, frames_of, positions, stacked
from aatri.formats.tables.source import Source, angles_rad, choice, look_up, no_repeats, not_negative
from aatri.formats.text.csv_table import CsvTable


def exterior_columns(source: Source, images: Iterable[str]) -> dict[str, Any]:
    """exterior.csv; nothing if it is not there or has faults, which are kept."""
    table = source.table("exterior.csv")
    if table is None:
        return {}
    no_repeats(table, ["image"], "image")
    look_up(table, "image", dict.fromkeys(images, 0), "image", "add it to images.csv, or mend the id")
    use = choice(table, "use", ("", "observed", "approximate"), "")
    columns = source.columns(table, EXTERIOR)
    frame = frames_of(source, table)
    xyz, sigma = stacked(table, COORDINATES), stacked(table, SIGMAS)
    position_use = _use(source, table, use, xyz, sigma, "position")
    angles, angle_sigma, angle_use = _attitudes(source, table, use, frame)
    if source.problems:
        return {}
    default = source.settings.sigma.position
    if default is not None:
        sigma = np.where(np.isnan(sigma), default, sigma)
    sigma[(position_use == 0)[:, None] | np.isnan(xyz)] = np.nan
    xyz, covariance, _ = positions(source, table, frame, xyz, covariance_m2(source, table, sigma))
    return columns | {
        "position_m": xyz,
        "position_covariance_m2": covariance,
        "angles_rad": angles,
        "angle_sigma_rad": angle_sigma,
        "position_use": position_use,
        "angle_use": angle_use,
    }


def _use(source: Source, table: CsvTable, use: Sequence[str], values: Float, sigma: Float, key: str) -> Int:
    """1 where the values are observed: said so, or with a standard deviation in the row."""
    has_values = np.isfinite(values).any(axis=1)
    stated_use = np.array(use, dtype=np.str_).reshape(-1)
    observed = has_values & ((stated_use == "observed") | ((stated_use == "") & np.isfinite(sigma).any(axis=1)))
    lacking = observed[:, None] & np.isfinite(values) & np.isnan(sigma)
    default = getattr(source.settings.sigma, key)
    unit = "ground" if key == "position" else "angle"
    if default is None:
        ask_for_sigma(source, table, lacking, key, unit)
    elif has_values.any() and not observed.any() and not (stated_use != "").any():
        where = source.document.where("sigma", key)
        source.reporter.warn(
            f"{where}: sigma.{key} has no effect: {table.path.name} does not say that its {key}s are observed, so they "
            "are start values; add a column `use` with `observed`, or take the sigma out"
        )
    for name in SIGMAS if key == "position" else ("s1", "s2", "s3"):
        not_negative(table, name, zero=True)
    return np.asarray(observed, dtype=np.int32)


def _attitudes(source: Source, table: CsvTable, use: Sequence[str], frame: Int) -> tuple[Float, Float, Int]:
    """Angles, their standard deviations (NaN where approximate) and use."""
    angles = np.stack([angles_rad(source, table, name) for name in ("a1", "a2", "a3")], axis=1)
    sigma = stacked(table, ("s1", "s2", "s3"))
    angle_use = _use(source, table, use, angles, sigma, "attitude")
    has_angles = np.isfinite(angles).any(axis=1)
    if has_angles.any() and source.settings.rotation is None:
        where = source.document.where()
        source.problems.add(
            f"rotation is missing, but {table.path.name} has angles",
            where,
            "add rotation: omega-phi-kappa (or another)",
        )
    elsewhere = np.flatnonzero(has_angles & (frame > 0) & (frame != source.default_frame))
    what, remedy = "angles cannot be converted from frame {}", "give angles in the first frame of block.yaml"
    table.complain(elsewhere, "frame", what, remedy)
    if source.default_frame and source.settings.rotation != "roll-pitch-heading":
        what = "observed angles {} against the axes of a frame in degrees"
        remedy = "give roll, pitch and heading, or make the map of the angles the first frame"
        table.complain(np.flatnonzero(angle_use == 1), "a1", what, remedy)
    factor = source.settings.units.sigma_angle_rad
    if factor is None and (angle_use == 1).any():
        where = source.document.where("units")
        source.problems.add(
            "units.sigma_angle is missing, but there are observed angles",
            where,
            "add units: {sigma_angle: deg} (or gon, rad, arcsec)",
        )
    if source.settings.sigma.attitude is not None:
        sigma = np.where(np.isnan(sigma), source.settings.sigma.attitude, sigma)
    sigma = sigma * (factor or np.nan)
    sigma[(angle_use == 0)[:, None] | np.isnan(angles)] = np.nan
    return angles, sigma, angle_use
