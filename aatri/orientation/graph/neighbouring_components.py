"""Components of images that have too little of their own, by what they share with others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Text, finite_rows
from aatri.errors import AatriError, ConvergenceError, GeometryError
from aatri.geometry.similarity import IDENTITY, Similarity
from aatri.ids import several, shown
from aatri.notes import Note
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.observed import Observed
from aatri.orientation.bodies.absolute import OrientationSettings, OrientedBody
from aatri.orientation.bodies.by_attitudes import images_by_attitudes
from aatri.orientation.bodies.datum_analysis import OpenDatumError
from aatri.orientation.bodies.ground_observed import GroundObserved, oriented_by, strain
from aatri.orientation.bodies.neighbouring_bodies import beside_neighbours, oriented_together
from aatri.orientation.graph.component import ImageComponent, component_of
from aatri.orientation.graph.component_bodies import body_of
from aatri.orientation.graph.limits import CONTRADICTED, FEWEST_OTHERS, MOST_SHARED


@dataclass(frozen=True)
class OnGround:
    """A component on the ground."""

    component: ImageComponent
    """In the ground's frame, reduced to the origin."""
    oriented: OrientedBody | None
    """None where its neighbours brought it there, or nothing is observed of it."""
    similarity: Similarity
    """Ground from component."""
    free: bool = False
    """Nothing tells where it lies."""
    datum: Text | None = None
    """Points by whose approximate coordinates it lies there."""
    left: tuple[Observed, ...] = ()
    """What is left out, as it contradicts all else."""


def by_neighbours(
    ground: GroundObserved,
    component: ImageComponent,
    rays: ImagePointRows,
    neighbours: Sequence[ImageComponent],
    what: str,
    settings: OrientationSettings,
) -> tuple[OnGround, str] | str:
    """A component by what it shares with others, without a point that contradicts all else, and which; or why not."""

    def oriented(own: ImageComponent) -> tuple[OnGround, OrientedBody] | None:
        body = body_of(own, rays)
        beside = beside_neighbours(ground, [body_of(c, rays) for c in neighbours], body)
        if not beside.beside:
            return None
        seated, _ = oriented_by(beside, body, settings, what)
        if (share := strain(seated, body)) > CONTRADICTED:
            added = f"{seated.tied.tau_m:.2g} m, {share:.1%} of the distance between images and points"
            raise ConvergenceError(f"it fits only where its points are off by {added}")
        return OnGround(own.moved(seated.ground_from_body), None, seated.ground_from_body), seated

    try:
        part = oriented(component)
        return "" if part is None else (part[0], "")
    except GeometryError as error:
        return error.what.removeprefix(f"{what}: ")
    except ConvergenceError as error:
        reason = error.what
    shared = np.flatnonzero(np.any([finite_rows(c.xyz) for c in neighbours], axis=0) & finite_rows(component.xyz))
    fits = list[tuple[float, int, OnGround]]()
    for point in shared.tolist() if FEWEST_OTHERS < len(shared) <= MOST_SHARED else []:
        try:
            part = oriented(component.without_point(point, rays))
        except (ConvergenceError, GeometryError):
            continue
        if part is not None and part[1].tied.tau_m == 0:
            fits.append((part[1].tied.sigma0, point, part[0]))
    names = ground.block.points.id
    if not fits:
        return f"{reason}: points it shares contradict each other: {shown(names[shared])}"
    _, point, best = min(fits, key=lambda fit: fit[:2])
    text = f"oriented by the {len(shared) - 1} points it shares with others that fit each other, without {names[point]}"
    return best, f"{text}: two objects may carry the number"


def together(
    ground: GroundObserved,
    components: Sequence[ImageComponent],
    names: Sequence[str],
    rays: ImagePointRows,
    neighbours: Sequence[ImageComponent],
    settings: OrientationSettings,
) -> dict[int, OnGround]:
    """Components that only together are determined, by number; each at last by what it shares with the others.

    Parameters
    ----------
    neighbours : sequence of ImageComponent
        Those that are on the ground already.
    """

    def oriented(k: int, begun: Mapping[int, Similarity]) -> OnGround | None:
        others = [*neighbours, *(components[other].moved(to) for other, to in begun.items())]
        part = by_neighbours(ground, components[k], rays, others, names[k], settings)
        return None if isinstance(part, str) else part[0]

    bodies, placed = ([body_of(c, rays) for c in cs] for cs in (components, neighbours))
    return oriented_together(ground, placed, bodies, oriented)


def placed_by_attitudes(
    ground: GroundObserved, rays: ImagePointRows, done: Sequence[OnGround], failures: Sequence[AatriError]
) -> tuple[list[OnGround], list[Note]]:
    """Images with observed attitudes that all rays, control and positions together place, where components are open."""
    if not any(isinstance(failure, OpenDatumError) for failure in failures):
        return [], []
    body = images_by_attitudes(ground, rays, [body_of(part.component, rays) for part in done])
    if isinstance(body, str):
        return [], [Note("warning", body)] if body else []
    component = component_of(body, rays)
    placed = several(int(component.images.sum()), "image", "is", "are")
    reasons = "; ".join(failure.what for failure in failures)
    note = Note("note", f"{placed} placed by attitudes, rays, control and positions together; without them {reasons}")
    return [OnGround(component, None, IDENTITY)], [note]
