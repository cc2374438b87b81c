"""Systematic parts of residuals: positions shifted in the axes of the camera or of the ground, distances of one scale.

    shift = mean of v,  v = X0 + R a - X_observed, or R'v        scale = mean of v / d

A forgotten lever arm or a delay of the clock shifts positions along the axes of the camera, whatever the heading;
another datum shifts them along those of the ground; a receiver that starts anew shifts those of a strip; distances
reduced to the map have a common scale. Each is told where it is significant and explains most of the squares.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float, Text
from aatri.artifacts.block import Block
from aatri.notes import Note
from aatri.observations.poses import POINT, POSE
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bundle.result import AdjustedObservations, BundleResult

GEODETIC = "distance"
"""Kind of the slope distances."""

FEWEST = 4
SIGNIFICANT = 4.0
MOST_OF_IT = 0.5
"""Share of the squared residuals that the systematic part explains."""


def strip_of_images(block: Block) -> Text:
    """Ids of the strips of all images, empty without."""
    return np.append(block.strips.id, "")[block.images.strip]


def systematic_notes(result: BundleResult, strip: Text) -> list[Note]:
    """Warnings of systematic residuals of positions and distances; `strip` names that of every image."""
    notes = []
    for found in result.observations:
        touches = found.observed.records.touches
        if found.observed.kind == POSITION and len(touches) == 1 and touches[0][0] == POSE:
            notes += _shift(found, result) or _of_strips(found, result, strip)
        elif found.observed.kind == GEODETIC and [group for group, _ in touches] == [POINT, POINT]:
            notes += _scale(found, result)  # not of correlated ones, which are records of several distances
    return notes


def _shift(found: AdjustedObservations, result: BundleResult) -> list[Note]:
    rows = np.flatnonzero(found.used)
    v = found.observed.records.evaluate(result.adjusted.state, rows)[0]
    image = found.observed.records.touches[0][1][rows]
    v = v[np.isfinite(v).all(axis=1)]
    if len(v) < FEWEST or len(v) != len(rows):
        return []
    turned = np.einsum("nji,nj->ni", result.poses.ground_from_image[image], v)
    choices = {
        "of the camera": (turned, "is the lever arm (`lever_arm`) or the clock wrong?"),
        "of the ground": (v, "do positions and control have one datum and one surface of heights?"),
    }
    axes = max(choices, key=lambda name: _explained(choices[name][0]))
    values, question = choices[axes]
    mean, sigma = _mean(values)
    if _explained(values) < MOST_OF_IT or not (np.abs(mean) > SIGNIFICANT * sigma).any():
        return []
    told = ", ".join(f"{m:.3f} (+- {s:.3f})" for m, s in zip(-mean, sigma))
    return [Note("warning", f"observed positions are shifted by {told} m along the axes {axes}: {question}")]


def _of_strips(found: AdjustedObservations, result: BundleResult, strip: Text) -> list[Note]:
    """Strips whose positions, rejected ones too, are off together."""
    records, rows = found.observed.records, found.rows
    v = records.evaluate(result.adjusted.state, rows)[0]
    rows, v = rows[np.isfinite(v).all(axis=1)], v[np.isfinite(v).all(axis=1)]
    names = strip[records.touches[0][1][rows]]
    groups = {name: np.flatnonzero(names == name) for name in np.unique(names).tolist()}
    groups = {name: mine for name, mine in groups.items() if len(mine) >= FEWEST and name}
    if len(groups) < 2:
        return []
    total = float((v**2).sum())
    explained = sum(len(mine) * float((v[mine].mean(axis=0) ** 2).sum()) for mine in groups.values())
    if not explained > MOST_OF_IT * total:
        return []
    told, sigma = {}, records.sigmas()[rows]
    for name, mine in groups.items():
        mean, scatter = _mean(v[mine])
        known = np.sqrt((sigma[mine] ** 2).mean(axis=0) / len(mine))
        if (np.abs(mean) > SIGNIFICANT * np.maximum(scatter, known)).any():
            told[name] = mean
    largest = max((float(np.linalg.norm(mean)) for mean in told.values()), default=0.0)
    shifts = [
        f"{name} by {', '.join(f'{-m:.3f}' for m in mean)} m"
        for name, mean in told.items() if np.linalg.norm(mean) > 0.5 * largest
    ]  # fmt: skip
    if not shifts:
        return []
    return [Note("warning", "observed positions of whole strips are off together, against the rest of the block: strip "
                 f"{'; strip '.join(shifts)}: `positions: {{drift: shift, per: strip}}` estimates it")]  # fmt: skip


def _scale(found: AdjustedObservations, result: BundleResult) -> list[Note]:
    rows = np.flatnonzero(found.used)
    records = found.observed.records
    v = records.evaluate(result.adjusted.state, rows)[0][:, 0]
    a, b = (block[rows] for _, block in records.touches)
    length = np.linalg.norm(result.xyz_m[a] - result.xyz_m[b], axis=1)
    ratio = (v / length)[:, None]
    if len(ratio) < FEWEST or not np.isfinite(ratio).all():
        return []
    mean, sigma = _mean(ratio)
    if _explained(ratio) < MOST_OF_IT or abs(mean[0]) <= SIGNIFICANT * sigma[0]:
        return []
    ppm = -1e6 * float(mean[0])
    how = "long" if ppm > 0 else "short"
    return [Note("warning", f"distances are {abs(ppm):.0f} ppm (+- {1e6 * float(sigma[0]):.0f}) too {how} for the rest "
                 "of the block: were they reduced to a map or to another height?")]  # fmt: skip


def _mean(values: Float) -> tuple[Float, Float]:
    n = len(values)
    spread = values - values.mean(axis=0)
    return values.mean(axis=0), np.sqrt((spread**2).sum(axis=0) / (n * (n - 1)))


def _explained(values: Float) -> float:
    """Share of the squares that the mean explains."""
    total = float((values**2).sum())
    return len(values) * float((values.mean(axis=0) ** 2).sum()) / total if total > 0 else 0.0
