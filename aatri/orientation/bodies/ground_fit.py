"""How bodies on the ground fit control, positions and each other; wrong heights or principal distances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from aatri.arrays import Bool, Float
from aatri.errors import ConvergenceError, InputError
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bodies.absolute import OrientedBody
from aatri.orientation.bodies.absolute_datum import OrientedPart, free_images, pooled
from aatri.orientation.bodies.deformation import Misfit, distance_m, most_models, names_of, rms_m, sigma0_notes
from aatri.orientation.bodies.height_factor import height_factor
from aatri.orientation.bodies.limits import FARTHEST_START, VERTICAL_COSINE
from aatri.orientation.bodies.wrong_tables import ONE_ROW, one_row_off

if TYPE_CHECKING:
    from aatri.artifacts.block import Block
    from aatri.artifacts.strips import Strips


WORST = 5
"""So many observations are named where strips and control do not fit."""

CHECK_DISTANCE = "check principal distance and pixel size, both in mm, and unit and reference of the heights"


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
            most_models(strips),
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
        distances.append(part.result.ground_from_body.scale * distance_m(centres, part.component.xyz))
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


def distant_start(
    block: Block, strips: Strips, parts: Sequence[OrientedPart], misfit: ConvergenceError, *, may_begin: bool
) -> Note:
    """A warning where the bundle, which tells what is wrong, can begin from the largest misfit.

    It names the principal distance that explains the misfit, as far as heights tell it.

    Raises
    ------
    ConvergenceError
        The misfit, where it is beyond `FARTHEST_START`, or the bundle is not to begin from it.
    """
    shares = [_misfit_m(part) / max(_distance_m(strips, [part]), np.finfo(float).tiny) for part in parts]
    k = int(np.argmax(shares))
    row_shift, stretch, off = one_row_off(parts[k].result.places), _stretch(block, parts[k].result), shares[k]
    text, remedy = misfit.what, misfit.remedy
    if row_shift:
        text, remedy, stretch = f"{text}; {row_shift}", ONE_ROW, ""
    elif stretch:
        text, remedy = f"{text}; {stretch}", CHECK_DISTANCE
    if not may_begin or not off <= FARTHEST_START:
        raise ConvergenceError(text, where=misfit.where, remedy=remedy) from misfit
    share = f"that is {off:.1%} of the distance between images and points: the bundle can begin from there"
    if stretch:
        remedy = f"{remedy}, or estimate the principal distance (`self_calibration`)"
    return Note("warning", f"{text}; {share}; {remedy}")


def _stretch(block: Block, body: OrientedBody) -> str:
    """In words, by what factor control and positions together ask for another principal distance; else empty.

    A principal distance too long by f stretches a model along its rays: its heights, and the flying height above it.
    Over flat ground a common error of the heights of all positions does the same. Of oblique images the stretch is
    not one of the heights, which tell it, but not its size.
    """
    places = body.places
    factor = height_factor(places.xyz, places.observed_m, places.given)
    if factor is None or factor.factor == 0.0:  # heights that are all alike tell no principal distance
        return ""
    levels_m = [
        np.median(places.observed_m[of_kind & places.given[:, 2], 2])
        for of_kind in (places.kind == CONTROL, places.kind != CONTROL)
        if (of_kind & places.given[:, 2]).any()
    ]
    c_mm = np.unique(block.cameras.principal_distance_mm[block.images.camera])
    share = f"{factor.factor:.3f} (+- {factor.sigma:.2g}) times as much as those of the models"
    oblique = np.nanmedian(body.state[POSE].ground_from_image[:, 2, 2]) < VERTICAL_COSINE
    if len(levels_m) < 2 or len(c_mm) > 1 or oblique:
        return f"given heights vary {share}: their unit or a principal distance is wrong"
    off_m = (levels_m[1] - levels_m[0]) * (1 / factor.factor - 1)
    distance = f"a principal distance of {c_mm[0] * factor.factor:.2f} mm instead of {c_mm[0]:.2f} mm"
    higher = f"positions {abs(off_m):.3g} m {'higher' if off_m > 0 else 'lower'}"
    return f"heights of control and positions vary {share}: {distance} would explain it, or {higher}"


def height_notes(block: Block, body: OrientedBody, what: str) -> list[Note]:
    """A warning where heights of control differ from those of the model by a factor.

    Raises
    ------
    InputError
        If that is certain.
    """
    observed = body.tied.problem.observed
    control = [o for o in observed if o.kind == CONTROL and len(o)]
    if not control:
        return []
    places = body.places
    places = places.take(places.kind == CONTROL)
    sigma_m, row = (np.concatenate(columns) for columns in zip(*((o.sigmas()[:, 2], o.row) for o in control)))
    factor = height_factor(places.xyz, places.observed_m, places.given, sigma_m)
    if factor is None:
        return []
    if not factor.certain:
        return [Note("warning", f"{what}: {factor}; {factor.remedy}")]
    where = block.read_at(block.ground_points, int(row[np.argmax(places.given[:, 2])]))
    raise InputError(f"{what}: {factor}", where=where, remedy=factor.remedy)
