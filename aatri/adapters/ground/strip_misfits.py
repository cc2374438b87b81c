"""Whether strips fit control and positions, and how well each of them does."""

from collections.abc import Sequence

import numpy as np

from aatri.adapters.ground.absolute_datum import OrientedPart, free_images, pooled
from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips.tied_tables import names_of
from aatri.arrays import Bool, Float
from aatri.artifacts.strips import Strips
from aatri.errors import ConvergenceError
from aatri.notes import Note
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bodies.deformation import Misfit, rms_m, sigma0_notes

WORST = 5
"""So many observations are named where strips and control do not fit."""


def fit_notes(strips: Strips, parts: Sequence[OrientedPart], max_sigma0: float | None) -> list[Note]:
    """What the misfits of components on the ground say of their strips.

    Raises
    ------
    ConvergenceError
        If no deformation explains them, nor shifts of positions that are neglected.
    """
    adjusted = [(name, tied) for part in parts for name, tied in part.adjusted()]
    try:
        return sigma0_notes(
            [tied for _, tied in adjusted],
            [name for name, _ in adjusted],
            pooled(parts)[1],
            pieces.most_models(strips),
            Misfit(max_sigma0, _distance_m(strips, parts)),
            max(map(_misfit_m, parts), default=0.0),
            "absolute orientation",
        )
    except ConvergenceError as error:
        if any(part.result.neglects for part in parts):
            text = f"{error.what}{_farthest(parts)}; shift and drift of positions are neglected here"
            return [Note("warning", text)]
        raise ConvergenceError(error.what + _farthest(parts), where=error.where, remedy=error.remedy) from error


def misfitting_strips(strips: Strips, parts: Sequence[OrientedPart]) -> list[tuple[int, float]]:
    """The strips and how far they are off their control, their positions and other strips (RMS, m), farthest first."""
    off = [(strip, _off_m(strips, part, strip)) for part in parts for strip in part.component.strips.tolist()]
    return sorted(off, key=lambda row: -row[1])


def _off_m(strips: Strips, part: OrientedPart, strip: int) -> float:
    """RMS of the residuals that touch one strip of a component, m."""
    table, images = strips.strip_points, strips.strip_images
    has = {POINT: table.point[table.strip == strip], POSE: images.image[images.strip == strip]}
    touching = [
        np.any([np.isin(block, has[group]) for group, block in o.records.touches if group in has], axis=0)
        for o in part.result.tied.problem.observed
    ]
    off, used = _residuals(part)
    lengths = [_lengths(off)[used & np.concatenate(touching)[part.result.places.row]]]
    ties = part.component.tied
    if ties is not None:
        of_strip = (table.strip[part.component.rows] == strip) & ties.active
        lengths.append(part.result.ground_from_body.scale * _lengths(ties.residuals[of_strip]))
    squares = np.concatenate(lengths) ** 2
    squares = squares[squares > 0]
    return float(np.sqrt(squares.mean())) if len(squares) else 0.0


def _residuals(part: OrientedPart) -> tuple[Float, Bool]:
    """Component on the ground minus given coordinates, NaN where not given; and which of them are used."""
    places = part.result.places
    return np.where(places.given, places.xyz - places.observed_m, np.nan), part.result.tied.active[places.row]


def _lengths(residuals: Float) -> Float:
    return np.asarray(np.linalg.norm(np.nan_to_num(residuals), axis=1))


def _distance_m(strips: Strips, parts: Sequence[OrientedPart]) -> float:
    """From the projection centres to the points, mean of all components, m."""
    distances = []
    for part in parts:
        centres = free_images(strips, part.component)[0]
        distances.append(part.result.ground_from_body.scale * pieces.distance_m(centres, part.component.xyz))
    return float(np.mean(distances)) if distances else 0.0


def _misfit_m(part: OrientedPart) -> float:
    """RMS by which control and positions, or strips, do not fit; the larger."""
    misfit, ties = rms_m(*_residuals(part)), part.component.tied
    if ties is None:
        return misfit
    return max(misfit, part.result.ground_from_body.scale * rms_m(ties.residuals, ties.active))


def _farthest(parts: Sequence[OrientedPart]) -> str:
    """The given coordinates that are farthest from where the strips put them, for an error."""
    rows = list[tuple[float, str]]()
    for part in parts:
        off = _lengths(_residuals(part)[0])
        worst = np.argsort(-off, kind="stable")[:WORST]
        names = names_of(part.result.tied, part.result.places.row[worst])
        rows += list(zip(off[worst].tolist(), names))
    texts = [f"{name} {m:.3g} m" for m, name in sorted(rows, reverse=True)[:WORST] if m > 0]
    return f"; farthest off: {', '.join(texts)}" if texts else ""
