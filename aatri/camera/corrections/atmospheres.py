"""Which atmosphere refracts: the closed form of the Manual of Photogrammetry, or the layered standard atmosphere."""

from __future__ import annotations

from typing import Literal

import numpy.typing as npt

from aatri.arrays import Float
from aatri.camera.corrections.atmosphere import layered_constant
from aatri.camera.corrections.refraction import refraction_constant

Atmosphere = Literal["coefficients", "standard"]


def constant_of(atmosphere: Atmosphere, station_height_m: npt.ArrayLike, terrain_height_m: npt.ArrayLike) -> Float:
    """Refraction constant K, rad, of stations and terrain at heights above sea level, m."""
    constant = layered_constant if atmosphere == "standard" else refraction_constant
    return constant(station_height_m, terrain_height_m)
