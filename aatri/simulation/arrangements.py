"""Flights that are no parallel strips: an orbit about a place, hovering, and five cameras looking to all sides.

A camera that looks t from the nadir towards the azimuth a (from east, anticlockwise) has R = Rz(a) Ry(-t) Rz(k): Rz(a)
turns its axes to the azimuth, Ry(-t) tilts the view there, k turns the image.

- `orbit`: rings of stations at equal angles about the middle, one above the other, all looking at it.
- `hover`: places in a square, several images at each; only the irregularities of the flight tell them apart.
- five heads: every station of the flight looks down, ahead, back, left and right.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.arrays import Float

if TYPE_CHECKING:
    from aatri.simulation.flight import FlightPlan
    from aatri.simulation.settings import CameraOptions, FlightOptions

HEADS = {"N": None, "F": 0.0, "B": np.pi, "L": 0.5 * np.pi, "R": -0.5 * np.pi}
"""Azimuth of the view from the direction of flight; None looks down."""

SHOT_S = 2.0
"""Time between two exposures of an orbit or of a hovering camera, s."""


def looking(azimuth_rad: Float, tilt_rad: Float, turn_rad: Float) -> Float:
    """Rotations (n, 3, 3) of cameras to the axes (east, north, up) of their stations."""
    return np.asarray(_about_z(azimuth_rad) @ _turn(-tilt_rad, 2, 0) @ _about_z(turn_rad))


def orbit(flight: FlightOptions, camera: CameraOptions, ground_m: float) -> dict[str, object]:
    """Ids, strips, positions and views of an orbit; lowest and highest plan coordinates of what it looks at."""
    per_ring, rings = flight.images_per_strip, flight.strips
    distance = 1e-3 * camera.principal_distance_mm * flight.scale_number
    ring, place = np.repeat(np.arange(rings), per_ring), np.tile(np.arange(per_ring), rings)
    elevation = np.deg2rad(np.linspace(*flight.orbit_elevations_deg, rings))[ring]
    angle = 2 * np.pi * (place + 0.5 * (ring % 2)) / per_ring
    roll: Float = np.asarray(0.5 * np.pi * (place % 4) * flight.orbit_rolls, dtype=np.float64)
    out = distance * np.cos(elevation)
    position = np.column_stack([out * np.cos(angle), out * np.sin(angle), ground_m + distance * np.sin(elevation)])
    half = flight.orbit_share * distance * min(camera.half_format_mm) / camera.principal_distance_mm
    return {
        "id": [f"{r + 1:02d}{k + 1:03d}" for r, k in zip(ring, place)],
        "strip": [f"ring {r + 1}" for r in ring],
        "sequence": place + 1.0,
        "heading_rad": angle + 0.5 * np.pi,
        "position_m": position,
        "looking": looking(angle + np.pi, 0.5 * np.pi - elevation, -0.5 * np.pi + roll),
        "area": (np.full(2, -half), np.full(2, half)),
    }


def hover(flight: FlightOptions, camera: CameraOptions, ground_m: float, apart_m: float) -> dict[str, object]:
    """Ids, strips, positions and views of a camera that hovers over places in a square."""
    side = int(np.ceil(np.sqrt(flight.strips)))
    place = np.repeat(np.arange(flight.strips), flight.images_per_strip)
    plan = apart_m * (np.column_stack([place % side, place // side]) - 0.5 * (side - 1))
    height = ground_m + 1e-3 * camera.principal_distance_mm * flight.scale_number
    n = len(place)
    half = 0.5 * apart_m * side
    return {
        "id": [f"{p + 1:02d}{k % flight.images_per_strip + 1:02d}" for k, p in enumerate(place)],
        "strip": [f"place {p + 1}" for p in place],
        "sequence": np.arange(n) % flight.images_per_strip + 1.0,
        "heading_rad": np.zeros(n),
        "position_m": np.column_stack([plan, np.full(n, height)]),
        "looking": looking(np.zeros(n), np.zeros(n), np.full(n, np.deg2rad(camera.mounting_deg))),
        "area": (np.full(2, -half), np.full(2, half)),
    }


def with_five_heads(plan: FlightPlan, oblique_deg: float, camera: CameraOptions, ground_m: float) -> FlightPlan:
    """Every station of a plan five times, with the views of the five cameras."""
    n, names = len(plan.id), list(HEADS)
    azimuth = [plan.heading_rad + (HEADS[head] or 0.0) for head in names]
    tilt = np.deg2rad([0.0 if HEADS[head] is None else oblique_deg for head in names])
    turn = np.deg2rad(camera.mounting_deg)
    height = float(plan.position_m[:, 2].mean()) - ground_m
    reach = height * np.tan(np.deg2rad(oblique_deg))  # where the oblique cameras look
    low, high = plan.position_m[:, :2].min(axis=0) - reach, plan.position_m[:, :2].max(axis=0) + reach
    views = [looking(a, np.full(n, t), np.full(n, turn)) for a, t in zip(azimuth, tilt)]
    return replace(
        plan,
        id=[f"{name}{head}" for head in names for name in plan.id],
        strip=[f"{strip}{head}" for head in names for strip in plan.strip],
        sequence=np.tile(plan.sequence, len(names)),
        time_s=np.tile(plan.time_s, len(names)),
        heading_rad=np.tile(plan.heading_rad, len(names)),
        position_m=np.tile(plan.position_m, (len(names), 1)),
        looking=np.concatenate(views),
        area=(low, high),
    )


def _about_z(angle: Float) -> Float:
    return _turn(angle, 0, 1)


def _turn(angle: Float, i: int, j: int) -> Float:
    R = np.tile(np.eye(3), (len(angle), 1, 1))
    R[:, i, i] = R[:, j, j] = np.cos(angle)
    R[:, j, i], R[:, i, j] = np.sin(angle), -np.sin(angle)
    return R
