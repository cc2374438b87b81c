"""A free component of strips as a body, and its orientation on the ground."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjusting.tied_adjustment import TiedResult
from aatri.adjusting.tied_problem import named_by_suspects, not_rejected
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.similarity import Similarity, transform
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.observations.control import control_of
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.image_points import rays_of
from aatri.observations.observed import Observed
from aatri.observations.poses import Poses
from aatri.observations.positions import KIND as POSITION
from aatri.observations.ties import STRIP_TIE
from aatri.orientation.bodies.absolute import OrientationSettings, OrientedBody
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.components import Component, FreeBlock
from aatri.orientation.bodies.control_by_rays import ControlByRays, control_by_rays
from aatri.orientation.bodies.datum_analysis import OpenDatumError
from aatri.orientation.bodies.deformation import distance_m, expected_ratio, search_notes
from aatri.orientation.bodies.free_body import FreeBody
from aatri.orientation.bodies.ground_observed import BEGUN_LEVEL, GroundObserved, oriented_by, with_level_images
from aatri.orientation.bodies.limits import EXTRAPOLATION_WARNED, HARDLY_DETERMINED, TIE_LIMIT
from aatri.orientation.bodies.neighbouring_bodies import beside_neighbours, oriented_together
from aatri.orientation.bodies.one_left_out import oriented_by_the_others

if TYPE_CHECKING:
    from aatri.artifacts.block import Block
    from aatri.artifacts.image_points import ImagePoints
    from aatri.artifacts.strips import Strips


MOST_NAMED = 3
"""Components, and strips that are not joined, that an error names."""

Failed = tuple[Component, str, GeometryError | ConvergenceError]
"""A component, what messages call it, and why it is not oriented."""


@dataclass(frozen=True)
class StripsOfBlock:
    """Free strips, the block in the frame of the adjustment, what is observed of the ground, and the image points."""

    block: Block
    ground: GroundObserved
    strips: Strips
    image_points: ImagePoints
    last_kind: str = ""
    """Kind of observations that do not take part at first, and come back where they fit the others."""

    @cached_property
    def rays(self) -> ImagePointRows:
        """Of all image points, which control that no strip holds is looked for among."""
        return rays_of(self.block, self.image_points)

    def control_beside(self, component: Component) -> Int:
        """Control points that the strips of a component do not hold, (n,): rows in points."""
        return np.setdiff1d(control_of(self.ground.block).point, component.point)


@dataclass(frozen=True)
class OrientedPart:
    """A component on the ground."""

    what: str
    by_rays: ControlByRays
    result: OrientedBody

    @property
    def on_ground(self) -> FreeBody:
        """It as a body on the ground."""
        return self.by_rays.body.moved(self.result.ground_from_body)

    @property
    def component(self) -> Component:
        """The component itself."""
        return self.by_rays.component

    def adjusted(self) -> list[tuple[str, TiedResult]]:
        """Its adjustments: to the ground, and of its strips to each other if they are several."""
        results: list[tuple[str, TiedResult]] = [(f"{self.what} to the ground", self.result.tied)]
        if self.component.tied is not None:
            results.append((f"{self.what}, strips to each other", self.component.tied))
        return results


def pooled(parts: Sequence[OrientedPart]) -> tuple[tuple[int, int], float]:
    """Observations and unknowns, and sigma0: the ratio to the a priori standard deviations, of all components."""
    observations, unknowns, squares = 0, 0, 0.0
    for part in parts:
        for _, tied in part.adjusted():
            squares += tied.sigma0**2 * tied.redundancy if tied.redundancy > 0 else 0.0
            observations, unknowns = observations + tied.counts[0], unknowns + tied.counts[1]
    redundancy = observations - unknowns
    return (observations, unknowns), float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan")


def oriented_part(
    block_strips: StripsOfBlock, component: Component, what: str, settings: OrientationSettings
) -> tuple[OrientedPart, list[Note]]:
    """A component by what is observed of it, control that no strip holds included; see `oriented_by`.

    Raises
    ------
    GeometryError
        If something is not determined.
    """

    def begin(observed: Sequence[Observed]) -> Bool:
        use = not_rejected(observed, {o.kind: strips.suspects for o in observed})
        is_last = np.array([o.kind == block_strips.last_kind for o in observed], dtype=bool)
        use[np.repeat(is_last, [len(o) for o in observed])] = False
        return use

    ground, strips, by_rays = block_strips.ground, block_strips.strips, _with_control(block_strips, component)
    try:
        result, notes = oriented_by(ground, by_rays.body, settings, what, begin=begin)
    except (ConvergenceError, GeometryError) as failure:
        result, notes = oriented_by_the_others(ground, by_rays.body, settings, what, failure, begin)
    return OrientedPart(what, by_rays, result), notes


def _with_control(block_strips: StripsOfBlock, component: Component) -> ControlByRays:
    """A component as a body, with the control that no strip of it holds."""
    body = _body(block_strips.ground.block, block_strips.strips, component)
    lacking = block_strips.control_beside(component)
    if len(lacking):
        return control_by_rays(component, body, lacking, block_strips.rays, TIE_LIMIT)
    return ControlByRays(component, body, lacking, lacking, np.zeros(0))


def parts_together(
    block_strips: StripsOfBlock,
    parts: Sequence[OrientedPart],
    failed: Sequence[Failed],
    settings: OrientationSettings,
    others: Sequence[FreeBody] = (),
) -> dict[int, tuple[OrientedPart, list[Note]]]:
    """Components that what they share and control determine, together or beside parts that are oriented, by number.

    Parameters
    ----------
    others : sequence of FreeBody
        What else is oriented.
    """
    on_ground = [*others, *(part.on_ground for part in parts)]
    bodies = [_with_control(block_strips, component).body for component, _, _ in failed]

    def oriented(k: int, begun: Mapping[int, Similarity]) -> tuple[OrientedPart, list[Note]] | None:
        others = [bodies[other].moved(to) for other, to in begun.items()]
        ground, (component, what, failure) = block_strips.ground, failed[k]
        text = "oriented by what it shares with others that are oriented, and what is observed of it"
        if beside_neighbours(ground, others, bodies[k]).beside:
            text = "oriented together with others, by what they share and what is observed of each"
        beside = replace(block_strips, ground=beside_neighbours(ground, [*on_ground, *others], bodies[k]))
        try:
            part, notes = oriented_part(beside, component, what, replace(settings, weakest=HARDLY_DETERMINED))
        except (ConvergenceError, GeometryError):
            return None
        return part, [Note("note", f"{what}: {text}; without them {failure.what}"), *notes]

    return oriented_together(block_strips.ground, on_ground, bodies, oriented)


def part_notes(part: OrientedPart) -> list[Note]:
    """What there is to say of a component on the ground."""
    factor, tied = part.result.analysis.extrapolation, part.result.tied
    kinds = Counter(o.kind for o in tied.problem.ground for _ in range(len(o)))
    counts = [f"{kinds.pop(kind, 0)} {name}" for kind, name in ((CONTROL, "control points"), (POSITION, "positions"))]
    counts += [f"{n} of kind {kind}" for kind, n in kinds.items()]
    notes = [
        Note(
            "note",
            f"{part.what}: {', '.join(counts)}, errors of control "
            f"magnified up to {factor:.2g} times; it fits the ground to {tied.tau_m:.3f} m beyond the "
            "standard deviations of its points",
        )
    ]
    if factor > EXTRAPOLATION_WARNED:
        text = f"{part.what}: control is in one part of it; its errors are magnified up to {factor:.1f} times"
        notes.append(Note("warning", text))
    for what, adjusted in part.adjusted():
        notes += search_notes(adjusted, what)
    return notes


def begun_part(
    block_strips: StripsOfBlock,
    free: FreeBlock,
    component: Component,
    failure: GeometryError | ConvergenceError,
    what: str,
    settings: OrientationSettings,
) -> tuple[OrientedPart, list[Note]] | None:
    """A component that is not determined, as a bundle may begin; None if that is not known either.

    Nothing but its turn about a line is open of it, its images look down, and points that it shares with others, too
    few to join it, or rays of single images to control hold it: the bundle takes them up. Or all that is observed of
    it together hardly determines it.
    """
    ground, rays = block_strips.ground, block_strips.rays
    image = free_images(block_strips.strips, component)[2]

    def shown(c: Component) -> Int:
        of_images = rays.active & np.isin(rays.image, free_images(block_strips.strips, c)[2])
        return np.append(rays.point[of_images], c.point)

    others = [shown(c) for c in free.components if c is not component]
    control = block_strips.control_beside(component)
    level = replace(block_strips, ground=with_level_images(ground, image))
    if np.isin(shown(component), np.concatenate([control, *others])).any():
        with contextlib.suppress(ConvergenceError, GeometryError):
            text = f"{failure.what}; {BEGUN_LEVEL}"
            return oriented_part(level, component, what, settings)[0], [Note("warning", text)]
    if not isinstance(failure, OpenDatumError):  # something is rejected, which a weak datum would not contradict
        return None
    with contextlib.suppress(ConvergenceError, GeometryError):
        part, notes = oriented_part(block_strips, component, what, replace(settings, weakest=HARDLY_DETERMINED))
        return part, [*notes, Note("warning", f"hardly determined, errors are magnified: {failure.what}")]
    return None


def _body(block: Block, strips: Strips, component: Component) -> FreeBody:
    """A component of strips; a projection centre is about as uncertain as a typical point of it.

    It is turned within itself by its deformation: a strip of n models is off by `expected_ratio` times the standard
    deviation of a point, over its distance.
    """
    centres, rotations, image = free_images(strips, component)
    n, m = len(block.images), len(block.points)
    poses = Poses(np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan))
    poses.position_m[image], poses.ground_from_image[image] = centres, rotations
    xyz, covariance = np.full((m, 3), np.nan), np.full((m, 3, 3), np.nan)
    xyz[component.point], covariance[component.point] = component.xyz, component.covariance
    typical = float(np.median(np.einsum("nii->n", component.covariance))) / 3
    table = strips.strip_images
    models = int(np.bincount(table.strip[np.isin(table.strip, component.strips)]).max(initial=1))
    turned = expected_ratio(models) * np.sqrt(typical) / distance_m(centres, component.xyz)
    return FreeBody(poses, xyz, covariance, np.tile(typical * np.eye(3), (n, 1, 1)), float(turned))


def strip_points_of(strips: Strips) -> BodyPoints:
    """Points of free strips."""
    table = strips.strip_points
    return BodyPoints(table.strip.astype(np.int64), table.point.astype(np.int64), table.xyz, table.covariance)


def usable_ties(strips: Strips) -> Bool:
    """Strip points that no earlier stage has rejected, (n,) bool."""
    table = strips.strip_points
    if not len(strips.suspects):
        return np.ones(len(table), dtype=bool)
    return ~named_by_suspects(strips.suspects, STRIP_TIE, strips.strips.id[table.strip], strips.points.id[table.point])


def free_images(strips: Strips, component: Component) -> tuple[Float, Float, Int]:
    """Projection centres and rotations of a component's images, in its frame; rows in images."""
    table = strips.strip_images
    rows = np.flatnonzero(np.isin(table.strip, component.strips))
    centres, rotations = np.empty((len(rows), 3)), np.empty((len(rows), 3, 3))
    for strip, pose in zip(component.strips, component.component_from_strip):
        of_strip = table.strip[rows] == strip
        centres[of_strip] = transform(pose, table.position[rows[of_strip]])
        rotations[of_strip] = pose.rotation @ table.strip_from_image[rows[of_strip]]
    return centres, rotations, table.image[rows].astype(np.int64)


def error_of_all(failed: Sequence[Failed], free: FreeBlock) -> GeometryError | ConvergenceError:
    """What is raised where components are not oriented: the first of them by name, and what would help."""
    errors = [error for _, _, error in failed]
    open_components = [error.what for error in errors]
    unjoined = [f"not joined: {text}" for text in free.unjoined]
    texts = [*open_components[:MOST_NAMED], *unjoined[:MOST_NAMED]]
    left = len(open_components) + len(unjoined) - len(texts)
    texts += [f"and {left} more"] if left else []
    remedies = [errors[0].remedy]
    if len(free.components) > 1:
        remedies.append("or measure at least 3 points common to the strips, not on a line")
        remedies.append("or orient image by image, by initial_orientation/graph in place of the stages from models on")
    if len(failed) < len(free.components):
        remedies.append("or set `components: largest` to orient the rest")
    kind = ConvergenceError if all(isinstance(error, ConvergenceError) for error in errors) else GeometryError
    return kind("; ".join(texts), remedy="; ".join(remedies))
