"""Angles between the rays to control points, measured in the image and computed from positions and control.

They are the same whatever the rotation of the image (the face angles of Church's resection), so that units, order of
axes, zones, heights and principal distances are tried before anything is oriented.

Seen: coordinates in another unit or order, heights that count from another surface, another lens, wrong images.
Test: the misfit (`control_rays`) of the block is above 5 % with observed positions, 25 % with approximate ones, and
above what the standard deviations of the positions allow. One change of everything is looked for that makes it small.
Over flat ground the height of the positions and the principal distance cannot be told apart; one that is free may begin
far off. Where the misfit of the block is small, single images are named, or single points if these are fewer.

Source: Church, Revised geometry of the aerial photograph (1945); Manual of Photogrammetry, space resection.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.checks.as_read.changes import CHANGES
from aatri.checks.as_read.control_rays import (
    ControlRays,
    Pairs,
    angle_between,
    control_rays,
    in_image,
    in_space,
    misfit,
    misfit_of_images,
    misfit_of_pairs,
    pairs_of,
)
from aatri.checks.finding import Finding
from aatri.checks.limits import (
    CERTAIN_MISFIT,
    CERTAINLY_EXPLAINED,
    EXPLAINED_ANGLES,
    FEWEST_ANGLES,
    FIT_OBSERVED,
    NOTHING_FITS,
    UNFIT_APPROXIMATE,
    UNFIT_OBSERVED,
)
from aatri.ids import shown
from aatri.observations.control import control_of
from aatri.units import length

EXCHANGED = 2
"""Control points that one exchange of coordinates makes wrong."""

MOST_EXCHANGED = 50
"""Control points of which every two are tried with each other's coordinates: some seconds."""

PLAIN_LENSES = ("none", "brown", "table")
"""Distortions so small that angles between rays may be taken without them."""


@dataclass(frozen=True)
class AngleCause:
    """A change of everything: of what, in words, and the rays it would give."""

    of: str
    text: str
    remedy: str
    rays: ControlRays
    estimated: bool = False


@dataclass(frozen=True)
class Contradiction:
    """What positions, control and image points say against each other."""

    text: str
    remedy: str
    of: str
    """Where to look first."""
    certain: bool
    """Not to be adjusted."""
    images: Int
    """(j,). The images it is about."""
    points: tuple[int, ...] = ()
    """Single control points that are as likely, rows of `control_m`."""


def angles_that_differ(block: Block, xy_mm: Float, usable: Bool) -> list[Finding]:
    """What positions, control and image points say against each other.

    Parameters
    ----------
    xy_mm : (k, 2) float64, mm
        Image points, from the middle of the image.
    usable : (k,) bool
    """
    plain = np.isin(block.cameras.distortion, PLAIN_LENSES)[block.images.camera[block.image_points.image]]
    rays = control_rays(block, xy_mm, usable & plain)
    seen = contradiction(rays)
    if seen is None:
        return []
    if seen.certain and not (seen.of == "camera" and _lens_is_free(block, rays)):
        return [Finding("angles", "error", seen.text, seen.remedy, where=_place(block, seen.of, rays))]
    points = block.points.id[control_of(block).point[list(seen.points)]]
    ids, images = tuple(points.tolist()), tuple(block.images.id[seen.images].tolist())
    other = (f"another camera or position of {shown(images)}",) if ids and images else ()
    return [Finding("angles", "warning", seen.text, seen.remedy, ids=ids or images, alternatives=other)]


def _lens_is_free(block: Block, rays: ControlRays) -> bool:
    """Whether the block leaves every principal distance free: then a wrong one is a start value."""
    p = block.camera_parameters
    free = p.camera[(p.name == "principal_distance") & p.free]
    return bool(np.isin(block.images.camera[rays.image], free).all())


def contradiction(rays: ControlRays) -> Contradiction | None:
    """What is wrong with positions, control or cameras; None also where fewer than three angles say anything."""
    pairs = pairs_of(rays)
    if len(pairs.image) < FEWEST_ANGLES:
        return None
    limit = max(UNFIT_OBSERVED if rays.observed else UNFIT_APPROXIMATE, rays.misfit_by_chance)
    fits = max(FIT_OBSERVED, rays.misfit_by_chance)
    each = misfit_of_images(rays, pairs)
    as_given, images = float(np.median(each)), np.unique(rays.image)
    text = f"angles between rays to control points differ by {_percent(as_given)} from those measured in the images"
    if as_given > limit:
        cause, left = best_cause(rays, pairs)
        if left < EXPLAINED_ANGLES * as_given and (left < fits or not rays.observed):
            surely = as_given > CERTAIN_MISFIT or (rays.observed and not cause.estimated)
            certain = left < CERTAINLY_EXPLAINED * as_given and surely
            text = f"{text}; {cause.text}, by {_percent(left)}"
            return Contradiction(text, cause.remedy, cause.of, certain, images)
        if as_given > NOTHING_FITS and rays.observed and (two := exchanged_points(rays, pairs, limit, fits)):
            return _exchanged(text, images, two)
        if as_given > NOTHING_FITS and rays.observed and 0 < len(points_off(rays, pairs, limit)) <= EXCHANGED:
            text += ": one control point may be wrong, or two have each other's coordinates"
            return Contradiction(text, "the adjustment tells which, if it can", "control", False, images)
        if as_given > NOTHING_FITS:
            text += ": positions, control and image points do not belong together"
            remedy = "check that the tables are of one project, ids of images and points, frames and units"
            return Contradiction(text, remedy, "position", rays.observed, images)
    single = np.unique(pairs.image)[each > limit]
    if not len(single) or not rays.observed:
        return None
    of_single = pairs.take(np.isin(pairs.image, single))
    off, cause = misfit(rays, of_single), _height_or_lens(rays, of_single)
    left = float(misfit_of_images(cause.rays, of_single).max())  # each of them: few have a median by chance
    if len(of_single.image) >= FEWEST_ANGLES and left < min(EXPLAINED_ANGLES * off, fits):
        text = f"in single images angles between rays to control points differ by {_percent(off)} from those measured"
        remedy = "check their positions, or give them a camera of their own"
        return Contradiction(f"{text}; {cause.text}, by {_percent(left)}", remedy, cause.of, False, single)
    text = f"angles between rays to control points differ by more than {limit:.0%} from those measured"
    if two := exchanged_points(rays, pairs, limit, fits):
        return _exchanged(text, images, two)
    points = points_off(rays, pairs, limit)
    if 0 < len(points) < len(single):
        return Contradiction(f"{text}, at single points", "check coordinates and ids", "", False, single, points)
    return Contradiction(f"{text}, in single images", "check their positions and cameras", "", False, single)


def _exchanged(text: str, images: Int, two: tuple[int, ...]) -> Contradiction:
    text += ", by hardly anything with the coordinates of two control points exchanged"
    return Contradiction(text, "exchange the coordinates or the ids", "control", False, images[:0], two)


def exchanged_points(rays: ControlRays, pairs: Pairs, limit: float, fit_limit: float) -> tuple[int, ...]:
    """The two control points with whose coordinates exchanged every image fits, rows of `control_m`; else none."""
    off = np.unique(pairs.image)[misfit_of_images(rays, pairs) > limit]
    of_off = pairs.take(np.isin(pairs.image, off))
    points, fits = np.unique(rays.point[np.concatenate([pairs.first, pairs.second])]), list[tuple[int, ...]]()
    for two in combinations(points.tolist(), 2) if len(points) <= MOST_EXCHANGED else ():
        control_m = rays.control_m.copy()
        control_m[list(two)] = control_m[list(two[::-1])]
        exchanged = replace(rays, control_m=control_m)
        if all(misfit_of_images(exchanged, each).max() < fit_limit for each in (of_off, pairs)):
            fits.append(two)
    return fits[0] if len(fits) == 1 else ()


def points_off(rays: ControlRays, pairs: Pairs, limit: float) -> tuple[int, ...]:
    """Control points without which no image is off: the one with the largest median misfit goes first."""
    rejected = list[int]()
    while len(pairs.image) and (misfit_of_images(rays, pairs) > limit).any():
        first, second, off = rays.point[pairs.first], rays.point[pairs.second], misfit_of_pairs(rays, pairs)
        points = np.union1d(first, second)
        median = [float(np.median(off[(first == k) | (second == k)])) for k in points]
        rejected.append(int(points[int(np.argmax(median))]))
        pairs = pairs.take((first != rejected[-1]) & (second != rejected[-1]))
    return tuple(sorted(rejected)) if len(pairs.image) else ()


def _place(block: Block, of: str, rays: ControlRays) -> str:
    """Where to look: the camera, the control point or the position of the first image."""
    first = int(np.argmin(rays.image))
    image = int(rays.image[first])
    if of == "camera":
        return f"camera {block.cameras.id[block.images.camera[image]]}"
    if of == "control":
        return block.read_at(block.ground_points, int(control_of(block).row[rays.point[first]]))
    return block.read_at(block.exterior, int(np.argmax(block.exterior.image == image)))


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 1 else f"{100 * share:,.0f} %"


def best_cause(rays: ControlRays, pairs: Pairs) -> tuple[AngleCause, float]:
    """The simplest of the changes that make the misfit smallest, and the misfit it leaves."""
    causes = [(cause, misfit(cause.rays, pairs)) for cause in _causes(rays, pairs)]
    least = min(left for _, left in causes)
    return next(one for one in causes if one[1] <= max(2 * least, 1e-3))


def _causes(rays: ControlRays, pairs: Pairs) -> Iterator[AngleCause]:
    """What may be wrong with everything, the simple causes first."""
    for change in CHANGES:
        yield AngleCause(
            "control", f"control {change.text}", change.of_all, replace(rays, control_m=change.apply(rays.control_m))
        )
    for by, text in ((1, "later"), (-1, "earlier")):
        remedy = "move the coordinates in ground_points.csv by one row: a point or a row is missing"
        yield AngleCause("control", f"with those of control that stand one row {text}", remedy, rays.rows_off(by))
    centred = replace(rays, xy_mm=rays.xy_mm + rays.principal_point_mm)
    yield AngleCause(
        "camera",
        "with the principal point in the middle of the image",
        "count principal_point from the middle of the image, in mm, x right, y up",
        centred,
    )
    yield _height_or_lens(rays, pairs)


def _height_or_lens(rays: ControlRays, pairs: Pairs) -> AngleCause:
    """The principal distance, or the height of the positions, that fits best."""
    lens, factor = _other_lens(rays, pairs)
    raised, lift = _other_height(rays, pairs)
    c = float(np.median(rays.c_mm))
    if misfit(lens, pairs) > 2 * misfit(raised, pairs):
        return AngleCause("position", _lift_text(lift), _LIFT_REMEDY, raised, estimated=True)
    text = f"with a principal distance of {factor * c:.4g} instead of {c:.4g} mm"
    remedy = "check principal_distance and the pixel size, both in mm"
    if 0.8 < factor < 1.25:
        return AngleCause("position", f"{_lift_text(lift)}, or {text}", f"{_LIFT_REMEDY}; or {remedy}", raised, True)
    return AngleCause("camera", text, remedy, lens, estimated=True)


def _lift_text(lift: float) -> str:
    return f"with positions {length(abs(lift))} {'higher' if lift > 0 else 'lower'}"


_LIFT_REMEDY = (
    "do heights of control and positions count from the same surface (ellipsoid, geoid, ground)? declare "
    "crs and vertical of their frames, or `undulation`"
)


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


def _least(function: Callable[[float], float], grid: Float) -> float:
    """Where a function is least, near the best of a grid."""
    at, step = min((float(x) for x in grid), key=function), float(grid[1] - grid[0])
    for _ in range(24):
        step *= 0.6
        at = min((at - step, at, at + step), key=function)
    return at
