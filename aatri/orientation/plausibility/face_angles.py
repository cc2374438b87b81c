"""Angles between the rays to control points, measured in the image and computed from positions and control.

    angle in the image   between (x, y, -c)_i and (x, y, -c)_j
    angle in space       between X_i - X0 and X_j - X0

They are the same whatever the rotation of the image (the face angles of Church's resection), so that units, order of
axes, zones, heights and principal distances are tried before anything is oriented. The misfit of an image is the median
over its pairs of |difference| / angle, that of a block the median over its images. Where it is large, one change of
everything is looked for that makes it small: X and Y exchanged, feet, millimetres, the sign of heights, another
principal distance, positions at another height. Over flat ground the last two cannot be told apart.

Source: Church, Revised geometry of the aerial photograph (1945); Manual of Photogrammetry, space resection.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from aatri.arrays import Float, Int
from aatri.orientation.plausibility.control import FEET_M, length

LEAST_ANGLE_RAD = 0.01
FEWEST_PAIRS = 3
MOST_IMAGES = 300
MOST_CONTROL = 12
"""Of one image; images and points beyond these numbers add nothing."""

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
class ControlRays:
    """ControlRays to control points.

    Attributes
    ----------
    image, point : (k,) int
        Rows of `position_m` and `control_m`.
    xy_mm : (k, 2) float64, mm
        From the principal point.
    principal_point_mm : (k, 2) float64, mm
        What has been subtracted.
    c_mm : (k,) float64, mm
    position_m : (n, 3) float64, m
    control_m : (m, 3) float64, m
        All of them known.
    """

    image: Int
    point: Int
    xy_mm: Float
    principal_point_mm: Float
    c_mm: Float
    position_m: Float
    control_m: Float


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
    """

    text: str
    remedy: str
    of: str
    certain: bool
    images: Int


@dataclass(frozen=True)
class _Cause:
    """A change of everything: of what, in words, and the rays it would give."""

    of: str
    text: str
    remedy: str
    rays: ControlRays
    estimated: bool = False


@dataclass(frozen=True)
class _Pairs:
    """Pairs of rays of one image each."""

    image: Int
    first: Int
    second: Int


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
    pairs = _pairs_of(rays)
    if len(pairs.image) < FEWEST_PAIRS:
        return None
    limit = UNFIT_OBSERVED if observed else UNFIT_APPROXIMATE
    each = _image_misfits(rays, pairs)
    given = float(np.median(each))
    if given <= limit:
        return _single_images(pairs, each, limit)
    tried = [(cause, _misfit(cause.rays, pairs)) for cause in _causes(rays, pairs)]
    least = min(left for _, left in tried)
    cause, left = next(one for one in tried if one[1] <= max(2 * least, 1e-3))
    off = f"angles between rays to control points differ by {_percent(given)} from those measured in the images"
    everything = np.zeros(0, np.int64)
    if left < EXPLAINED * given and (left < FIT_OBSERVED or not observed):
        certain = left < CERTAINLY_EXPLAINED * given and (given > CERTAIN or (observed and not cause.estimated))
        return Contradiction(f"{off}; {cause.text} by {_percent(left)}", cause.remedy, cause.of, certain, everything)
    if given > NOTHING_FITS:
        text = f"{off}: positions, control and image points do not belong together"
        remedy = "check that the tables are of one project, ids of images and points, frames and units"
        return Contradiction(text, remedy, "", observed, everything)
    return _single_images(pairs, each, limit)


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 1 else f"{100 * share:,.0f} %"


def _single_images(pairs: _Pairs, each: Float, limit: float) -> Contradiction | None:
    """Single images whose angles do not fit."""
    off = np.unique(pairs.image)[each > limit]
    if not len(off) or limit == UNFIT_APPROXIMATE:
        return None
    text = (f"angles between rays to control points differ by more than {limit:.0%} from those measured in single "
            "images")  # fmt: skip
    return Contradiction(text, "a wrong position, wrong ids of control, or another camera", "", False, off)


def _pairs_of(rays: ControlRays) -> _Pairs:
    order = np.argsort(rays.image, kind="stable")
    begin = np.unique(rays.image[order], return_index=True)[1]
    groups = [g[:: max(1, -(-len(g) // MOST_CONTROL))] for g in np.split(order, begin[1:])]
    groups = [g for g in groups if len(g) > 1]
    groups = groups[:: max(1, -(-len(groups) // MOST_IMAGES))]
    first = [g[i] for g in groups for i in range(len(g)) for _ in range(i + 1, len(g))]
    second = [g[j] for g in groups for i in range(len(g)) for j in range(i + 1, len(g))]
    pairs = _Pairs(rays.image[first], np.array(first, np.int64), np.array(second, np.int64))
    seen = np.maximum(_angle(*_in_image(rays, pairs)), _angle(*_in_space(rays, pairs))) > LEAST_ANGLE_RAD
    return _Pairs(pairs.image[seen], pairs.first[seen], pairs.second[seen])


def _in_image(rays: ControlRays, pairs: _Pairs) -> tuple[Float, Float]:
    u = np.column_stack([rays.xy_mm, -rays.c_mm])
    return u[pairs.first], u[pairs.second]


def _in_space(rays: ControlRays, pairs: _Pairs) -> tuple[Float, Float]:
    d = rays.control_m[rays.point] - rays.position_m[rays.image]
    return d[pairs.first], d[pairs.second]


def _angle(a: Float, b: Float) -> Float:
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))


def _image_misfits(rays: ControlRays, pairs: _Pairs) -> Float:
    """Misfit of each image that has pairs, in their order."""
    image = np.maximum(_angle(*_in_image(rays, pairs)), 1e-9)
    off = np.abs(_angle(*_in_space(rays, pairs)) - image) / image
    order = np.lexsort((off, pairs.image))
    _, begin, count = np.unique(pairs.image[order], return_index=True, return_counts=True)
    low, high = off[order][begin + (count - 1) // 2], off[order][begin + count // 2]
    return np.asarray((low + high) / 2)


def _misfit(rays: ControlRays, pairs: _Pairs) -> float:
    return float(np.median(_image_misfits(rays, pairs)))


def _causes(rays: ControlRays, pairs: _Pairs) -> Iterator[_Cause]:
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


def _height_or_lens(rays: ControlRays, pairs: _Pairs) -> _Cause:
    """The principal distance, or the height of the positions, that fits best."""
    lens, factor = _other_lens(rays, pairs)
    raised, lift = _other_height(rays, pairs)
    c = float(np.median(rays.c_mm))
    if _misfit(lens, pairs) > 2 * _misfit(raised, pairs):
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


def _other_lens(rays: ControlRays, pairs: _Pairs) -> tuple[ControlRays, float]:
    def with_factor(log_factor: float) -> ControlRays:
        return replace(rays, c_mm=rays.c_mm * 10.0**log_factor)

    log_factor = _least(lambda x: _misfit(with_factor(x), pairs), np.linspace(-4, 4, 161))
    return with_factor(log_factor), float(10.0**log_factor)


def _other_height(rays: ControlRays, pairs: _Pairs) -> tuple[ControlRays, float]:
    a, b = _in_space(rays, pairs)
    apart, angle = np.linalg.norm(a - b, axis=1), _angle(*_in_image(rays, pairs))
    distance = float(np.median(apart / (2 * np.tan(angle / 2))))  # of a pair below the image
    up = float(np.median(rays.position_m[rays.image, 2] - rays.control_m[rays.point, 2]))

    def lifted(by: float) -> ControlRays:
        return replace(rays, position_m=rays.position_m + np.array([0.0, 0.0, by]))

    lift = _least(lambda x: _misfit(lifted(x), pairs), distance - up + distance * np.linspace(-0.5, 0.5, 101))
    return lifted(lift), lift


def _least(of: Callable[[float], float], grid: Float) -> float:
    """Where a function is least, near the best of a grid."""
    at, step = min((float(x) for x in grid), key=of), float(grid[1] - grid[0])
    for _ in range(24):
        step *= 0.6
        at = min((at - step, at, at + step), key=of)
    return at
