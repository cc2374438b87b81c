"""Tables that are wrong as a whole, where a body does not come to the ground by them.

Positions may stand one row too high or too low in their table, each beside the next image (`one_row_off`). Heights of
control may be in another unit: the body fits control in which they are divided by a factor that is known (`KNOWN`).
"""

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.geometry.similarity import Similarity, robust_closed_form
from aatri.observations.control import KIND as CONTROL
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bodies.datum_analysis import GivenPlaces
from aatri.orientation.bodies.height_factor import KNOWN
from aatri.orientation.bodies.limits import FEWEST_MIRRORED, FLAT_CONTROL, MIRRORED_CLEARLY, TRIANGLE
from aatri.orientation.bodies.wrong_control import refuse_mirrored
from aatri.units import length

ONE_ROW = "move the positions in exterior.csv by one row: an image without a position, or a position without an image"


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
    if not moved < MIRRORED_CLEARLY * as_given or as_given <= FLAT_CONTROL * extent:
        return ""
    return (
        f"the positions stand one row off in their table: that of {full.name[row]} fits {full.name[image]}, and so on "
        f"with all {len(rows)}, to {length(moved)} instead of {length(as_given)} (median)"
    )


def refuse_wrong(places: GivenPlaces, use: Bool, to: Similarity, up: Float | None, what: str) -> None:
    """Raise if positions one row off, heights in another unit, or mirrored control or images explain a failure.

    `use`, (n,) bool: observations that take part, kind by kind; `to`: ground from body, about; `up`: in the body.
    """
    if row_shift := one_row_off(places):
        raise GeometryError(f"{what}: {row_shift}", remedy=ONE_ROW)
    control = places.take(np.flatnonzero(places.given.all(axis=1) & (places.kind == CONTROL)))
    if len(control.row) > TRIANGLE and not _fits_with(control, 1.0):
        for factor, (unit, remedy) in KNOWN.items():
            if factor > 0 and _fits_with(control, 1 / factor):
                raise GeometryError(f"{what}: control fits it but for its heights: {unit}", remedy=remedy)
    refuse_mirrored(places, use[places.row], to, up, what)


def _fits_with(control: GivenPlaces, factor: float) -> bool:
    """Whether a body fits most of the control, its heights multiplied by a factor: a point may be wrong by itself."""
    X = control.observed_m * [1.0, 1.0, factor]
    off_m = robust_closed_form(control.xyz, X)[1]
    return bool(np.median(off_m) < FLAT_CONTROL * np.linalg.norm(np.ptp(X, axis=0)))
