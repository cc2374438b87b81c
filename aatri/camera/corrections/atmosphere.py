"""Refraction constant K, the angle by which refraction displaces a ray at 45 degrees, of two atmospheres.

`coefficients`, the ARDC 1959 atmosphere in closed form, H and h in km above sea level:

    K = [2410 H / (H^2 - 6 H + 250) - 2410 h / (h^2 - 6 h + 250) h / H] 1e-6     rad

`standard`, the layered standard atmosphere, from pressures and densities:

    K = n_mean - n_H = kappa [(p_h - p_H) / (g (H - h)) - rho_H],    n - 1 = kappa rho

K is the mean refractive index between terrain (h) and station (H) less that at the station: by Snell's law in plane
layers, n sin(theta) = const, a ray that meets the camera theta from the nadir comes from a ground point on the straight
line of theta_c,

    tan theta_c = tan theta - K tan theta (1 + tan^2 theta) + O(K^2)

In hydrostatic balance the density integrates to the difference of pressures over g, so the mean needs no sum over
layers. With a temperature of constant lapse L in each layer, T = T_b + L (H' - H_b), H' geopotential height,

    p = p_b (T_b/T)^(g M / (R* L)),  p = p_b exp(-g M (H' - H_b) / (R* T_b)) where L = 0,    rho = p M / (R* T)

Below 1 km the closed form is about 22 % smaller. kappa belongs to the middle of the visible spectrum
(550 nm); from 450 to 650 nm it changes by 1 %. Temperature and pressure of the day change K by some 10 %.

Source: Manual of Photogrammetry (ASPRS), refraction in the ARDC 1959 atmosphere; U.S. Standard Atmosphere 1976, table 4
and equations 33a, 33b; refractive index of dry air, 1 + 2.778e-4 at 15 degrees C and 1013.25 hPa (Edlen 1966); Snell's
law in plane layers, Kraus, Photogrammetry 1.
"""

from typing import Literal

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float

Atmosphere = Literal["coefficients", "standard"]

GRAVITY = 9.80665
GAS = 8314.32 / 28.9644
"""Of dry air, J / (kg K)."""
RADIUS_M = 6_356_766.0
"""By which geopotential heights are defined."""
KAPPA = 2.778e-4 / 1.2250
"""(n - 1) / rho, m^3/kg, at 550 nm."""

BASE_M = np.array([0.0, 11_000.0, 20_000.0, 32_000.0, 47_000.0])
"""Geopotential heights of the layers; the last one ends the table."""
LAPSE = np.array([-0.0065, 0.0, 0.001, 0.0028])
TEMPERATURE = 288.15 + np.concatenate([[0.0], np.cumsum(LAPSE * np.diff(BASE_M))])
LOWEST_M, HIGHEST_M = -5_000.0, 46_000.0
"""Geometric heights between which the table holds."""


def constant_of(atmosphere: Atmosphere, station_height_m: npt.ArrayLike, terrain_height_m: npt.ArrayLike) -> Float:
    """Refraction constant K of stations and terrain at heights above sea level.

    Parameters
    ----------
    station_height_m, terrain_height_m : (...,) float64, m above sea level

    Returns
    -------
    (...,) float64, rad
    """
    constant = layered_constant if atmosphere == "standard" else refraction_constant
    return constant(station_height_m, terrain_height_m)


def refraction_constant(station_height_m: npt.ArrayLike, terrain_height_m: npt.ArrayLike) -> Float:
    """K of the closed form; parameters as of `constant_of`."""
    H, h = np.asarray(station_height_m) / 1000.0, np.asarray(terrain_height_m) / 1000.0
    upper = 2410.0 * H / (H**2 - 6.0 * H + 250.0)
    lower = 2410.0 * h / (h**2 - 6.0 * h + 250.0) * h / H
    return np.asarray((upper - lower) * 1e-6)


def pressure_and_density(height_m: npt.ArrayLike) -> tuple[Float, Float]:
    """Pressure, Pa, and density, kg/m^3, of the standard atmosphere.

    Parameters
    ----------
    height_m : (...,) float64, m above sea level
    """
    h = np.asarray(height_m, dtype=np.float64)
    H = RADIUS_M * h / (RADIUS_M + h)
    ratios = _ratio(TEMPERATURE[:-1], LAPSE, np.diff(BASE_M))
    base = np.asarray(101_325.0 * np.concatenate([[1.0], np.cumprod(ratios[:-1])]))
    layer = np.clip(np.searchsorted(BASE_M, H, side="right") - 1, 0, len(LAPSE) - 1)
    lapse, above = LAPSE[layer], H - BASE_M[layer]
    T = TEMPERATURE[layer] + lapse * above
    p = base[layer] * _ratio(TEMPERATURE[layer], lapse, above)
    return p, p / (GAS * T)


def layered_constant(station_height_m: npt.ArrayLike, terrain_height_m: npt.ArrayLike) -> Float:
    """K of the layered atmosphere; parameters as of `constant_of`.

    Returns
    -------
    (...,) float64, rad
        0 where both are at one height; NaN beyond the table (5 km below sea level to 46 km).
    """
    H, h = np.broadcast_arrays(np.asarray(station_height_m, np.float64), np.asarray(terrain_height_m, np.float64))
    p_H, rho_H = pressure_and_density(H)
    p_h, rho_h = pressure_and_density(h)
    apart = np.abs(H - h) > 1.0
    mean = (p_h - p_H) / (GRAVITY * np.where(apart, _geopotential(H) - _geopotential(h), 1.0))
    K = KAPPA * np.where(apart, mean - rho_H, 0.5 * (rho_h - rho_H))
    in_layers = (np.minimum(H, h) >= LOWEST_M) & (np.maximum(H, h) <= HIGHEST_M)
    return np.where(in_layers, K, np.nan)


def _geopotential(h: Float) -> Float:
    return np.asarray(RADIUS_M * h / (RADIUS_M + h))


def _ratio(T: Float, lapse: Float, above: Float) -> Float:
    """Pressure over that at the base of the layer."""
    sloped = lapse != 0
    exponent = GRAVITY / (GAS * np.where(sloped, lapse, 1.0))
    return np.where(sloped, (T / (T + lapse * above)) ** exponent, np.exp(-GRAVITY * above / (GAS * T)))
