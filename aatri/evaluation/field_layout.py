"""Layout of a three-dimensional test field, held against the rules of the close-range notes.

1. some tens of targets known in three coordinates;
2. evenly spread: seen along its shortest axis, none of 3 x 3 cells of the field is empty, and the targets crowd no more
   than if they were thrown at random: X2 = sum (n_k - n p_k)^2 / (n p_k) is below chi2(8) at `ALARM`, p_k the cell's
   share of the field;
3. extended along all three axes: a flat field does not separate c from the distance;
4. room for the cameras: they stand outside of the targets;
5. two or more stable pillars, from which the targets are measured and measured again.

Axes are the principal ones of the targets, extents go from the 5th to the 95th percentile.

Source: lecture notes on close range, 5.4 (A1508). They give no figures but the tens of targets and the two pillars; how
deep a field is to be is a choice (the simulated field has 0.18 of its length).
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay
from scipy.special import chdtri

from aatri.adjustment.statistics.limits import ALARM
from aatri.arrays import Float, Int
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.evaluation import Differences, Evaluation, Figures
from aatri.errors import InputError
from aatri.ids import several

CELLS = 3

INSIDE = 0.9
"""Share of an axis between the 5th and the 95th percentile; the rest falls to the outer cells."""

SIGHTS = ("direction", "angle", "zenith", "azimuth")


@dataclass(frozen=True)
class FieldRequirements:
    """Least number of targets and pillars, least depth as a share of the longest axis."""

    targets: int
    pillars: int
    depth: float


def layout_of_field(block: Block, position_m: Float, rules: FieldRequirements) -> tuple[Evaluation, list[str]]:
    """Figures of a field, and the rules that it breaks, in words.

    Parameters
    ----------
    block : Block
        Control and check points are its targets, what geodetic observations start from its pillars.
    position_m : (n, 3) float64, m
        Places of cameras, planned or found; NaN where unknown.

    Raises
    ------
    InputError
        If fewer than four targets are known in three coordinates.
    """
    ground = block.ground_points
    in_full = np.isfinite(ground.xyz_m).all(axis=1) & np.isin(ground.role, [CONTROL, CHECK]).all(axis=1)
    X = ground.xyz_m[in_full]
    if len(X) < 4:
        raise InputError(
            f"no field: {several(len(X), 'target')} known in three coordinates",
            remedy="give control or check points",
        )
    along = (X - X.mean(axis=0)) @ np.linalg.svd(X - X.mean(axis=0), full_matrices=False)[2].T
    low, high = np.percentile(along, [5, 95], axis=0)
    extent = high - low
    cell = np.clip(((along - low) / np.maximum(extent, 1e-12) * CELLS).astype(int), 0, CELLS - 1)
    count = np.bincount(CELLS * cell[:, 0] + cell[:, 1], minlength=CELLS**2)
    empty, crowding, chance = int((count == 0).sum()), _crowding(count), float(chdtri(CELLS**2 - 1, ALARM))
    sights = block.geodetic.active & np.isin(block.geodetic.type, SIGHTS) & (block.geodetic.start_kind == "point")
    at = np.where(block.geodetic.type == "angle", block.geodetic.via, block.geodetic.start)[sights]
    pillars = len(np.unique(at))
    cameras = position_m[np.isfinite(position_m).all(axis=1)]
    depth = float(extent[2] / extent[0])
    inside = int((Delaunay(X).find_simplex(cameras) >= 0).sum()) if len(cameras) and depth > 1e-6 else 0
    figures = {
        "field_targets": float(len(X)),
        **{f"field_extent_{k + 1}_m": float(e) for k, e in enumerate(extent)},
        "field_empty_cells": float(empty),
        "field_crowding_chi2": crowding,
        "field_depth_ratio": depth,
        "field_pillars": float(pillars),
        "field_cameras_inside": float(inside),
    }
    if len(cameras):
        nearest = np.linalg.norm(cameras[:, None] - X, axis=2).min()
        figures["field_nearest_camera_m"] = float(nearest)
    broken = [
        text
        for text, wrong in (
            (f"{several(len(X), 'target')}, {rules.targets} or more are wanted", len(X) < rules.targets),
            (f"{empty} of {CELLS**2} parts of the field have no target", empty > 0),
            (
                f"{count.max()} of {len(X)} targets are in one of its {CELLS**2} parts, {count.min()} in another: chi2 "
                f"{crowding:.1f}, at random below {chance:.1f}",
                empty == 0 and crowding > chance,
            ),
            (
                f"its depth is {depth:.2g} of its length, below {rules.depth:g}: c and the distance do not separate",
                depth < rules.depth,
            ),
            (f"{inside} of {len(cameras)} cameras stand among the targets: they have no room", inside > 0),
            (
                f"targets are measured from {several(pillars, 'pillar')}, {rules.pillars} or more are wanted",
                pillars < rules.pillars,
            ),
        )
        if wrong
    ]
    size = " x ".join(f"{e:.3g}" for e in extent)
    verdict = f"test field: {several(len(X), 'target')} in {size} m, {several(pillars, 'pillar')}; "
    verb = "is" if len(broken) == 1 else "are"
    verdict += f"{len(broken)} of 5 rules {verb} broken" if broken else "all 5 rules are kept"
    table = Figures(name=np.array(list(figures)), value=np.array(list(figures.values())))
    return Evaluation(verdict=f"{verdict}.", figures=table, differences=Differences.empty()), broken


def _crowding(count: Int) -> float:
    """X2 of the targets per cell, against cells that get their share of the field."""
    outer = (1.0 - INSIDE) / 2.0 + INSIDE / CELLS
    share = np.full(CELLS, INSIDE / CELLS)
    share[[0, -1]] = outer
    expected = count.sum() * np.outer(share, share).ravel()
    return float(((count - expected) ** 2 / expected).sum())
