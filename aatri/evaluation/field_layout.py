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
from pydantic import Field
from scipy.spatial import Delaunay
from scipy.special import chdtri

from aatri.adjustment.statistics.limits import ALARM
from aatri.arrays import Float, Int
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.evaluation import Differences, Evaluation, Figures
from aatri.errors import InputError
from aatri.evaluation.limits import INSIDE_SHARE
from aatri.ids import several
from aatri.options import Options

CELLS = 3

SIGHTS = ("direction", "angle", "zenith", "azimuth")


class FieldOptions(Options):
    """What a test field is to have."""

    targets: int = Field(30, ge=4, description="least number of targets known in three coordinates")
    pillars: int = Field(2, ge=0, description="least number of pillars")
    depth: float = Field(0.15, gt=0, lt=1, description="least extent along the shortest axis, of the longest")


@dataclass(frozen=True)
class _Layout:
    """Targets, pillars and cameras of a field."""

    targets: int
    extent_m: Float
    """(3,). Along its axes, the longest first."""
    cells: Int
    """Targets of each of its parts."""
    pillars: int
    cameras: int
    inside: int
    """Cameras among the targets."""
    nearest_m: float
    """From a camera to a target; NaN without cameras."""

    @property
    def depth(self) -> float:
        """As a share of the longest axis."""
        return float(self.extent_m[2] / self.extent_m[0])

    @property
    def empty(self) -> int:
        """Parts without a target."""
        return int((self.cells == 0).sum())


def layout_of_field(block: Block, position_m: Float, options: FieldOptions) -> tuple[Evaluation, list[str]]:
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
    layout = _layout(block, X, position_m[np.isfinite(position_m).all(axis=1)])
    figures = {
        "field_targets": float(layout.targets),
        **{f"field_extent_{k + 1}_m": float(e) for k, e in enumerate(layout.extent_m)},
        "field_empty_cells": float(layout.empty),
        "field_crowding_chi2": _crowding(layout.cells),
        "field_depth_ratio": layout.depth,
        "field_pillars": float(layout.pillars),
        "field_cameras_inside": float(layout.inside),
    }
    if layout.cameras:
        figures["field_nearest_camera_m"] = layout.nearest_m
    broken = _broken_rules(layout, options)
    size = " x ".join(f"{e:.3g}" for e in layout.extent_m)
    verdict = f"test field: {several(layout.targets, 'target')} in {size} m, {several(layout.pillars, 'pillar')}; "
    verb = "is" if len(broken) == 1 else "are"
    verdict += f"{len(broken)} of 5 rules {verb} broken" if broken else "all 5 rules are kept"
    table = Figures(name=np.array(list(figures)), value=np.array(list(figures.values())))
    return Evaluation(verdict=f"{verdict}.", figures=table, differences=Differences.empty()), broken


def _layout(block: Block, X: Float, cameras: Float) -> _Layout:
    along = (X - X.mean(axis=0)) @ np.linalg.svd(X - X.mean(axis=0), full_matrices=False)[2].T
    low, high = np.percentile(along, [5, 95], axis=0)
    extent = high - low
    cell = np.clip(((along - low) / np.maximum(extent, 1e-12) * CELLS).astype(int), 0, CELLS - 1)
    cells = np.bincount(CELLS * cell[:, 0] + cell[:, 1], minlength=CELLS**2)
    geodetic = block.geodetic
    sights = geodetic.active & np.isin(geodetic.type, SIGHTS) & (geodetic.start_kind == "point")
    pillars = np.unique(np.where(geodetic.type == "angle", geodetic.via, geodetic.start)[sights])
    inside, nearest = 0, np.nan
    if len(cameras):
        nearest = float(np.linalg.norm(cameras[:, None] - X, axis=2).min())
        if extent[2] / extent[0] > 1e-6:
            inside = int((Delaunay(X).find_simplex(cameras) >= 0).sum())
    return _Layout(len(X), extent, cells, len(pillars), len(cameras), inside, nearest)


def _broken_rules(layout: _Layout, options: FieldOptions) -> list[str]:
    n, count, crowding, chance = (
        layout.targets,
        layout.cells,
        _crowding(layout.cells),
        float(chdtri(CELLS**2 - 1, ALARM)),
    )
    broken = {
        f"{several(n, 'target')}, {options.targets} or more are wanted": n < options.targets,
        f"{layout.empty} of {CELLS**2} parts of the field have no target": layout.empty > 0,
        f"{count.max()} of {n} targets are in one of its {CELLS**2} parts, {count.min()} in another: chi2 "
        f"{crowding:.1f}, at random below {chance:.1f}": layout.empty == 0 and crowding > chance,
        f"its depth is {layout.depth:.2g} of its length, below {options.depth:g}: c and the distance do not separate": (
            layout.depth < options.depth
        ),
        f"{layout.inside} of {layout.cameras} cameras stand among the targets: they have no room": layout.inside > 0,
        f"targets are measured from {several(layout.pillars, 'pillar')}, {options.pillars} or more are wanted": (
            layout.pillars < options.pillars
        ),
    }
    return [text for text, wrong in broken.items() if wrong]


def _crowding(count: Int) -> float:
    """X2 of the targets per cell, against cells that get their share of the field."""
    outer = (1.0 - INSIDE_SHARE) / 2.0 + INSIDE_SHARE / CELLS
    share = np.full(CELLS, INSIDE_SHARE / CELLS)
    share[[0, -1]] = outer
    expected = count.sum() * np.outer(share, share).ravel()
    return float(((count - expected) ** 2 / expected).sum())
