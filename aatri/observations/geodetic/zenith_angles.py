"""Zenith angles, with refraction and, in a map frame, the curvature of the Earth.

    v = atan2(s, u) + c s / R - z,    c = -k / 2 in a tangent frame,  (1 - k) / 2 in a map frame,  0 in a local frame

(e, n, u) is the line in the axes of the station, s its horizontal length, k the coefficient of refraction: the line of
sight is bent towards the Earth and shows the target too high. In a map frame whose Z is the height the horizon itself
falls away by s / 2R. A local frame knows no Earth: neither is applied, and the size of the effect is told.
Source: Torge & Mueller, Geodesy; docs/formulas.md 5.4.
"""

from dataclasses import replace

import numpy as np
from pydantic import Field

from aatri.arrays import Float
from aatri.notes import Note
from aatri.observations.geodetic.sights import Measured, Sights, horizontal, observed_sights, sights_of, zenith
from aatri.observations.level import Level
from aatri.observations.limits import NOTED_NEGLECT
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.poses import POINT, position
from aatri.options import Options
from aatri.units import EARTH_RADIUS_M

KIND = "zenith"

USES = ("geodetic:zenith", "geodetic:zenith_to_image", "geodetic.heights")


class ZenithOptions(Options):
    """Options of zenith angles."""

    refraction: float = Field(0.13, ge=-2, le=2, description="coefficient of refraction k")


def zenith_angles(source: ObservationSource, options: ZenithOptions) -> tuple[Observed, ...]:
    """Zenith angles of the geodetic observations."""
    rows = sights_of(source.block, KIND)
    observed = list(observed_sights(KIND, rows, source.level, measured_with(source.level, options.refraction), "rad"))
    if observed and not source.level.curvature_per_m:
        observed[0] = replace(observed[0], notes=_neglected(source, rows, options.refraction))
    return tuple(observed)


def measured_with(level: Level, refraction: float) -> Measured:
    """The zenith angle that an instrument shows."""
    c = level.curvature_per_m * ((0.0 if level.curved else 0.5) - 0.5 * refraction)

    def measured(line: Float) -> tuple[Float, Float]:
        z, by_line = zenith(line)
        s, by_s = horizontal(line)
        return z + c * s, by_line + c * by_s

    return measured


def _neglected(source: ObservationSource, rows: Sights, refraction: float) -> tuple[Note, ...]:
    """What curvature and refraction would do to the longest sights, where it matters."""
    points = position(source.start, POINT)
    on_ground = ~(rows.station_is_image | rows.target_is_image)
    away = np.hypot(*(points[rows.target[on_ground]] - points[rows.station[on_ground]])[:, :2].T)
    effect = away * (1 - refraction) / (2 * EARTH_RADIUS_M)
    large = effect > NOTED_NEGLECT * rows.sigma[on_ground]
    if not np.isfinite(effect).any() or not large.any():
        return ()
    text = (
        "zenith angles in a local frame: curvature and refraction are neglected, up to "
        f'{np.degrees(np.nanmax(effect)) * 3600:.2g}" ({large.sum()} of {len(rows)} by more than '
        f"{NOTED_NEGLECT:g} sigma); "
        "a frame with a CRS takes them into account"
    )
    return (Note("warning", text),)
