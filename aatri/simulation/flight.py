"""The flight: planned and true stations of parallel strips and cross strips.

With the image format A (along the flight) and Q (across), scale number m and overlaps p and q in percent

    base = (1 - p/100) A m,    spacing = (1 - q/100) Q m,    flying height above ground = c m.

Strips run east and west in turn, cross strips north and south in turn, one base inside the ends of the strips. The
block is centred at (0, 0). True stations leave the plan by normal deviations along, across and in height; omega and
phi are normal and clipped to the largest tilt; kappa is the flight direction and the mounting with a normal deviation.
Rotations: R = Rx(omega) Ry(phi) Rz(kappa) in the local axes (east, north, up) of the station.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.geometry.rotations import rotation_from_angles
from aatri.simulation.settings import Camera, Flight

Float = npt.NDArray[np.float64]
TURN_S = 180.0
"""Time between the last exposure of a strip and the first of the next, s."""


@dataclass(frozen=True)
class Plan:
    """Planned stations, in the order of the flight; row k of every array is station k."""

    id: list[str]
    strip: list[str]
    sequence: Float
    time_s: Float
    heading_rad: Float  # of the flight, from east, anticlockwise
    position_m: Float  # (n, 3) E, N, h
    base_m: float
    spacing_m: float


def planned(flight: Flight, camera: Camera, ground_m: float) -> Plan:
    """The flight plan over terrain of the given mean height."""
    half_x, half_y = camera.half_format_mm
    along, across = (half_x, half_y) if camera.mounting_deg % 180 == 0 else (half_y, half_x)
    to_ground = 2e-3 * flight.scale_number
    base = (1 - flight.forward_overlap / 100) * along * to_ground
    spacing = (1 - flight.side_overlap / 100) * across * to_ground
    length, width = (flight.images_per_strip - 1) * base, (flight.strips - 1) * spacing
    cross_images = flight.images_per_cross_strip or max(2, round(width / base) + 1)
    cross_at = (
        np.linspace(base - length / 2, length / 2 - base, flight.cross_strips) if flight.cross_strips > 1 else [0.0]
    )
    axes = [_strip(flight.images_per_strip, base, 0.0, (s - (flight.strips - 1) / 2) * spacing, s % 2)
            for s in range(flight.strips)]  # fmt: skip
    axes += [_strip(cross_images, base, np.pi / 2, -cross_at[s], s % 2) for s in range(flight.cross_strips)]
    names = [str(s + 1) for s in range(flight.strips)] + [f"C{s + 1}" for s in range(flight.cross_strips)]
    strip_digits, image_digits = (
        len(str(max(flight.strips, 10))),
        len(str(max(flight.images_per_strip, cross_images, 10))),
    )
    ids = [f"{name.zfill(strip_digits)}{k + 1:0{image_digits}d}" for name, (plan, _) in zip(names, axes)
           for k in range(len(plan))]  # fmt: skip
    counts = [len(plan) for plan, _ in axes]
    sequence = np.concatenate([np.arange(1.0, n + 1) for n in counts])
    strip_row = np.repeat(np.arange(len(counts)), counts)
    gaps = np.where(np.arange(len(sequence)) == 0, 0.0, np.where(sequence == 1, TURN_S, base / flight.speed))
    height = ground_m + 1e-3 * camera.principal_distance_mm * flight.scale_number
    plan_m = np.concatenate([plan for plan, _ in axes])
    return Plan(
        id=ids,
        strip=[names[row] for row in strip_row],
        sequence=sequence,
        time_s=np.round(np.cumsum(gaps), 3),
        heading_rad=np.array([axes[row][1] for row in strip_row]),
        position_m=np.column_stack([plan_m, np.full(len(plan_m), height)]),
        base_m=base,
        spacing_m=spacing,
    )


def _strip(images: int, base_m: float, azimuth_rad: float, offset_m: float, backwards: int) -> tuple[Float, float]:
    """Plan positions of one strip in the order of its flight, and its heading."""
    run = (np.arange(images) - (images - 1) / 2) * base_m
    along, left = _directions(azimuth_rad)
    plan = run[:, None] * along + offset_m * left
    return (plan[::-1], azimuth_rad + np.pi) if backwards else (plan, azimuth_rad)


def _directions(azimuth_rad: float) -> tuple[Float, Float]:
    along = np.round([np.cos(azimuth_rad), np.sin(azimuth_rad)])  # strips run along the axes
    return along, np.array([-along[1], along[0]])


def flown(plan: Plan, flight: Flight, camera: Camera, rng: np.random.Generator) -> tuple[Float, Float]:
    """True stations: (n, 3) positions E, N, h, m, and (n, 3, 3) rotations to the local axes of the station."""
    n = len(plan.id)
    deviation = rng.standard_normal((n, 3)) * flight.position_sigma_m
    cos, sin = np.cos(plan.heading_rad), np.sin(plan.heading_rad)
    shift = np.stack([cos * deviation[:, 0] - sin * deviation[:, 1],
                      sin * deviation[:, 0] + cos * deviation[:, 1], deviation[:, 2]], axis=1)  # fmt: skip
    tilts = np.deg2rad(flight.tilt_sigma_deg) * rng.standard_normal((n, 2))
    size = np.hypot(tilts[:, 0], tilts[:, 1])
    largest = np.deg2rad(flight.tilt_max_deg)
    tilts *= np.where(size > largest, largest / np.maximum(size, 1e-300), 1.0)[:, None]
    kappa = plan.heading_rad + np.deg2rad(camera.mounting_deg + flight.kappa_sigma_deg * rng.standard_normal(n))
    return plan.position_m + shift, rotation_from_angles(np.column_stack([tilts, kappa]))
