"""Where models given by coordinates lie on the ground, about: the start of their adjustment.

Models are first joined by common points to free components, none of them averaged for the adjustment that follows, and
a component is laid onto its control by one similarity. What control leaves open of a component may be determined by its
points common with those on the ground. Components that are determined only together begin level, and stay where control
and common points determine all seven parameters of each of them (`orientation.bodies.common_datum`).
"""

from dataclasses import dataclass, field

import numpy as np

from aatri.arrays import Float, Text
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.similarity import Similarity, compose, transform
from aatri.notes import Note
from aatri.observations.control import Control, known_at, observed_control
from aatri.observations.observed import Observed
from aatri.observations.poses import Poses
from aatri.orientation.bodies.absolute import OrientationSettings, Start, orient_body
from aatri.orientation.bodies.common_datum import PlacedBody, undetermined_bodies
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.components import Component, FreeBlock, join_strips, strip_names
from aatri.orientation.bodies.free_body import LEVEL_RAD, FreeBody, concerning, levelled
from aatri.orientation.bodies.limits import START_LIMIT, TIE_LIMIT


@dataclass
class _OnGround:
    """Components on the ground so far, reduced to the origin."""

    point_ids: Text
    control: Control
    free: FreeBlock
    what: list[str]
    """What messages call each component."""
    origin: Float
    exchanged: bool
    """Control points with each other's number are searched for."""
    oriented: dict[int, Similarity] = field(default_factory=dict)
    failed: dict[int, GeometryError] = field(default_factory=dict)
    """The first cause of each."""
    by_others: list[int] = field(default_factory=list)
    """Those that points common with others helped to determine."""
    level: list[int] = field(default_factory=list)
    """Those that began level."""


def models_on_ground(
    point_ids: Text, control: Control, points: BodyPoints, names: Text, origin: Float, *, exchanged: bool = True
) -> tuple[list[Similarity | None], list[Note]]:
    """Every model on the ground, reduced to the origin, about; None where its component is not determined.

    Raises
    ------
    GeometryError
        If none is; the message names what is missing.
    """
    free = join_strips(points, names.tolist(), point_ids=point_ids, limit=TIE_LIMIT, word="model")
    what = [strip_names(c, names.tolist(), "model") for c in free.components]  # the largest first
    ground = _OnGround(point_ids, control, free, what, origin, exchanged)
    _orient(ground, level=False)
    if len(ground.oriented) < len(what):
        _orient(ground, level=True)
    if ground.level:
        _leave_out_undetermined(ground)
    joined = tuple(
        f"{one} and {other} have "
        for one in what
        for other in what
        for k in ground.by_others
        if what[k] in (one, other)
    )
    apart = [f"not joined: {text}" for text in free.unjoined if not text.startswith(joined)]
    left = [error for k, error in ground.failed.items() if k not in ground.oriented]
    if not ground.oriented:
        raise GeometryError("; ".join([*(e.what for e in left), *apart]), remedy=left[0].remedy)
    start = list[Similarity | None]([None] * len(names))
    for k, to in ground.oriented.items():
        for strip, pose in zip(free.components[k].strips.tolist(), free.components[k].component_from_strip):
            start[strip] = compose(to, pose)
    text = "determined by control and points common with other models"
    notes = [Note("note", f"{what[k]}: {text}") for k in ground.by_others]
    return start, notes + [Note("warning", text) for text in (*apart, *(f"left out: {e.what}" for e in left))]


def _orient(ground: _OnGround, *, level: bool) -> None:
    """Orient one component after the other by control and by the points of those on the ground."""
    before, places = -1, _places(ground)
    while before < len(ground.oriented) < len(ground.what):
        before = len(ground.oriented)
        for k, component in enumerate(ground.free.components):
            if k in ground.oriented or _contradicts(ground, k):
                continue
            try:
                ground.oriented[k] = _oriented(ground, places, component, ground.what[k], level=level)
            except (ConvergenceError, GeometryError) as error:
                if not level and isinstance(error, ConvergenceError):
                    raise
                if isinstance(error, GeometryError):
                    ground.failed.setdefault(k, error)
                continue
            if level or places is not ground.control:
                ground.by_others.append(k)
            if level:
                ground.level.append(k)
                places = _places(ground)
        places = _places(ground)


def _contradicts(ground: _OnGround, k: int) -> bool:
    """Whether a component has common points that do not fit with one on the ground; it is named as the cause."""
    first = int(ground.free.components[k].strips[0])
    for j in ground.oriented:
        if frozenset((first, int(ground.free.components[j].strips[0]))) in ground.free.contradicting:
            text = f"{ground.what[k]}: its points common with {ground.what[j]} do not fit"
            ground.failed[k] = GeometryError(text)
            return True
    return False


def _leave_out_undetermined(ground: _OnGround) -> None:
    """Of the components that began level, those that control and common points do not determine."""
    control, components = ground.control, ground.free.components
    bodies = {k: PlacedBody(components[k].point, transform(to, components[k].xyz)) for k, to in ground.oriented.items()}
    for k in undetermined_bodies(bodies, ground.level, control.point, control.given):
        del ground.oriented[k]
        ground.by_others.remove(k)


def _oriented(ground: _OnGround, places: Control, component: Component, what: str, *, level: bool) -> Similarity:
    """A component laid onto the places of its points."""
    ids = ground.point_ids
    observed, body = observed_control(places, ground.origin, ids[places.point]), _body(component, len(ids))
    upright = (levelled(np.array([0]), LEVEL_RAD, np.array([what])),) if level else ()

    def seen(_: Similarity) -> tuple[Observed, ...]:
        return (*concerning(observed, body), *upright)

    start: Start = "centroids" if level else "closed"
    settings = OrientationSettings(START_LIMIT, start=start, exchanged=ground.exchanged)
    return orient_body(seen, body, settings, what=what, image_ids=np.array([what]), point_ids=ids).ground_from_body


def _places(ground: _OnGround) -> Control:
    """Control, and beside it the points of components on the ground where they lie."""
    if not ground.oriented:
        return ground.control
    parts, taken = [ground.control], set(ground.control.point.tolist())
    for k, to in ground.oriented.items():
        component = ground.free.components[k]
        new = np.flatnonzero([p not in taken for p in component.point.tolist()])
        taken |= set(component.point[new].tolist())
        R = to.scale * to.rotation
        size_m = to.scale * float(np.linalg.norm(np.ptp(component.xyz, axis=0)))
        off_m = LEVEL_RAD * size_m if k in ground.level else 0.0
        covariance_m2 = R @ component.covariance[new] @ R.T + off_m**2 * np.eye(3)
        parts.append(known_at(component.point[new], transform(to, component.xyz[new]) + ground.origin, covariance_m2))
    return Control(*(np.concatenate([getattr(c, f) for c in parts]) for f in Control.__dataclass_fields__))


def _body(component: Component, n_points: int) -> FreeBody:
    """A component as a body, seen from above as models are, whose Z is upwards: no image of it is known."""
    xyz, covariance = np.full((n_points, 3), np.nan), np.full((n_points, 3, 3), np.nan)
    xyz[component.point], covariance[component.point] = component.xyz, component.covariance
    above = component.xyz.mean(axis=0) + np.ptp(component.xyz, axis=0).max() * np.array([0.0, 0.0, 1.0])
    typical = float(np.median(np.einsum("nii->n", component.covariance))) / 3
    return FreeBody(Poses(above[None], np.eye(3)[None]), xyz, covariance, typical * np.eye(3)[None], 1.0)
