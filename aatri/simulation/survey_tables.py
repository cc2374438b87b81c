"""Geodetic observations with their errors as the tables of a block, in canonical order.

Coordinate differences of a baseline correlate by 0.3; all other errors are independent.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from aatri.arrays import Float, Int, Text
from aatri.artifacts import block as b
from aatri.artifacts.builder import geodetic_order
from aatri.simulation.measured import Disturbance, gross_errors
from aatri.simulation.settings import NoiseOptions
from aatri.simulation.survey import Sighted

CORRELATION = 0.3
AXES = ("dX", "dY", "dZ")
ANGLES = ("direction", "azimuth", "angle", "zenith")


def surveyed(
    sights: list[Sighted], point_ids: Text, image_ids: Text, disturbance: Disturbance
) -> tuple[b.Geodetic, b.GeodeticCovariances, list[tuple[Any, ...]]]:
    """Tables of the observations, and the gross errors in them.

    Parameters
    ----------
    point_ids, image_ids : (n,) str
        In the order of the simulation.
    """
    if not sights:
        return b.Geodetic.empty(), b.GeodeticCovariances.empty(), []
    sigma = np.concatenate([np.full(len(s.value), sigma_of(s.type, disturbance.noise)) for s in sights])
    noise = disturbance.noise.factor * sigma * _standard_normal(sights, disturbance.streams["survey_error"])
    chosen, errors = gross_errors(
        disturbance.gross.geodetic,
        sigma[:, None],
        disturbance.gross.size_sigmas,
        disturbance.streams["gross_survey"],
        "geodetic",
    )
    noise[chosen] += errors[:, 0]
    lengths = [len(s.value) for s in sights]
    value = np.concatenate([s.value for s in sights]) + noise
    angular = np.repeat([s.type in ANGLES[:3] for s in sights], lengths)
    value = np.where(angular, value % (2 * np.pi), value)
    heights = np.concatenate([s.heights_m for s in sights])
    table = b.Geodetic.of(
        type=_each(sights, lambda s: s.type),
        start=_each(sights, lambda s: point_ids[s.station]),
        end=_each(sights, lambda s: (image_ids if s.to_image else point_ids)[s.target]),
        via=_each(sights, lambda s: np.where(s.vertex >= 0, point_ids[s.vertex], "")),
        end_kind=_each(sights, lambda s: "image" if s.to_image else "point"),
        value=value,
        sigma=sigma,
        set=_each(sights, lambda s: [f"S{k + 1:04d}" if k >= 0 else "" for k in s.set]),
        group=_each(sights, lambda s: s.group),
        start_height_m=heights[:, 0],
        end_height_m=heights[:, 1],
        reduced=_each(sights, lambda s: s.reduced),
    )
    order = geodetic_order(table)
    kind = _each(sights, lambda s: s.kind)[order]
    place = np.argsort(order)
    return (
        table.take(order),
        _covariances(sights, place, disturbance.noise),
        _gross_by_kind(kind, place[chosen], errors),
    )


def sigma_of(type_: str, noise: NoiseOptions) -> float:
    """Standard deviation of a type, m or rad."""
    if type_ in ANGLES:
        return float(np.radians(noise.angle_deg))
    return {"height_difference": noise.height_difference_m}.get(
        type_, noise.baseline_m if type_ in AXES else noise.distance_m
    )


def _each(sights: list[Sighted], text_of: Any) -> Text:
    """A text column, part by part."""
    parts = [np.broadcast_to(np.asarray(text_of(s), dtype=np.str_), len(s.value)) for s in sights]
    return np.asarray(np.concatenate(parts), dtype=np.str_)


def _standard_normal(sights: list[Sighted], rng: np.random.Generator) -> Float:
    """Errors of unit variance: independent, but for those of a baseline."""
    n = sum(len(s.value) for s in sights)
    e = rng.standard_normal(n)
    common = rng.standard_normal(n)
    for first, size in _baselines(sights):
        shared = common[first : first + size]
        for k in range(3):
            at = slice(first + k * size, first + (k + 1) * size)
            e[at] = np.sqrt(1 - CORRELATION) * e[at] + np.sqrt(CORRELATION) * shared
    return e


def _baselines(sights: list[Sighted]) -> Iterator[tuple[int, int]]:
    """First row and number of the baselines: three parts of equal length."""
    first = 0
    for s in sights:
        if s.type == AXES[0]:
            yield first, len(s.value)
        first += len(s.value)


def _covariances(sights: list[Sighted], place: Int, noise: NoiseOptions) -> b.GeodeticCovariances:
    pairs = [
        np.sort(place[[first + i * size + k, first + j * size + k]])
        for first, size in _baselines(sights)
        for k in range(size)
        for i in range(3)
        for j in range(i + 1, 3)
    ]
    if not pairs:
        return b.GeodeticCovariances.empty()
    a, z = np.array(sorted(map(tuple, pairs))).T
    return b.GeodeticCovariances.of(row_a=a, row_b=z, value=CORRELATION * noise.baseline_m**2)


def _gross_by_kind(kind: Text, chosen: Int, errors: Float) -> list[tuple[Any, ...]]:
    """Gross errors by kind, rows ascending."""
    gross = []
    for name in dict.fromkeys(kind[np.sort(chosen)].tolist()):
        rows_of_kind = np.flatnonzero(kind[chosen] == name)
        rows_of_kind = rows_of_kind[np.argsort(chosen[rows_of_kind])]
        gross.append((name, chosen[rows_of_kind], errors[rows_of_kind]))
    return gross
