"""What of control, positions, distances and attitudes fits an initial orientation: residuals, suspects and notes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjusting.added_variance import observed_components
from aatri.adjustment.statistics.limits import OFF_SIGMAS
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float
from aatri.errors import GeometryError
from aatri.geometry.similarity import UNKNOWNS, Similarity
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.attitudes import KIND as ATTITUDE
from aatri.observations.control import KIND as CONTROL
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE, by_similarity
from aatri.observations.positions import KIND as POSITION
from aatri.observations.ties import BODY
from aatri.orientation.bodies.absolute import OrientedBody
from aatri.orientation.bodies.datum_analysis import given_places
from aatri.orientation.bodies.free_body import FreeBody
from aatri.orientation.bodies.ground_observed import DISTANCES, Chosen, GroundObserved, strain
from aatri.orientation.bodies.limits import MISFIT_OF_RIGHT
from aatri.orientation.bodies.wrong_tables import ONE_ROW, one_row_off
from aatri.orientation.graph.component import ImageComponent
from aatri.orientation.graph.limits import CONTRADICTED, DEFORMED
from aatri.orientation.graph.on_ground import fits_bent

if TYPE_CHECKING:
    from aatri.artifacts.block import Block


SCATTER = 1.4826
"""Standard deviation of a normal variable over the median of its deviations."""


def residuals_at(state: State, o: Observed) -> Float:
    """A component on the ground, reduced to the origin, minus what is observed of it; NaN where not observed."""
    v = o.records.evaluate({**o.start, **state}, np.arange(len(o)))[0]
    return np.where(np.isfinite(o.sigmas()), v, np.nan)


def contradicts(left: Sequence[Observed], state: State, limit: float, far_m: float) -> bool:
    """Whether what is left out is off as a whole by more than `limit` times what one of it is uncertain.

    That is its standard deviation, or the scatter of the closest half where this is larger: standard deviations may be
    guessed, and the positions of two cameras lie apart. Weakly tied strips bend by less, and fit whatever is left. What
    is off by more than `far_m` in the median, or distances by the share `MISFIT_OF_RIGHT` of themselves, is so
    whichever way each of it is: nothing of right ids and units is.

    Parameters
    ----------
    limit : float
        In standard deviations.
    far_m : float, m
        `MISFIT_OF_RIGHT` times the typical distance of the points.
    """
    for o in _of_places(left):
        v, sigma, far = residuals_at(state, o), o.sigmas(), far_m
        if o.kind in DISTANCES:
            length = _ratios([o], state)[1][:, None]
            v, sigma, far = v / length, sigma / length, MISFIT_OF_RIGHT
        for off, sigma_of in zip(v.T, sigma.T):
            testable = np.isfinite(off) & np.isfinite(sigma_of)
            if testable.any():
                off, sigma_of = off[testable], float(np.median(sigma_of[testable]))
                by_scatter = limit * max(sigma_of, _scatter_of_closest_half(off))
                if abs(float(np.median(off))) > by_scatter or np.median(np.abs(off)) > max(limit * sigma_of, far):
                    return True
    return False


def _scatter_of_closest_half(values: Float) -> float:
    """Standard deviation that the shortest interval of half the values has of normal ones (Rousseeuw 1984)."""
    half, ordered = (len(values) + 1) // 2, np.sort(values)
    return 0.5 * SCATTER * float((ordered[half - 1 :] - ordered[: len(values) - half + 1]).min())


def contradiction_note(block: Block, left: Sequence[Observed], state: State, kind: str, what: str) -> Note:
    """What is left out as it contradicts all else; the component is on the ground without it."""
    names = np.concatenate([np.char.add(*o.names(np.arange(len(o)))) for o in left])
    if kind == "distances":
        ratio, _ = _ratios(_of_places(left), state)
        off = f"longer than in it by {1e6 * (float(np.median(ratio)) - 1.0):.0f} ppm"
    else:
        residual = np.concatenate([residuals_at(state, o) for o in _of_places(left)])
        off = f"shifted by {_median_shift(residual)} m"
        images = [touched for o in _of_places(left) for group, touched in o.records.touches if group == POSE]
        camera = block.images.camera[np.concatenate(images)] if images else np.zeros(0, dtype=np.int32)
        if len(np.unique(camera)) > 1:
            by_camera = [f"{block.cameras.id[k]} {_median_shift(residual[camera == k])}" for k in np.unique(camera)]
            off += f" (by camera: {'; '.join(by_camera)})"
    text = f"{what}: {kind} ({len(names)}) contradict all else, {off} in the median: they are left out here"
    if row_shift := one_row_off(given_places(left, state)):
        text += f"; {row_shift}; {ONE_ROW}"
    return Note("warning", text, tuple(names.tolist()))


def _of_places(observed: Sequence[Observed]) -> list[Observed]:
    """Those without unknowns of their own."""
    return [o for o in observed if all(group in (POINT, POSE) for group, _ in o.records.touches)]


def _ratios(distances: Sequence[Observed], state: State) -> tuple[Float, Float]:
    """Distances over their lengths in a component, and these: the derivatives by its scale."""
    ratio, lengths = [], []
    for o in distances:
        rows = np.arange(len(o))
        v, jacobians = o.records.evaluate(state, rows)
        length = by_similarity(o.records, rows, jacobians, state)[:, 0, 6]
        ratio.append(1.0 - v[:, 0] / length)
        lengths.append(length)
    return np.concatenate(ratio), np.concatenate(lengths)


def _median_shift(residual: Float) -> str:
    """Given less computed along X, Y, Z; a dash where no residual has the coordinate."""
    columns = [axis[np.isfinite(axis)] for axis in -residual.T]
    return ", ".join(f"{np.median(axis):.3f}" if len(axis) else "-" for axis in columns)


def deformation_notes(oriented: OrientedBody, body: FreeBody, precision: float, what: str) -> list[Note]:
    """A component that control and positions do not fit, whatever of them is left out.

    `precision` is that of its points, in its unit.

    Raises
    ------
    GeometryError
        If it rests on so few that without any one the datum is open, and they are too far off for a bundle to begin:
        nothing tells which is wrong.
    """
    expected = precision * oriented.ground_from_body.scale
    tau = oriented.tied.tau_m
    if tau <= DEFORMED * expected:
        return []
    reason = "a wrong principal distance, distortion, unit or id, or several gross errors"
    if row_shift := one_row_off(oriented.places):
        reason = f"{row_shift}; {ONE_ROW}"
    places, ground = oriented.places, oriented.tied.problem.ground
    own = {u.name: int(u.free.sum()) for o in ground for u in o.unknowns}
    spare = sum(int(observed_components(o).sum()) for o in ground) - UNKNOWNS - sum(own.values())
    if spare < places.given.sum(axis=1).max(initial=0) and strain(oriented, body) > CONTRADICTED:
        off_m = np.linalg.norm(np.where(places.given, places.xyz - places.observed_m, 0.0), axis=1)
        named = ", ".join(f"{places.name[k]} {off_m[k]:.2g} m" for k in np.argsort(-off_m, kind="stable"))
        raise GeometryError(
            f"{what}: what is observed of it contradicts itself, and is so little that nothing tells what is wrong; "
            f"off by {named}",
            remedy=f"check the coordinates, numbers and axes of these, or observe more; {reason} would do it too",
        )
    text = f"{what}: control and positions fit it only with {tau:.2g} m added to the standard deviations of its "
    return [Note("warning", f"{text}points, {expected:.2g} m: {reason}")]


def two_that_differ(oriented: OrientedBody, precision_m: float, limit: float) -> tuple[float, list[Note]]:
    """Where two distances alone tell the scale and differ, nobody can tell which one is wrong: by which ratio, and why.

    The points of the component, scaled by them, are known to `precision_m`.
    """
    observed = [o for o in _of_places(oriented.tied.problem.ground) if o.kind in DISTANCES]
    if sum(map(len, observed)) != 2 or not all(o.kind in (*DISTANCES, ATTITUDE) for o in oriented.tied.problem.ground):
        return 0.0, []
    ratio, length = _ratios(observed, oriented.state)
    sigma = np.concatenate([o.sigmas()[:, 0] for o in observed])
    names = np.concatenate([o.names(np.arange(len(o)))[1] for o in observed])
    error = np.hypot(sigma, np.sqrt(2.0) * precision_m) / length
    by = abs(ratio[1] / ratio[0] - 1)
    if abs(ratio[1] - ratio[0]) <= limit * float(np.hypot(*error)):
        return 0.0, []
    text = (
        f"two distances alone tell the scale; they differ by {by:.2%}, one of them is wrong, and nothing tells which: "
    )
    return by, [Note("warning", f"{text}both are used, as if uncertain by that", tuple(names.tolist()))]


def with_uncertain_distances(observed: Iterable[Observed], state: State, share: float) -> tuple[Observed, ...]:
    """The same, standard deviations of distances at least that share of their lengths."""

    def uncertain(o: Observed) -> Observed:
        if o.kind not in DISTANCES or o.exact:
            return o
        wider = np.maximum(share * _ratios([o], {**o.start, **state})[1][:, None] / o.sigmas(), 1.0)
        L = o.records.whitener
        return replace(o, records=replace(o.records, whitener=L / (wider if L.ndim == 2 else wider[:, :, None])))

    return tuple(map(uncertain, observed))


def attitude_notes(ground: GroundObserved, body: FreeBody, to: Similarity, what: str) -> list[Note]:
    """How attitudes agree with an orientation they took no part in: their common offset, camera by camera."""
    block, notes = ground.block, list[Note]()
    start = body.on_ground(to)
    for o in ground.of(body, lambda o: o.kind == ATTITUDE, attitudes=True)(to):
        complete = np.flatnonzero(np.isfinite(o.sigmas()).all(axis=1))
        start = {**o.start, **start}
        v, (by_pose, *_) = o.records.evaluate(start, complete)
        image = o.records.touches[0][1][complete]
        turned = np.linalg.solve(by_pose[:, :, 3:], v[:, :, None])[:, :, 0]  # on the ground side
        lacking = np.einsum("nji,nj->ni", start[POSE].ground_from_image[image], turned)
        variance, camera = (o.sigmas()[complete] ** 2).mean(axis=1), block.images.camera[image]
        for k in np.unique(camera).tolist():
            of_camera = np.flatnonzero(camera == k)
            offset = np.median(lacking[of_camera], axis=0)
            off = np.linalg.norm(lacking[of_camera] - offset, axis=1)
            sigma = np.sqrt(variance[of_camera] + (SCATTER * np.median(off)) ** 2 / 3)
            wrong = block.images.id[image[of_camera[off > OFF_SIGMAS * sigma]]]
            text = (
                f"{what}: not of camera {block.cameras.id[k]}, whose "
                f"{several(len(of_camera), 'attitude', 'differs', 'differ')} by "
                f"{np.degrees(np.linalg.norm(offset)):.2g} deg in common, by {np.degrees(np.median(off)):.2g} deg "
                "(median) beyond that"
            )
            notes.append(Note("note", text))
            if len(wrong):
                text = f"{what}: {several(len(wrong), 'attitude', 'is', 'are')} far off the others"
                notes.append(Note("warning", text, tuple(wrong.tolist())))
    return notes


def fits_as_it_bends(
    block: Block, component: ImageComponent, oriented: OrientedBody, rays: ImagePointRows, among: Bool | None = None
) -> bool:
    """Whether all that the orientation used fits a component that is not rigid, beside `among` of it."""
    beside = () if among is None else _in_use(oriented, among)
    return fits_bent(component, rays, _in_use(oriented, oriented.tied.active), block.images.id, block.points.id, beside)


def _in_use(oriented: OrientedBody, active: Bool) -> list[Observed]:
    """What is observed of the ground with those in use, and the priors of its own unknowns."""
    problem, state = oriented.tied.problem, oriented.state
    used = np.split(active, problem.edges[1:-1])[len(problem.ties) :]
    observed = [o.without(~in_use) for o, in_use in zip(problem.ground, used)]
    observed += [o for o in problem.priors if BODY not in dict(o.records.touches)]
    return [replace(o, start={name: state[name] for name in o.start}) for o in observed]


def without_one(observed: Sequence[Observed]) -> Iterator[tuple[str, Chosen]]:
    """One kind that may contradict all else, and whether an observation is of the others: distances, positions,
    control."""
    kinds = {o.kind for o in observed if len(o)}
    if kinds & set(DISTANCES):
        yield "distances", lambda o: o.kind not in DISTANCES
    if {CONTROL, POSITION} <= kinds:
        yield "observed positions", lambda o: o.kind != POSITION
        yield "control", lambda o: o.kind != CONTROL
