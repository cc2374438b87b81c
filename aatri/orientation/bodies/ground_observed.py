"""What a block observes of the ground, held against free bodies: every kind, as the bundle has it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError, InputError
from aatri.frames.tangent import TangentFrame
from aatri.geometry.similarity import IDENTITY, Similarity
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.attitudes import KIND as ATTITUDE
from aatri.observations.carried_vectors import EXPOSURE_TIME
from aatri.observations.control import KIND as CONTROL
from aatri.observations.control import control_of, origin_of
from aatri.observations.geodetic.distances import HORIZONTAL
from aatri.observations.geodetic.distances import KIND as DISTANCE
from aatri.observations.kinds import catalogue
from aatri.observations.kinds.catalogue import KindOptions, observe
from aatri.observations.observed import ObservationSource, Observed, level_of
from aatri.observations.poses import POINT, POSE
from aatri.observations.positions import KIND as POSITION
from aatri.observations.positions import positions_of
from aatri.observations.relative.differences import DISTANCE as RELATIVE
from aatri.orientation.bodies.absolute import OrientationSettings, OrientedBody, orient_body
from aatri.orientation.bodies.datum_analysis import OpenDatumError
from aatri.orientation.bodies.datum_start import Observe
from aatri.orientation.bodies.free_body import LEVEL_RAD, FreeBody, concerning, levelled
from aatri.orientation.bodies.limits import HARDLY_DETERMINED, MISFIT_OF_RIGHT

if TYPE_CHECKING:
    from aatri.artifacts.block import Block


NOT_USED = ("ground_point_covariances", "geodetic_covariances", "images.rig")

USES = tuple(name for name in (*catalogue.USES, "undulation", "earth_curvature:frame") if name not in NOT_USED)
"""What the orientation of bodies uses of a block: neither correlations between points nor rigs."""

LEFT_TO_THE_BUNDLE = ("image_points", "ground_point_covariances", "geodetic_covariances")
"""Tables that say nothing of free bodies."""

NEIGHBOUR = "neighbour"
"""Kind of the points that bodies on the ground give others."""

BEGUN_LEVEL = "begun level for the bundle: what stands before it is not determined"

DISTANCES = (DISTANCE, HORIZONTAL, RELATIVE)
PLACES = (CONTROL, POSITION, NEIGHBOUR)
"""Kinds of given coordinates."""

Chosen = Callable[[Observed], bool]


@dataclass(frozen=True)
class GroundObserved:
    """What is observed of a block."""

    block: Block
    """In its own frame, without image points and correlations between points."""
    inside: Block
    """In the frame of the adjustment."""
    origin_m: Float
    """(3,), m. In the frame of the adjustment; all places are reduced to it."""
    use_positions: bool
    frame: TangentFrame | None
    geodesy: TangentFrame | None
    """See `ObservationSource`."""
    beside: tuple[Observed, ...] = ()
    """Further observations, such as what neighbours of a body tell of it."""
    time_offset: bool = False
    """Positions have an exposure-time offset for each camera."""

    def of(self, body: FreeBody, chosen: Chosen, *, attitudes: bool = False, drift: bool = True) -> Observe:
        """Observations that concern a body, wherever it lies.

        Parameters
        ----------
        chosen : callable
            Observed -> whether they take part.
        attitudes : bool
            Attitudes take part.
        drift : bool
            Positions of a drift group have a shift and a drift; else these are neglected.
        """
        options = KindOptions.model_validate(
            {
                "positions": {
                    "use": self.use_positions,
                    "drift": "linear" if drift else "none",
                    "time_offset": self.time_offset,
                },
                "attitudes": {"use": attitudes},
                "rigs": {"use": False},
            }
        )
        level = level_of(self.frame, self.geodesy, self.origin_m)

        def observed(to: Similarity) -> tuple[Observed, ...]:
            start = body.on_ground(to)
            source = ObservationSource(self.block, None, self.origin_m, start, (), level, self.frame, self.geodesy)
            beside = tuple(o for o in self.beside if attitudes or o.kind != ATTITUDE)
            taking_part = [o for o in (*observe(source, options), *beside) if chosen(o)]
            unknowns = {*start, *(name for o in taking_part for name in o.start)}
            # the weight of a lever arm says nothing of a body without positions, which bring its unknowns
            return concerning([o for o in taking_part if unknowns.issuperset(dict(o.records.touches))], body)

        return observed


def ground_observed(
    as_given: Block, inside: Block, frame: TangentFrame | None, geodesy: TangentFrame | None, *, use_positions: bool
) -> GroundObserved:
    """What is observed of a block, given in its own frame and in that of the adjustment."""
    observed = use_positions and len(inside.exterior)
    position_m, control = positions_of(inside).position_m if observed else np.zeros((0, 3)), control_of(inside)
    if not (len(position_m) or len(control.point)):
        position_m = inside.ground_points.xyz_m[inside.ground_points.datum]
    without = {name: getattr(as_given, name).take(np.zeros(0, dtype=np.int64)) for name in LEFT_TO_THE_BUNDLE}
    origin = origin_of(control, position_m)
    return GroundObserved(replace(as_given, **without), inside, origin, use_positions, frame, geodesy)


def with_level_images(ground: GroundObserved, image: Int) -> GroundObserved:
    """The same, and that images (n,) look down, in the mean to `LEVEL_RAD`: where a turn about a line is open."""
    looking_down = levelled(image, LEVEL_RAD * np.sqrt(len(image)), ground.block.images.id[image])
    return replace(ground, beside=(*ground.beside, looking_down))


def everything(_: Observed) -> bool:
    """All kinds."""
    return True


def oriented_by(
    ground: GroundObserved,
    body: FreeBody,
    settings: OrientationSettings,
    what: str,
    *,
    chosen: Chosen = everything,
    begin: Callable[[Sequence[Observed]], Bool] | None = None,
) -> tuple[OrientedBody, list[Note]]:
    """A body on the ground by given coordinates; by all kinds where these leave something open.

    Distances take part at once in a body that is hardly deformed; attitudes come last but for all other kinds, as a
    boresight that nobody measured turns them all. Where positions with a shift and a drift of their groups leave the
    body open, these are neglected; and nothing is rejected where what does not fit for that is needed.

    Raises
    ------
    OpenDatumError
        If all kinds together, with nothing rejected, leave something open.
    GeometryError
        If something is not determined otherwise.
    ConvergenceError
        If the first kinds contradict each other, and attitudes do not tell what is wrong.
    """
    kinds = {o.kind for o in ground.of(body, chosen, attitudes=True)(IDENTITY) if not o.components}
    first: tuple[str, ...] = (*PLACES, *DISTANCES) if settings.stiff else PLACES
    ways: list[tuple[tuple[str, ...], float]] = [(first, settings.weakest)]
    ways += [((*first, ATTITUDE), settings.weakest)] if ATTITUDE in kinds else []
    if kinds - {*first, ATTITUDE}:  # shapes, angles, lines tell from nearby, more exactly than coordinates do
        ways.append((tuple(kinds | {*first, ATTITUDE}), min(settings.weakest, HARDLY_DETERMINED)))
    images, points, failed = ground.block.images.id, ground.block.points.id, list[GeometryError | ConvergenceError]()
    strained = list[OrientedBody]()
    drifts = ((True, True), (False, True), (False, False)) if _drifting(ground, body) else ((True, True),)
    for (used, weakest), (drift, rejects) in product(ways, drifts):
        if not drift and failed and isinstance(failed[0], ConvergenceError):
            continue  # what does not fit is not what shift and drift leave open

        def taking_part(o: Observed, used: tuple[str, ...] = used) -> bool:
            return chosen(o) and (bool(o.components) or o.kind in used)

        seen = ground.of(body, taking_part, attitudes=ATTITUDE in used, drift=drift)
        try:
            # what is neglected bends the body: what does not fit it as it is need not be wrong
            stiff, may_reject = settings.stiff and drift, settings.rejects and rejects
            relaxed = replace(settings, weakest=weakest, stiff=stiff, rejects=may_reject)
            oriented = orient_body(seen, body, relaxed, what=what, image_ids=images, point_ids=points, begin=begin)
        except (ConvergenceError, GeometryError) as error:
            failed.append(error)  # attitudes may tell which of three control points is wrong
            continue
        share = strain(oriented, body)
        if ATTITUDE not in used and ATTITUDE in kinds and drift and share > MISFIT_OF_RIGHT:
            strained.append(oriented)
            added = f"{oriented.tied.tau_m:.2g} m, {share:.1%} of the distance between images and points"
            failed.append(ConvergenceError(f"they fit it only where its points are off by {added}"))
            continue  # attitudes may tell what is wrong
        if strained and share > MISFIT_OF_RIGHT:
            break
        notes = [] if used == first else [_of_more(oriented, first, what, failed[0].what)]
        if not drift:
            text = f"{what}: shift and drift of positions are neglected; with them {failed[0].what}"
            notes.append(Note("note", text))
        return replace(oriented, neglects=not drift), notes
    if strained:
        return strained[0], []
    if not isinstance(failed[0], GeometryError):
        raise failed[0]
    left_open = [error for error in failed if isinstance(error, GeometryError)][-1]
    if isinstance(left_open, OpenDatumError) and not all(isinstance(error, OpenDatumError) for error in failed):
        raise GeometryError(left_open.what, remedy=left_open.remedy)  # more kinds determine it, and fail otherwise
    raise left_open


def by_time_offsets(
    ground: GroundObserved, body: FreeBody, settings: OrientationSettings, what: str
) -> tuple[OrientedBody, Note] | None:
    """A body that all fits if the times of its positions are off; None where it does not, or no velocity is known."""
    try:
        oriented, _ = oriented_by(replace(ground, time_offset=True), body, settings, what)
    except (ConvergenceError, GeometryError, InputError):
        return None
    tied = oriented.tied
    if tied.tau_m > 0 or tied.above.any() or not tied.active.all() or EXPOSURE_TIME not in oriented.state:
        return None
    offset_s = np.ravel(oriented.state[EXPOSURE_TIME])
    by = ", ".join(f"{ground.block.cameras.id[k]} {offset_s[k]:.3g} s" for k in np.flatnonzero(offset_s))
    text = f"{what}: control and positions fit it with another exposure time ({by}), which a bundle estimates or tests"
    return oriented, Note("note", text)


def strain(oriented: OrientedBody, body: FreeBody) -> float:
    """What is added to the standard deviations of its points so that all fits, as a share of the images' distance.

    That is the median distance of the images from the nearest point, as they may stand around an object or within it.
    """
    if oriented.tied.tau_m == 0:
        return 0.0
    points, centres = body.xyz[body.has[POINT]], body.poses.position_m[body.has[POSE]]
    return oriented.tied.tau_m / (oriented.ground_from_body.scale * float(np.median(cKDTree(points).query(centres)[0])))


def _of_more(oriented: OrientedBody, first: Sequence[str], what: str, failure: str) -> Note:
    """That more than given coordinates takes part, and why."""
    kinds = {o.kind for o in oriented.tied.problem.ground}
    turned = sum(len(o) for o in oriented.tied.problem.ground if o.kind == ATTITUDE)
    text = f"{what}: oriented by observations of all kinds together; without them {failure}"
    if kinds <= {*first, ATTITUDE}:
        turned_images = several(turned, "image")
        text = f"{what}: attitudes of {turned_images} take part, as control and positions do not place it: {failure}"
    return Note("note", text)


def _drifting(ground: GroundObserved, body: FreeBody) -> bool:
    """Whether positions with a shift of their group concern the body."""
    exterior = ground.block.exterior
    drifts = exterior.image[(exterior.drift_group != "") & np.isfinite(exterior.position_m).any(axis=1)]
    return bool(ground.use_positions and body.has[POSE][drifts].any())


def placed(observed: Sequence[Observed]) -> bool:
    """Whether coordinates tell where a body lies."""
    ends = [[group for group, _ in o.records.touches if group in (POINT, POSE)] for o in observed]
    return any(len(e) == 1 and o.unit == "m" and o.records.rows == 3 for e, o in zip(ends, observed))
