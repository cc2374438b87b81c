"""The flight: planned and true stations of parallel strips and cross strips, of orbits, hovering and oblique heads.

With the image format A (along the flight) and Q (across), scale number m and overlaps p and q in percent

    base = (1 - p/100) A m,    spacing = (1 - q/100) Q m,    flying height above ground = c m.

Strips run east and west in turn, cross strips north and south in turn, one base inside the ends of the strips. The
block is centred at (0, 0). True stations leave the plan by normal deviations along, across and in height; omega and
phi are normal and clipped to the largest tilt; kappa is the flight direction and the mounting with a normal deviation.
Rotations: R = Rx(omega) Ry(phi) Rz(kappa) in the local axes (east, north, up) of the station.

Flights that are no parallel strips are an orbit about a place, hovering, and five cameras looking to all sides. A
camera that looks t from the nadir towards the azimuth a (from east, anticlockwise) has R = Rz(a) Ry(-t) Rz(k): Rz(a)
turns its axes to the azimuth, Ry(-t) tilts the view there, k turns the image.

- `orbit`: rings of stations at equal angles about the middle, one above the other, all looking at it.
- `hover`: places in a square, several images at each; only the irregularities of the flight tell them apart.
- five heads: every station of the flight looks down, ahead, back, left and right.
"""

from dataclasses import dataclass, replace

import numpy as np

from aatri.arrays import Float
from aatri.geometry.rotations import rotation_from_angles
from aatri.simulation.settings import CameraOptions, FlightOptions

TURN_S = 180.0
"""Time between the last exposure of a strip and the first of the next, s."""

HEADS = {"N": None, "F": 0.0, "B": np.pi, "L": 0.5 * np.pi, "R": -0.5 * np.pi}
"""Azimuth of the view from the direction of flight; None looks down."""

SHOT_S = 2.0
"""Time between two exposures of an orbit or of a hovering camera, s."""


@dataclass(frozen=True)
class FlightPlan:
    """Planned stations, in the order of the flight; row k of every array is station k."""

    id: list[str]
    strip: list[str]
    sequence: Float
    time_s: Float
    heading_rad: Float  # of the flight, from east, anticlockwise
    position_m: Float  # (n, 3) E, N, h
    base_m: float
    spacing_m: float
    looking: Float | None = None  # (n, 3, 3) planned rotations; None: down, x along the flight and the mounting
    area: tuple[Float, Float] | None = None  # lowest and highest plan coordinates of what is photographed, m


def planned(flight: FlightOptions, camera: CameraOptions, ground_m: float) -> FlightPlan:
    """The flight plan over terrain of the given mean height."""
    half_x, half_y = camera.half_format_mm
    along, across = (half_x, half_y) if camera.mounting_deg % 180 == 0 else (half_y, half_x)
    base = (1 - flight.forward_overlap / 100) * 2e-3 * along * flight.scale_number
    spacing = (1 - flight.side_overlap / 100) * 2e-3 * across * flight.scale_number
    if flight.arrangement != "strips":
        parts = (
            orbit(flight, camera, ground_m) if flight.arrangement == "orbit" else hover(flight, camera, ground_m, base)
        )
        times = SHOT_S * np.arange(flight.strips * flight.images_per_strip)
        return FlightPlan(**parts, time_s=times, base_m=base, spacing_m=spacing)  # type: ignore[arg-type]
    strips = _strips(flight, base, spacing)
    counts = [len(strip.plan_m) for strip in strips]
    sequence = np.concatenate([np.arange(1, n + 1) for n in counts])
    plan_m = np.concatenate([strip.plan_m for strip in strips])
    height = ground_m + 1e-3 * camera.principal_distance_mm * flight.scale_number
    first = sequence == 1
    elapsed = np.where(first, TURN_S, base / flight.speed_m_per_s)
    plan = FlightPlan(
        id=_image_ids(flight.strips, counts),
        strip=[strip.id for strip, n in zip(strips, counts) for _ in range(n)],
        sequence=sequence.astype(np.float64),
        time_s=np.round(np.cumsum(elapsed) - elapsed[0], 3),
        heading_rad=np.repeat([strip.heading_rad for strip in strips], counts),
        position_m=np.column_stack([plan_m, np.full(len(plan_m), height)]),
        base_m=base,
        spacing_m=spacing,
    )
    return plan if flight.five_heads_deg is None else with_five_heads(plan, flight.five_heads_deg, camera, ground_m)


@dataclass(frozen=True)
class _Strip:
    id: str
    plan_m: Float
    heading_rad: float


def _strips(flight: FlightOptions, base_m: float, spacing_m: float) -> list[_Strip]:
    """All strips, in the order in which they are flown."""
    length, width = (flight.images_per_strip - 1) * base_m, (flight.strips - 1) * spacing_m
    cross_images = flight.images_per_cross_strip or max(2, round(width / base_m) + 1)
    inside = max(length / 2 - base_m, 0.0) if flight.cross_strips > 1 else 0.0
    strips = []
    for s, north in enumerate(np.linspace(-width / 2, width / 2, flight.strips)):
        run = _run(flight.images_per_strip, base_m, backwards=s % 2 == 1)
        plan_m = np.stack([run, np.full(len(run), north)], axis=1)
        strips.append(_Strip(str(s + 1), plan_m, np.pi * (s % 2)))
    for s, east in enumerate(np.linspace(-inside, inside, flight.cross_strips)):
        run = _run(cross_images, base_m, backwards=s % 2 == 1)
        plan_m = np.stack([np.full(len(run), east), run], axis=1)
        strips.append(_Strip(f"C{s + 1}", plan_m, np.pi * (s % 2 + 0.5)))
    return strips


def _run(images: int, base_m: float, backwards: bool) -> Float:
    run = (np.arange(images, dtype=np.float64) - (images - 1) / 2) * base_m
    return run[::-1] if backwards else run


def _image_ids(strips: int, counts: list[int]) -> list[str]:
    """`0101`: strip and place in it; `C101` in cross strips; more digits where there is more to count."""
    digits, places = max(2, len(str(strips))), max(2, len(str(max(counts))))
    heads = [f"{s + 1:0{digits}d}" if s < strips else f"C{s - strips + 1:0{digits - 1}d}" for s in range(len(counts))]
    return [f"{head}{k + 1:0{places}d}" for head, n in zip(heads, counts) for k in range(n)]


def flown(
    plan: FlightPlan, flight: FlightOptions, camera: CameraOptions, rng: np.random.Generator
) -> tuple[Float, Float]:
    """True stations: (n, 3) positions E, N, h, m, and (n, 3, 3) rotations to the local axes of the station."""
    n = len(plan.id)
    deviation = rng.standard_normal((n, 3)) * flight.position_sigma_m
    cos, sin = np.cos(plan.heading_rad), np.sin(plan.heading_rad)
    shift = np.stack(
        [cos * deviation[:, 0] - sin * deviation[:, 1], sin * deviation[:, 0] + cos * deviation[:, 1], deviation[:, 2]],
        axis=1,
    )
    tilts = np.deg2rad(flight.tilt_sigma_deg) * rng.standard_normal((n, 2))
    size = np.hypot(tilts[:, 0], tilts[:, 1])
    largest = np.deg2rad(flight.tilt_max_deg)
    tilts *= np.where(size > largest, largest / np.maximum(size, 1e-300), 1.0)[:, None]
    if plan.looking is not None:
        turns = np.column_stack([tilts, np.deg2rad(flight.kappa_sigma_deg) * rng.standard_normal(n)])
        return plan.position_m + shift, np.asarray(rotation_from_angles(turns) @ plan.looking)
    kappa = plan.heading_rad + np.deg2rad(camera.mounting_deg + flight.kappa_sigma_deg * rng.standard_normal(n))
    return plan.position_m + shift, rotation_from_angles(np.column_stack([tilts, kappa]))


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
