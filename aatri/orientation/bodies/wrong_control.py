"""Control or positions that are wrong as a whole: an axis mirrored, heights in another unit, rows moved.

Control is mirrored where it fits much better so, or where by it the images look upwards (`refuse_mirrored`). Positions
may stand one row too high or too low in their table, each beside the next image (`one_row_off`).
"""

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.geometry.similarity import Similarity, closed_form, robust_closed_form, transform
from aatri.observations.control import KIND as CONTROL
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bodies.datum_analysis import GivenPlaces
from aatri.orientation.bodies.datum_start import UPWARDS
from aatri.orientation.bodies.exchanged_numbers import exchanged_of
from aatri.units import FOOT_M, LENGTH_M, length

CLEARLY_UPWARDS = 0.17
"""Sine of the elevation, 10 degrees, above which images look upwards in the mean where the control says so too."""

TRIANGLE, FEWEST_MIRRORED, CLEARLY = 3, 5, 0.2
"""So many points always fit mirrored; fewer full points than the second do not say whether mirrored ones fit better,
by a misfit of less than this share."""

ONE_ROW = "move the positions in exterior.csv by one row: an image without a position, or a position without an image"

HEIGHT_UNITS = {"divided by 1000": LENGTH_M["mm"], "taken as feet": FOOT_M, "divided by 0.3048": 1 / FOOT_M}
"""What other units make of heights."""

FLAT = 1e-3
"""Misfit, as a share of the extent, of points that fit, or lie in a plane and fit either way."""


class MirroredError(GeometryError):
    """The axes of the control or of the images are mirrored, which is so of all of a block."""


def refuse_mirrored(places: GivenPlaces, used: Bool, to: Similarity, up: Float | None, what: str) -> None:
    """Raise if control or images must be mirrored.

    Parameters
    ----------
    used : (n,) bool
        Those that are not rejected.
    to : Similarity
        Ground from body.
    up : (3,) float64, optional
        Direction against the mean viewing direction, in the body; None where it may be any, as attitudes say.

    Raises
    ------
    MirroredError
        Or a GeometryError that names two points with each other's number, where these explain it.
    """
    kept = places.take(used)
    reason = _mirrored(kept, to, up) or _fits_as_a_whole_mirrored(places)
    if not reason:
        return
    two = places.name[exchanged_of(places, None if up is None else to.rotation @ up, 3)].tolist()
    if two:
        text = f"{what}: {reason}, unless {' and '.join(two)} have each other's number"
        raise GeometryError(text, remedy="exchange the two numbers in the control, or leave both out")
    remedy = "declare the axes of the control in their true order, [north, east, up] or [east, north, up]"
    if kept.given.all(axis=1).sum() < FEWEST_MIRRORED:
        remedy += "; check which control point has which number: so few look alike mirrored and with two exchanged"
    if not (kept.kind == CONTROL).any():
        remedy = "check which image each id and each position belongs to, and the axes of the positions"
    raise MirroredError(f"{what}: {reason}", remedy=f"{remedy}; check the y axis of the image coordinates (pixel: y)")


def _fits_as_a_whole_mirrored(places: GivenPlaces) -> str:
    """That all control fits mirrored, rejected points too: of four any three fit turned over, against the fourth."""
    full = places.take(np.flatnonzero(places.given.all(axis=1) & (places.kind == CONTROL)))
    if len(full.row) <= TRIANGLE:
        return ""
    as_it_is, other = (_misfits_m(full, full.observed_m * [1, 1, sign])[1] for sign in (1, -1))
    fits_m = FLAT * float(np.linalg.norm(np.ptp(full.observed_m, axis=0)))
    return "control fits it mirrored only" if other < fits_m < CLEARLY * as_it_is else ""


def _mirrored(kept: GivenPlaces, to: Similarity, up: Float | None) -> str:
    """Why control or images must be mirrored: control fits much better mirrored, or the images look upwards.

    Images of facades, or of what stands above them, may look upwards rightly. Points in a plane fit as well when they
    are mirrored; of these it counts how steeply the images look upwards.
    """
    steep = 0.0 if up is None else -float((to.rotation @ up)[2]) / float(np.linalg.norm(up))
    if (kept.kind == CONTROL).any():
        text = "oriented by its control the images look upwards, so the control is mirrored"
    else:
        text = "oriented by positions alone the images look upwards, so images have each other's id or position, or "
        text += "the axes of the positions are mirrored"
    full = kept.take(np.flatnonzero(kept.given.all(axis=1)))
    if len(full.row) >= FEWEST_MIRRORED:
        as_it_is, other = (_misfits_m(full, full.observed_m * [1, 1, sign]) for sign in (1, -1))
        extent_m = float(np.linalg.norm(np.ptp(full.observed_m, axis=0)))
        if ((other < CLEARLY * as_it_is) & (as_it_is > FLAT * extent_m)).any():
            return text if steep > CLEARLY_UPWARDS else "control and positions fit it mirrored only"
        if as_it_is[0] < CLEARLY * other[0]:
            return ""
    return text if steep > UPWARDS else ""


def _misfits_m(places: GivenPlaces, X: Float) -> Float:
    """Largest median misfit of a kind, by a robust similarity; root mean square by one of least squares; (2,), m.

    Positions in a plane fit either way, whatever few control points do; so do most of five points.
    """
    off = robust_closed_form(places.xyz, X)[1]
    rms = np.sqrt(((transform(closed_form(places.xyz, X), places.xyz) - X) ** 2).sum(axis=1).mean())
    several = [k for k in np.unique(places.kind) if (places.kind == k).sum() > 1]  # one point alone may be wrong
    return np.array([max(float(np.median(off[places.kind == kind])) for kind in several), rms])


def one_row_off(places: GivenPlaces) -> str:
    """That the positions fit much better if each is that of the image in the next row, or the one before; else empty.

    Control, where there is any, is held beside both; of a single straight flight nothing else tells a row from a shift.
    """
    full = places.take(np.flatnonzero(places.given.all(axis=1)))
    rows, others = np.flatnonzero(full.kind == POSITION), np.flatnonzero(full.kind == CONTROL)
    if len(rows) <= FEWEST_MIRRORED:
        return ""

    def misfit_m(seen: Int, named: Int) -> float:
        x, X = full.xyz[np.append(seen, others)], full.observed_m[np.append(named, others)]
        return float(np.median(robust_closed_form(x, X)[1][: len(seen)]))

    as_given, extent = misfit_m(rows, rows), float(np.linalg.norm(np.ptp(full.observed_m[rows], axis=0)))
    later, earlier = (misfit_m(rows[:-1], rows[1:]), *rows[:2]), (misfit_m(rows[1:], rows[:-1]), *rows[:-3:-1])
    moved, image, row = min(later, earlier)
    if not moved < CLEARLY * as_given or as_given <= FLAT * extent:
        return ""
    return (
        f"the positions stand one row off in their table: that of {full.name[row]} fits {full.name[image]}, and so on "
        f"with all {len(rows)}, to {length(moved)} instead of {length(as_given)} (median)"
    )


def refuse_wrong(places: GivenPlaces, use: Bool, to: Similarity, up: Float | None, what: str) -> None:
    """Raise if what explains why a body does not come to the ground is positions one row off, heights of control in
    another unit, or mirrored control or images.

    `use`, (n,) bool: observations that take part, kind by kind; `to`: ground from body, about; `up`: in the body.
    """
    if row_shift := one_row_off(places):
        raise GeometryError(f"{what}: {row_shift}", remedy=ONE_ROW)
    full = places.take(np.flatnonzero(places.given.all(axis=1) & (places.kind == CONTROL)))
    if len(full.row) > TRIANGLE and not _fits_with(full, 1.0):
        for text, factor in HEIGHT_UNITS.items():
            if _fits_with(full, factor):
                raise GeometryError(f"{what}: control fits it with heights {text}", remedy="give the heights in metres")
    refuse_mirrored(places, use[places.row], to, up, what)


def _fits_with(control: GivenPlaces, factor: float) -> bool:
    """Whether a body fits control whose heights are multiplied."""
    X = control.observed_m * [1.0, 1.0, factor]
    return bool(_misfits_m(control, X)[1] < FLAT * np.linalg.norm(np.ptp(X, axis=0)))
