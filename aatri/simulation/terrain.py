"""The terrain: a sum of plane waves with random directions and phases,

    z(E, N) = mean + relief / n * sum_k cos(w_k . (E, N) + f_k),

so that heights stay within mean +- relief. Wavelengths run from the shortest one to four times that.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float

WAVES = 6


@dataclass(frozen=True)
class Surface:
    """Heights as a function of the plan position."""

    mean_m: float
    amplitude_m: float
    waves_rad_per_m: Float
    phases_rad: Float

    def height_m(self, plan_m: Float) -> Float:
        """Height above sea level at (n, 2) plan positions, m."""
        height = np.full(len(plan_m), self.mean_m)
        for wave, phase in zip(self.waves_rad_per_m, self.phases_rad):
            height += self.amplitude_m * np.cos(plan_m @ wave + phase)
        return height


def random_surface(mean_m: float, relief_m: float, wavelength_m: float, rng: np.random.Generator) -> Surface:
    """A surface with heights within mean +- relief, m."""
    direction = rng.uniform(0.0, 2 * np.pi, WAVES)
    length = wavelength_m * 4.0 ** rng.uniform(0.0, 1.0, WAVES)
    waves = 2 * np.pi / length[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    return Surface(mean_m, relief_m / WAVES, waves, rng.uniform(0.0, 2 * np.pi, WAVES))
