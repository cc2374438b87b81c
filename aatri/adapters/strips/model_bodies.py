"""Models as bodies of the block adjustment with independent models, and what is given of their ground."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from aatri.adjusting.added_variance import EXACT
from aatri.adjusting.tied_problem import TiedProblem, tied_problem
from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.errors import GeometryError
from aatri.geometry.similarity import IDENTITY, Similarity
from aatri.geometry.vectors import tangents
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.control import control_of, observed_control, origin_of
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.poses import POINT, POSE, Poses
from aatri.observations.positions import PositionOptions, positions, positions_of
from aatri.observations.ties import MODEL_TIE, PERSPECTIVE_CENTRE
from aatri.orientation.bodies.datum_analysis import analyse_datum
from aatri.orientation.bodies.limits import FEWEST_COMMON_OF_MODELS, HARDLY_DETERMINED
from aatri.orientation.bodies.model_ties import (
    LATENT,
    ModelPoses,
    ModelRows,
    Unit,
    double_units,
    latent_errors,
    merged,
    model_ties,
)
from aatri.orientation.bodies.similarity_ties import Similarities
from aatri.orientation.strips.model_errors import point_errors, root_of


@dataclass(frozen=True)
class ModelsAsBodies:
    """Oriented models as bodies; coordinates on the ground are reduced to `origin`."""

    model: Int
    """(n,). Rows in the orientations of Models, of a double model the first."""
    names: Text
    points: ModelRows
    centres: ModelRows
    """Model points, and perspective centres."""
    start: ModelPoses
    """Of the models."""
    poses: Poses
    """Of all images of the block."""
    origin: Float
    """(3,), m."""
    ground: tuple[Observed, ...]
    """Control and observed positions."""
    latent: bool
    """Errors that the points of a model have in common are unknowns of it (`latent_errors`)."""

    def problem(self, block: Block) -> TiedProblem:
        """Points and perspective centres of the models as observations, with what is observed of the ground."""
        points = model_ties(self.points, names=self.names, latent=self.latent)
        centres = model_ties(self.centres, names=self.names, latent=self.latent, group=POSE)
        ids = {POINT: block.points.id, POSE: block.images.id}
        observed = [
            ties.observed(kind, self.names[ties.body], ids[ties.group][ties.block], self.start)
            for kind, ties in ((MODEL_TIE, points), (PERSPECTIVE_CENTRE, centres))
        ]
        priors = [latent_errors(self.names)] if self.latent else []
        start = {POINT: points.places(self.start, len(block.points)), POSE: self.poses}
        return tied_problem([*observed, *self.ground, *priors], start, ids, "independent models")

    def shared(self, block: Block) -> tuple[Int, Int]:
        """Model and object, ground points before images, of all rows."""
        return (
            np.concatenate([self.points.model, self.centres.model]),
            np.concatenate([self.points.block, len(block.points) + self.centres.block]),
        )

    def of_ground(self, block: Block) -> Iterator[tuple[Observed, Int]]:
        """What is observed of the ground, and of which objects."""
        for o in self.ground:
            ((group, touched),) = o.records.touches
            yield o, touched + (len(block.points) if group == POSE else 0)


def bodies_of(
    block: Block, models: Models, initial: Solution, centre_sigma_m: float | None, *, double: bool = False
) -> tuple[ModelsAsBodies, list[Note]]:
    """The models that `initial` orients, without those that hang on too little, and what is left out.

    Parameters
    ----------
    centre_sigma_m : float or None
        Standard deviation of the perspective centres; None: from the relative orientations.
    double : bool
        Two neighbouring models are one body; they are rigid.

    Raises
    ------
    GeometryError
        If `initial` orients no model, or nothing brings any to the ground.
    """
    o, images = models.orientations, initial.images
    oriented = np.flatnonzero(images.oriented[o.left] & images.oriented[o.right])
    if not len(oriented):
        raise GeometryError("`initial` orients no model", remedy="check `from`: initial wants the absolute orientation")
    origin, poses, ground, notes = _ground(block, initial)
    units = double_units(models, oriented) if double else {(k,): IDENTITY for k in oriented.tolist()}
    names, chosen = np.array(["+".join(o.id[list(unit)].tolist()) for unit in units]), np.arange(len(units))

    def made(chosen: Int) -> ModelsAsBodies:
        units_chosen = [list(units)[k] for k in chosen.tolist()]
        single = _bodies(
            models, np.array([k for unit in units_chosen for k in unit]), centre_sigma_m, origin, poses, ground
        )
        return _of_units(single, {unit: units[unit] for unit in units_chosen}, names[chosen]) if double else single

    while True:
        bodies = made(chosen)
        model, body = bodies.shared(block)  # perspective centres count as shared, too
        on_ground = np.isin(body, np.concatenate([objects for _, objects in bodies.of_ground(block)]))
        shared = on_ground | (np.bincount(body)[body] > 1)
        loose = np.asarray(np.bincount(model[shared], minlength=len(bodies.model)) < FEWEST_COMMON_OF_MODELS)
        if not loose.any():
            break
        chosen = chosen[~loose]
        if not len(chosen):
            raise GeometryError(
                f"no model shares {FEWEST_COMMON_OF_MODELS} points with another",
                remedy="measure common points of neighbouring models",
            )
    left = np.setdiff1d(np.arange(len(units)), chosen)
    if len(left):
        text = (
            f"models that share fewer than {FEWEST_COMMON_OF_MODELS} points with others, perspective centres counted, "
            "are left out"
        )
        notes.append(Note("warning", text, tuple(names[left].tolist())))
    label, n = _components(bodies, block)
    reasons = [_open(bodies, block, np.flatnonzero(label == k)) for k in range(n)]
    lost = np.isin(label, [k for k, text in enumerate(reasons) if text])
    texts = [text for text in reasons if text]
    if lost.all():
        raise GeometryError("; ".join(texts), remedy="more control, or observed positions of the images")
    if lost.any():
        notes += [Note("warning", f"left out: {text}") for text in texts]
        bodies = made(chosen[~lost])
    return bodies, notes


def _ground(block: Block, initial: Solution) -> tuple[Float, Poses, list[Observed], list[Note]]:
    """Origin, poses of the images, control and positions of those that are oriented.

    Positions whose group has a shift of its own take no part: that is for the bundle.
    """
    control, images = control_of(block), initial.images
    origin = origin_of(control, positions_of(block).position_m)
    poses = Poses(images.position_m - origin, images.ground_from_image)
    observed = positions(ObservationSource(block, None, origin, {POSE: poses}), PositionOptions())
    observed = tuple(o for o in observed if not o.unknowns and len(o.records.touches) == 1)
    ground = [*observed_control(control, origin, block.points.id[control.point])]
    ground += [o.take(np.flatnonzero(images.oriented[o.records.touches[0][1]])) for o in observed]
    drifting = positions_of(block).image[block.exterior.drift_group[positions_of(block).row] != ""]
    notes = []
    if len(drifting):
        text = "positions of drift groups take no part here"
        notes.append(Note("note", text, tuple(block.images.id[drifting].tolist())))
    return origin, poses, ground, notes


def _bodies(
    models: Models, chosen: Int, centre_sigma_m: float | None, origin: Float, poses: Poses, ground: Sequence[Observed]
) -> ModelsAsBodies:
    o, p = models.orientations, models.model_points
    left, right, m = o.left[chosen], o.right[chosen], len(chosen)
    scale = np.linalg.norm(poses.position_m[right] - poses.position_m[left], axis=1)
    similarity = Similarities(poses.position_m[left], scale, poses.ground_from_image[left].copy())
    place = np.full(len(o), -1)
    place[chosen] = np.arange(m)
    rows = np.flatnonzero(p.active & (place[p.model] >= 0))
    model = place[p.model[rows]]
    root = root_of(o.covariance[chosen])
    of_points, of_centres = np.zeros((len(rows), 3, 5)), np.zeros((2 * m, 3, 5))
    if centre_sigma_m is None:
        of_points = point_errors(p.xyz[rows], o.base[chosen][model], root[model])
        T = np.array([tangents(b) for b in o.base[chosen]])
        of_centres[m:] = T @ root[:, 3:]
        typical = float(np.median(np.einsum("nii->n", p.covariance[rows]))) / 3 if len(rows) else 1.0
        variance = np.full(2 * m, EXACT**2 * typical)
    else:
        variance = np.tile((centre_sigma_m / scale) ** 2, 2)
    centres = ModelRows(
        np.tile(np.arange(m), 2),
        np.concatenate([left, right]).astype(np.int64),
        np.concatenate([np.zeros((m, 3)), o.base[chosen]]),
        variance[:, None, None] * np.eye(3),
        of_centres,
    )
    points = ModelRows(model, p.point[rows].astype(np.int64), p.xyz[rows], p.covariance[rows], of_points)
    start, seen = ModelPoses(similarity, np.zeros((m, LATENT))), list[Observed]()
    for g in ground:
        ((group, touched),) = g.records.touches
        seen.append(g if group == POINT else g.take(np.flatnonzero(np.isin(touched, centres.block))))
    return ModelsAsBodies(
        chosen, o.id[chosen], points, centres, start, poses, origin, tuple(seen), centre_sigma_m is None
    )


def _of_units(single: ModelsAsBodies, units: dict[Unit, Similarity], names: Text) -> ModelsAsBodies:
    """Bodies of units of one or two models, from those of single models in their order."""
    unit = np.repeat(np.arange(len(units)), [len(models) for models in units])
    first = np.flatnonzero(np.diff(unit, prepend=-1))
    to = [laid if k else IDENTITY for models, laid in units.items() for k in range(len(models))]
    s = single.start.similarity
    return replace(
        single,
        model=single.model[first],
        names=names,
        points=merged(single.points, unit, to),
        centres=merged(single.centres, unit, to),
        start=ModelPoses(
            Similarities(s.translation[first], s.scale[first], s.rotation[first]), np.zeros((len(first), LATENT))
        ),
    )


def _components(bodies: ModelsAsBodies, block: Block) -> tuple[Int, int]:
    """Which models hang together by common points: label of each, and how many there are."""
    m, n = len(bodies.model), len(block.points) + len(block.images)
    model, body = bodies.shared(block)
    graph = coo_array((np.ones(len(model)), (model, m + body)), shape=(m + n,) * 2)
    label = connected_components(graph, directed=False)[1][:m]
    labels, label = np.unique(label, return_inverse=True)
    return np.asarray(label), len(labels)


def _open(bodies: ModelsAsBodies, block: Block, models: Int) -> str:
    """What control and positions leave open of some models that hang together; empty where they determine all."""
    s, names = bodies.start.similarity, bodies.names
    k, body = bodies.shared(block)
    of_these = np.isin(k, models)
    x = np.concatenate([bodies.points.x, bodies.centres.x])[of_these]
    k, body = k[of_these], body[of_these]
    xyz = s.translation[k] + s.scale[k][:, None] * np.einsum("nij,nj->ni", s.rotation[k], x)
    there, first = np.unique(body, return_index=True)
    place = np.full((len(block.points) + len(block.images), 3), np.nan)
    place[there] = xyz[first]
    observed = [o.take(np.flatnonzero(np.isin(objects, there))) for o, objects in bodies.of_ground(block)]
    of_models = f"{several(len(models), 'model')}, {names[models[0]]} to {names[models[-1]]}"
    if not any(map(len, observed)):
        return f"{of_models}: they hold no control point and no observed position"
    poses = Poses(place[len(block.points) :], bodies.poses.ground_from_image)
    datum = analyse_datum(
        observed, {POINT: place[: len(block.points)], POSE: poses}, xyz[first], weakest=HARDLY_DETERMINED
    )
    return f"{of_models}: not determined: {', '.join(datum.open)}" if datum.open else ""
