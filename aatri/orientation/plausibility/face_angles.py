"""Angles between the rays to control points, measured in the image and computed from positions and control.

They are the same whatever the rotation of the image (the face angles of Church's resection), so that units, order of
axes, zones, heights and principal distances are tried before anything is oriented. Where the misfit (`control_rays`) of
the block is large, one change of everything is looked for that makes it small: X and Y exchanged, feet, millimetres,
the sign of heights, another principal distance, positions at another height. Over flat ground the last two cannot be
told apart. Where it is small, but not at some points, two are looked for whose numbers are exchanged (`exchanged`).

Source: Church, Revised geometry of the aerial photograph (1945); Manual of Photogrammetry, space resection.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from aatri.arrays import Float, Int
from aatri.orientation.plausibility.control import FEET_M, length
from aatri.orientation.plausibility.control_rays import (
    FEWEST_PAIRS,
    ControlRays,
    Pairs,
    angle_between,
    in_image,
    in_space,
    misfit,
    misfit_of_images,
    pairs_of,
)
from aatri.orientation.plausibility.exchanged import exchanged_by_angles

UNFIT_OBSERVED, UNFIT_APPROXIMATE = 0.05, 0.25
"""Misfit that is too large: with observed positions, with approximate ones."""

EXPLAINED, FIT_OBSERVED = 0.3, 0.02
"""A cause is named if it reduces the misfit to this share; with observed positions also below this."""

CERTAINLY_EXPLAINED = 0.1
"""A cause that reduces the misfit to this share is certain; a height or a principal distance, which are estimated, only
where the misfit is beyond `CERTAIN`."""

CERTAIN, NOTHING_FITS = 0.25, 0.5
"""A misfit beyond the latter is an error also where no cause is known."""


@dataclass(frozen=True)
class Contradiction:
    """What positions, control and image points say against each other.

    Attributes
    ----------
    text, remedy : str
    of : str
        What is wrong: 'control', 'position', 'camera', or '' if that is not known.
    certain : bool
        Not to be adjusted.
    images : (j,) int
        The images it is about; empty: all of them.
    points : tuple of int
        The control points it is about, rows of `control_m`; empty: all of them, or none.
    """

    text: str
    remedy: str
    of: str
    certain: bool
    images: Int
    points: tuple[int, ...] = ()


@dataclass(frozen=True)
class _Cause:
    """A change of everything: of what, in words, and the rays it would give."""

    of: str
    text: str
    remedy: str
    rays: ControlRays
    estimated: bool = False


def contradiction(rays: ControlRays, *, observed: bool) -> Contradiction | None:
    """What is wrong with positions, control or cameras, if anything is.

    Parameters
    ----------
    rays : ControlRays
    observed : bool
        Positions are observed, not only approximate.

    Returns
    -------
    Contradiction or None
        None also where fewer than three pairs of rays say anything.
    """
    pairs = pairs_of(rays)
    if len(pairs.image) < FEWEST_PAIRS:
        return None
    limit = UNFIT_OBSERVED if observed else UNFIT_APPROXIMATE
    each = misfit_of_images(rays, pairs)
    given = float(np.median(each))
    if given <= limit:
        return _exchanged(rays, pairs, limit) or _single_images(pairs, each, limit)
    tried = [(cause, misfit(cause.rays, pairs)) for cause in _causes(rays, pairs)]
    least = min(left for _, left in tried)
    cause, left = next(one for one in tried if one[1] <= max(2 * least, 1e-3))
    off = f"angles between rays to control points differ by {_percent(given)} from those measured in the images"
    everything = np.zeros(0, np.int64)
    if left < EXPLAINED * given and (left < FIT_OBSERVED or not observed):
        certain = left < CERTAINLY_EXPLAINED * given and (given > CERTAIN or (observed and not cause.estimated))
        return Contradiction(f"{off}; {cause.text} by {_percent(left)}", cause.remedy, cause.of, certain, everything)
    exchanged = _exchanged(rays, pairs, limit)
    if exchanged is None and given > NOTHING_FITS:
        text = f"{off}: positions, control and image points do not belong together"
        remedy = "check that the tables are of one project, ids of images and points, frames and units"
        return Contradiction(text, remedy, "", observed, everything)
    return exchanged or _single_images(pairs, each, limit)


def _exchanged(rays: ControlRays, pairs: Pairs, limit: float) -> Contradiction | None:
    """Two points with each other's number: a warning, for the adjustment may leave them out."""
    found = exchanged_by_angles(rays, pairs, limit)
    if found is None:
        return None
    off = _percent(found.as_given)
    text = (f"angles between rays to two control points and to others differ by {off} from those measured in the "
            f"images, with the numbers of the two exchanged by {_percent(found.exchanged)}")  # fmt: skip
    remedy = "exchange the two ids in the control, or in the images"
    return Contradiction(text, remedy, "control", False, found.images, (found.first, found.second))


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 1 else f"{100 * share:,.0f} %"


def _single_images(pairs: Pairs, each: Float, limit: float) -> Contradiction | None:
    """Single images whose angles do not fit."""
    off = np.unique(pairs.image)[each > limit]
    if not len(off) or limit == UNFIT_APPROXIMATE:
        return None
    text = (f"angles between rays to control points differ by more than {limit:.0%} from those measured in single "
            "images")  # fmt: skip
    return Contradiction(text, "a wrong position, wrong ids of control, or another camera", "", False, off)


def _causes(rays: ControlRays, pairs: Pairs) -> Iterator[_Cause]:
    """What may be wrong with everything, the simple causes first."""
    for text, remedy, change in _CHANGES:
        yield _Cause("control", text, remedy, replace(rays, control_m=change(rays.control_m)))
    centred = replace(rays, xy_mm=rays.xy_mm + rays.principal_point_mm)
    yield _Cause("camera", "with the principal point in the middle of the image",
                 "count principal_point from the middle of the image, in mm, x right, y up", centred)  # fmt: skip
    yield _height_or_lens(rays, pairs)


def _of_heights(factor: float) -> Callable[[Float], Float]:
    return lambda xyz: xyz * [1.0, 1.0, factor]


_CHANGES: tuple[tuple[str, str, Callable[[Float], Float]], ...] = (
    ("with X and Y of control exchanged",
     "write `axes: [north, east, up]` (or the other way round) for this frame", lambda xyz: xyz[:, [1, 0, 2]]),
    ("with heights of control taken as feet", "convert the heights to metres", _of_heights(FEET_M)),
    ("with heights of control taken as metres that were divided by 0.3048", "give the heights of control in metres",
     _of_heights(1 / FEET_M)),
    ("with the sign of the heights of control turned", "heights count upwards", _of_heights(-1.0)),
    ("with control taken as feet", "convert control to metres", lambda xyz: xyz * FEET_M),
    ("with control taken as metres that were divided by 0.3048", "give control in metres", lambda xyz: xyz / FEET_M),
    ("with control times 1000", "set units: {ground: km}", lambda xyz: xyz * 1000.0),
    ("with control divided by 1000", "set units: {ground: mm}", lambda xyz: xyz / 1000.0),
)  # fmt: skip


def _height_or_lens(rays: ControlRays, pairs: Pairs) -> _Cause:
    """The principal distance, or the height of the positions, that fits best."""
    lens, factor = _other_lens(rays, pairs)
    raised, lift = _other_height(rays, pairs)
    c = float(np.median(rays.c_mm))
    if misfit(lens, pairs) > 2 * misfit(raised, pairs):
        return _Cause("position", _lift_text(lift), _LIFT_REMEDY, raised, estimated=True)
    text = f"with a principal distance of {factor * c:.4g} instead of {c:.4g} mm"
    remedy = "check principal_distance and the pixel size, both in mm"
    if 0.8 < factor < 1.25:
        return _Cause("position", f"{_lift_text(lift)}, or {text},", f"{_LIFT_REMEDY}; or {remedy}", raised, True)
    return _Cause("camera", text, remedy, lens, estimated=True)


def _lift_text(lift: float) -> str:
    return f"with positions {length(abs(lift))} {'higher' if lift > 0 else 'lower'}"


_LIFT_REMEDY = ("do heights of control and positions count from the same surface (ellipsoid, geoid, ground)? declare "
                "crs and vertical of their frames, or `undulation`")  # fmt: skip


def _other_lens(rays: ControlRays, pairs: Pairs) -> tuple[ControlRays, float]:
    def with_factor(log_factor: float) -> ControlRays:
        return replace(rays, c_mm=rays.c_mm * 10.0**log_factor)

    log_factor = _least(lambda x: misfit(with_factor(x), pairs), np.linspace(-4, 4, 161))
    return with_factor(log_factor), float(10.0**log_factor)


def _other_height(rays: ControlRays, pairs: Pairs) -> tuple[ControlRays, float]:
    a, b = in_space(rays, pairs)
    apart, angle = np.linalg.norm(a - b, axis=1), angle_between(*in_image(rays, pairs))
    distance = float(np.median(apart / (2 * np.tan(angle / 2))))  # of a pair below the image
    up = float(np.median(rays.position_m[rays.image, 2] - rays.control_m[rays.point, 2]))

    def lifted(by: float) -> ControlRays:
        return replace(rays, position_m=rays.position_m + np.array([0.0, 0.0, by]))

    lift = _least(lambda x: misfit(lifted(x), pairs), distance - up + distance * np.linspace(-0.5, 0.5, 101))
    return lifted(lift), lift


def _least(of: Callable[[float], float], grid: Float) -> float:
    """Where a function is least, near the best of a grid."""
    at, step = min((float(x) for x in grid), key=of), float(grid[1] - grid[0])
    for _ in range(24):
        step *= 0.6
        at = min((at - step, at, at + step), key=of)
    return at
