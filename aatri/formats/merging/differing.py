"""Rows of the tables of two blocks that are of one thing and are not equal, table by table."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import (
    APPROXIMATE,
    CONTROL,
    NO_ROLE,
    OBSERVED_VALUE,
    Exterior,
    FiducialPoints,
    GroundPoints,
    Images,
    MeasuredPoints,
)
from aatri.formats.merging.rows import Reconciliation, apart, mean_of_two, stated, values_equal, with_rows
from aatri.ids import printable
from aatri.tables.schema import Table, columns_of

T = TypeVar("T", bound=Table)
Measured = TypeVar("Measured", MeasuredPoints, FiducialPoints)


@dataclass(frozen=True)
class DifferingRows:
    """Rows of two tables that are of one thing."""

    first: Int
    second: Int
    """(n,), as `first`."""
    named: Callable[[int], str]
    """Row of the second -> what messages call it."""
    where: Callable[[int], str]
    """Row of the second -> where it was read."""


AXES = ("X", "Y", "Z")


def excluded(
    first: T,
    second: T,
    rows: DifferingRows,
    rules: Reconciliation,
    beside: Sequence[str] = (),
    *,
    fill: bool = False,
) -> T:
    """Values that exclude each other: every column that differs is told; with `fill` only where both are given."""
    for name, declared in columns_of(type(first)).items():
        if name in beside or not declared.digest:
            continue
        a, b = getattr(first, name)[rows.first], getattr(second, name)[rows.second]
        different = ~values_equal(a, b)
        if fill:
            different &= stated(first, name)[rows.first] & stated(second, name)[rows.second]
        for k in np.flatnonzero(different).tolist():
            j = int(rows.second[k])
            rules.conflict(f"{rows.named(j)}: {name}", (a[k], b[k]), rows.where(j))
    return first


def images(first: Images, second: Images, rows: DifferingRows, rules: Reconciliation) -> Images:
    """What one block has not been given of an image is taken from the other; an image that one uses is used."""
    excluded(first, second, rows, rules, ("id", "active"), fill=True)
    for name in ("strip", "sequence", "time_s", "flight", "session", "rig", "member"):
        lacking = ~stated(first, name)[rows.first]
        if lacking.any():
            first = with_rows(first, rows.first[lacking], **{name: getattr(second, name)[rows.second[lacking]]})
    return with_rows(first, rows.first, active=first.active[rows.first] | second.active[rows.second])


def measured(
    first: Measured,
    second: Measured,
    rows: DifferingRows,
    rules: Reconciliation,
    kind: str,
    mm_per_unit: Float,
) -> Measured:
    """Image points and fiducials that both blocks have measured, in units of so many mm, by image."""
    sigma = np.hypot(first.sigma_mm[rows.first], second.sigma_mm[rows.second])
    gap = np.abs(first.xy[rows.first] - second.xy[rows.second]) * mm_per_unit[first.image[rows.first]]
    worst = (gap / np.where(sigma > 0, sigma, np.nan)).max(axis=1)
    weights = []
    for table, own in ((first, rows.first), (second, rows.second)):
        weight = np.square(1.0 / table.sigma_mm[own])
        if isinstance(table, MeasuredPoints):
            weight[~table.active[own]] = 0.0
        weights.append(weight)
    merged = np.zeros(len(worst), dtype=bool)
    for k, j in enumerate(rows.second.tolist()):
        used = [bool(weight[k].all()) for weight in weights]
        merged[k] = any(used) and (not all(used) or rules.measured(kind, rows.named(j), float(worst[k]), rows.where(j)))
    i, j = rows.first[merged], rows.second[merged]
    p, q = (w[merged] for w in weights)
    xy = (p * first.xy[i] + q * second.xy[j]) / (p + q)
    first = with_rows(first, i, xy=xy, sigma_mm=1.0 / np.sqrt(p + q))
    return with_rows(first, i, active=True) if isinstance(first, MeasuredPoints) else first


def ground(first: GroundPoints, second: GroundPoints, rows: DifferingRows, rules: Reconciliation) -> GroundPoints:
    """Given coordinates of a point in both blocks."""
    for i, j in zip(rows.first.tolist(), rows.second.tolist()):
        name, where = rows.named(j), rows.where(j)
        roles = [t.role[r] for t, r in ((first, i), (second, j))]
        has_coordinate = [np.isfinite(t.xyz_m[r]) & (t.role[r] != NO_ROLE) for t, r in ((first, i), (second, j))]
        firm = [s & (r != APPROXIMATE) for s, r in zip(has_coordinate, roles)]
        both = firm[0] & firm[1]
        if (both & (roles[0] != roles[1])).any():
            words = [("control" if (r[both] == CONTROL).all() else "check") for r in roles]
            rules.conflict(f"role of ground point {printable(name)}", words, where)
            continue
        # Start values give way to coordinates with a role, and to the first where there are none.
        used = [firm[k] | (has_coordinate[k] & ~firm[1 - k] & ((k == 0) | ~has_coordinate[0])) for k in (0, 1)]
        values = first.xyz_m[i], first.covariance_m2[i], used[0]
        other = second.xyz_m[j], second.covariance_m2[j], used[1]
        if not _agree(values, other, ("ground point", name, AXES), where, rules):
            continue
        x, C = mean_of_two(*values, other) if both.any() else _either(values, other)
        role = np.where(used[1] & ~used[0], roles[1], roles[0])
        datum = first.datum[i] | second.datum[j]
        first = with_rows(first, np.array([i]), xyz_m=x, covariance_m2=C, role=role, datum=datum)
    return first


def exterior(first: Exterior, second: Exterior, rows: DifferingRows, rules: Reconciliation) -> Exterior:
    """Given positions and attitudes of an image in both blocks."""
    for i, j in zip(rows.first.tolist(), rows.second.tolist()):
        name, where = rows.named(j), rows.where(j)
        own = np.array([i])
        for what in ("position", "angle"):
            column, use = ("position_m", "position_use") if what == "position" else ("angles_rad", "angle_use")
            observed = [getattr(t, use)[r] == OBSERVED_VALUE for t, r in ((first, i), (second, j))]
            values, other = (_given(t, r, column) for t, r in ((first, i), (second, j)))
            if observed[0] and observed[1]:
                labels = AXES if what == "position" else ("a1", "a2", "a3")
                for key in ("refers_to", "drift_group") if what == "position" else ():
                    if getattr(first, key)[i] != getattr(second, key)[j]:
                        pair = getattr(first, key)[i], getattr(second, key)[j]
                        rules.conflict(f"position of image {printable(name)}: {key}", pair, where)
                if not _agree(values, other, (f"{what} of image", name, labels), where, rules):
                    continue
                x, C = mean_of_two(*values, other)
            elif observed[1] or not values[2].any():
                x, C = other[0], other[1]
                shared = ("refers_to", "drift_group") if what == "position" else ()
                more = {key: getattr(second, key)[j] for key in shared}
                first = with_rows(first, own, **{use: getattr(second, use)[j]}, **more)
            else:
                continue
            if what == "position":
                first = with_rows(first, own, position_m=x, position_covariance_m2=C)
            else:
                first = with_rows(first, own, angles_rad=x, angle_sigma_rad=np.sqrt(np.diagonal(C)))
    return first


def _given(rows: Exterior, k: int, column: str) -> tuple[Float, Float, Bool]:
    """Values of a row, their covariance, and which are given."""
    if column == "position_m":
        values, C = rows.position_m[k], rows.position_covariance_m2[k]
    else:
        values, C = rows.angles_rad[k], np.diag(np.square(rows.angle_sigma_rad[k]))
    return values, C, np.isfinite(values)


def _agree(
    values: tuple[Float, Float, Bool],
    other: tuple[Float, Float, Bool],
    what: tuple[str, str, Sequence[str]],
    where: str,
    rules: Reconciliation,
) -> bool:
    """Whether two sets of coordinates are to be one; what excludes each other is told."""
    (kind, name, labels), (x, _, used), (y, _, also) = what, values, other
    sigmas, exact = apart(*values, other)
    different = (used & also) & ~values_equal(x, y)
    worst = float(sigmas[different].max(initial=0.0))
    for k in np.flatnonzero(different & (exact | (sigmas > rules.sigmas))).tolist():
        more = f": {x[k] - y[k]:+.4g} apart"
        more += ", exact" if exact[k] else f", {sigmas[k]:.1f} standard deviations of the difference"
        rules.conflict(f"{kind} {printable(name)}: {labels[k]}", (float(x[k]), float(y[k])), where, more)
    if (different & (exact | (sigmas > rules.sigmas))).any():
        return False
    return not different.any() or rules.measured(kind, name, worst, where)


def _either(values: tuple[Float, Float, Bool], other: tuple[Float, Float, Bool]) -> tuple[Float, Float]:
    """Coordinates of which each is given in one alone."""
    (x, C, used), (y, D, also) = values, other
    both = np.outer(used, used)
    return np.where(used, x, np.where(also, y, x)), np.where(both, C, np.where(np.outer(also, also), D, 0.0))
