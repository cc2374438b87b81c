"""What of a Block an adjustment cannot do without: something that says where the block lies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from aatri.arrays import Bool
from aatri.codes import CONTROL, OBSERVED_VALUE
from aatri.tables.offers import Need

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

WITHOUT_SHIFT = "exterior.position_m:in_no_group"
"""Positions that say where the block lies: those of drift groups have an unknown shift."""


SIMILARITY = "ground_points.xyz_m:similarity"
"""Control that leaves no similarity open: three points, or fewer beside what else says how the block lies.

Two points have six coordinates; a similarity, which image points leave open, takes seven.
"""

ON_A_LINE = 1e-6
"""Spread of places across a line over that along it, below which they are on it: a millimetre in a kilometre, which no
observed coordinate tells, but more than coordinates of 10,000 km are rounded by."""


def datum_needed(*, positions: bool = True, shift: Literal["none", "group", "all"] = "none") -> tuple[Need, ...]:
    """What an adjustment whose datum is given by its observations cannot do without.

    Parameters
    ----------
    positions : bool
        Positions are used.
    shift : str
        Which of them have an unknown shift: none, those of drift groups, all.
    """
    names: tuple[str, ...] = ("ground_points.xyz_m", "exterior.position_m")
    text = "neither control nor observed positions"
    remedy = "give control (ground_points.csv) or observed positions (exterior.csv)"
    if not positions:
        names, text = names[:1], "no control"
    elif shift != "none":
        names = (names[0], WITHOUT_SHIFT) if shift == "group" else names[:1]
        text = "no control and no observed position outside drift groups" if shift == "group" else "no control"
        remedy = "give control (ground_points.csv), or take the positions as they are: `positions: {drift: none}`"
    remedy += "; or `datum: free` in a bundle, after initial_orientation/graph if there are images"
    enough = "the block has neither three control points nor anything else that says how it lies"
    further = "give a third control point off the line of the others (ground_points.csv), or observed positions "
    further += "(exterior.csv); or `datum: free` in a bundle, after initial_orientation/graph if there are images"
    return (
        Need("block", names, f"the block has {text}", remedy),
        Need("block", (SIMILARITY, "exterior.position_m"), enough, further),
    )


def observed_positions(block: Block) -> Bool:
    """Which rows of the exterior are observed positions."""
    e = block.exterior
    return np.asarray((e.position_use == OBSERVED_VALUE) & np.isfinite(e.position_m).any(axis=1))


def observed_attitudes(block: Block) -> Bool:
    """Which rows of the exterior are observed attitudes."""
    e = block.exterior
    return np.asarray((e.angle_use == OBSERVED_VALUE) & np.isfinite(e.angles_rad).any(axis=1))


def observed_images(block: Block) -> Bool:
    """Which images have an observed position or attitude, or points with row times, which ask for their velocity."""
    observed = observed_positions(block) | observed_attitudes(block)
    timed = block.image_points.image[np.isfinite(block.image_points.row_time_s)]
    return np.isin(np.arange(len(block.images)), np.concatenate([block.exterior.image[observed], timed]))


def no_similarity_open(block: Block) -> Bool:
    """Control where it leaves no similarity open, alone or with what else the block has; else none."""
    control = block.ground_points.given_as(CONTROL)
    of_images = observed_positions(block).any() or observed_attitudes(block).any()
    between_points = block.geodetic.active.any() or len(block.relative_control) > 0
    return control & bool(control.sum() > 2 or of_images or between_points)


def is_placed(block: Block) -> np.bool_:
    """Whether control points and observed positions with all three coordinates fix shift, rotation and scale.

    Three do that if they are not on one line, about which the block could still turn.
    """
    g, e = block.ground_points, block.exterior
    xyz_m = np.concatenate([g.xyz_m[(g.role == CONTROL).all(axis=1)], e.position_m[observed_positions(block)]])
    xyz_m = xyz_m[np.isfinite(xyz_m).all(axis=1)]
    if len(xyz_m) < 3:
        return np.False_
    along, across, _ = np.linalg.svd(xyz_m - xyz_m.mean(axis=0), compute_uv=False)
    return np.bool_(across > ON_A_LINE * along)
