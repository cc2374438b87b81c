"""Where the loci of a point meet: rays, circles, circles of the angle under which two points are seen."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float
from aatri.orientation.network.limits import LEAST_MISFIT, MOST_LOCI, SAME_PLACE


@dataclass(frozen=True)
class Locus:
    """A ray or a circle on which a point lies."""

    centre: Float
    """(2,), m. Of a circle, or where a ray begins."""
    radius_m: float = float("nan")
    """NaN for a ray."""
    bearing_rad: float = float("nan")
    """Of a ray, clockwise from north."""
    seen: tuple[Float, Float, float] | None = None

    @staticmethod
    def circle(centre: Float, radius_m: float) -> Locus:
        """At a distance from a known point."""
        return Locus(centre, radius_m)

    @staticmethod
    def ray(centre: Float, bearing_rad: float) -> Locus:
        """In a direction from a known point."""
        return Locus(centre, bearing_rad=bearing_rad)

    @staticmethod
    def seeing(a: Float, b: Float, angle_rad: float) -> Locus:
        """Where a and b are seen under an angle, clockwise from a to b: M + n |AB| / 2 cot(angle), n across AB."""
        half = 0.5 * (b - a)
        sine = np.sin(angle_rad)
        cotangent = np.cos(angle_rad) / (sine if abs(sine) > 1e-9 else 1e-9)
        centre = 0.5 * (a + b) + np.array([half[1], -half[0]]) * cotangent
        return Locus(centre, float(np.linalg.norm(a - centre)), seen=(a, b, angle_rad))

    def misfit(self, x: Float) -> float:
        """By how much a place misses what was measured, as an angle or a share of the distance."""
        if self.seen is not None:
            a, b, angle = self.seen
            return abs(_around(_bearing(b - x) - _bearing(a - x) - angle))
        away = x - self.centre
        if np.isfinite(self.radius_m):
            return abs(float(np.linalg.norm(away)) - self.radius_m) / self.radius_m
        return abs(_around(_bearing(away) - self.bearing_rad))


def fitting_point(loci: list[Locus]) -> tuple[Float, float] | None:
    """The meeting point of two of the loci that fits all of them best, and how many times better than any other place.

    None where none of them meet.
    """
    loci = sorted(loci, key=lambda locus: locus.seen is not None)[:MOST_LOCI]
    candidates = [x for a, b in itertools.combinations(loci, 2) for x in _meeting(a, b)]
    candidates = [x for x in candidates if np.isfinite(x).all() and not any(_at_mark(x, locus) for locus in loci)]
    if not candidates:
        return None
    size = [sum(min(locus.misfit(x), 1.0) for locus in loci) for x in candidates]
    best = candidates[int(np.argmin(size))]
    extent = max(float(np.linalg.norm(best - locus.centre)) for locus in loci)
    others = [s for x, s in zip(candidates, size) if np.linalg.norm(x - best) > SAME_PLACE * extent]
    return best, min(others, default=np.inf) / (min(size) + LEAST_MISFIT)


def _at_mark(x: Float, locus: Locus) -> bool:
    """Two circles of angles meet in the point they both see, too."""
    if locus.seen is None:
        return False
    a, b, _ = locus.seen
    return min(float(np.linalg.norm(x - a)), float(np.linalg.norm(x - b))) < 1e-6 * float(np.linalg.norm(b - a))


def _meeting(a: Locus, b: Locus) -> list[Float]:
    if np.isfinite(a.radius_m) and np.isfinite(b.radius_m):
        return _circles(a, b)
    if np.isfinite(a.radius_m):
        a, b = b, a
    u = np.array([np.sin(a.bearing_rad), np.cos(a.bearing_rad)])
    if np.isfinite(b.radius_m):
        to, along = b.centre - a.centre, float((b.centre - a.centre) @ u)
        root = float(b.radius_m**2 - (to @ to - along**2))
        if root < -((SAME_PLACE * b.radius_m) ** 2):
            return []
        half = float(np.sqrt(max(root, 0.0)))
        return [a.centre + s * u for s in (along - half, along + half) if s > 0]
    w = np.array([np.sin(b.bearing_rad), np.cos(b.bearing_rad)])
    across = u[0] * w[1] - u[1] * w[0]
    if abs(across) < 1e-3:
        return []
    to = b.centre - a.centre
    s, t = (to[0] * w[1] - to[1] * w[0]) / across, (to[0] * u[1] - to[1] * u[0]) / across
    return [a.centre + s * u] if s > 0 and t > 0 else []


def _circles(a: Locus, b: Locus) -> list[Float]:
    to = b.centre - a.centre
    distance = float(np.linalg.norm(to))
    if distance < 1e-9 * (a.radius_m + b.radius_m):
        return []
    along = (distance**2 + a.radius_m**2 - b.radius_m**2) / (2 * distance)
    root = a.radius_m**2 - along**2
    if root < -((10 * SAME_PLACE * a.radius_m) ** 2):
        return []
    u = to / distance
    across = float(np.sqrt(max(root, 0.0))) * np.array([-u[1], u[0]])
    return [a.centre + along * u + across, a.centre + along * u - across]


def _bearing(line: Float) -> float:
    return float(np.arctan2(line[0], line[1]))


def _around(angle: float) -> float:
    return float(angle - 2 * np.pi * np.round(angle / (2 * np.pi)))
