"""Curves of the method pages, by the formulas that the pages give."""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float
from aatri.report.drawing.picture import ChartAxis, Marks, Picture


def curve(name: str, title: str, across: ChartAxis, up: ChartAxis, curves: dict[str, tuple[Float, Float]]) -> Picture:
    colours = ("blue", "red", "green", "violet")
    marks = [
        Marks("line", np.stack(xy, 1), colours[k], label, width=1.8) for k, (label, xy) in enumerate(curves.items())
    ]
    return Picture(name, title, "", marks, across, up)


def image_refinement() -> Picture:
    """From 4 km above the ground at sea level, c 152 mm: the formulas of the page, K of the closed form."""
    r, c, height_km = np.linspace(0, 160, 81), 152.0, 4.0
    K = 2410 * height_km / (height_km**2 - 6 * height_km + 250) * 1e-6
    curves = {
        "refraction, taken off": (r, 1e3 * K * (r + r**3 / c**2)),
        "earth curvature, put on": (r, 1e3 * height_km * r**3 / (2 * 6371 * c**2)),
        "a lens (k1 = -3e-8 mm⁻²)": (r, 1e3 * 3e-8 * r**3 * (1 - (r / 160) ** 2)),
    }
    across, up = ChartAxis("distance from the principal point, mm", 0, 160), ChartAxis("correction, um", 0, 60)
    return curve("image_refinement", "Corrections of photo coordinates, from 4 km", across, up, curves)


def frames() -> Picture:
    s = np.linspace(0, 20, 81)
    curves = {"height of the tangent plane above the earth, s² / 2R": (s, 1e6 * s**2 / (2 * 6371e3))}
    across, up = ChartAxis("distance from the origin of the frame, km", 0, 20), ChartAxis("m", 0, 35)
    return curve("frames", "Why a plane is not enough", across, up, curves)
