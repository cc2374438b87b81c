"""Models as bodies of the block adjustment with independent models, and what is given of their ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from aatri.adapters.strips import strips as pieces
from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.errors import GeometryError
from aatri.geometry.vectors import tangents
from aatri.notes import Note
from aatri.observations.control import control_of
from aatri.observations.positions import positions_of
from aatri.orientation.free_block.datum_analysis import analyse_datum
from aatri.orientation.free_block.model_ties import LATENT, ModelPoses, ModelRows
from aatri.orientation.free_block.similarity_ties import Similarities
from aatri.orientation.free_block.tie_records import EXACT, GivenPoints
from aatri.orientation.strips.model_errors import point_errors, root_of

FEWEST = 3
"""Points, perspective centres among them, that a body of seven parameters must share."""

WEAKEST = 1e-4
"""A motion in which errors of what is given are magnified a hundred times counts as open; see `datum_analysis`."""


@dataclass(frozen=True)
class GivenRows:
    """Control points, or projection centres with an observed position: rows of the Block, and their coordinates."""

    row: Int
    image: Text
    point: Text
    points: GivenPoints

    def take(self, some: Int | Bool) -> GivenRows:
        """The chosen rows."""
        p = self.points
        return GivenRows(
            self.row[some], self.image[some], self.point[some],
            GivenPoints(p.kind, p.point[some], p.xyz_m[some], p.covariance_m2[some], p.given[some]),
        )  # fmt: skip


@dataclass(frozen=True)
class Bodies:
    """Oriented models with their rows; `model` are rows in the orientations of Models.

    The first `n_model_points` rows are points, the others perspective centres; these have the numbers of their images
    after those of the ground points. `given` is reduced to `origin`.
    """

    model: Int
    rows: ModelRows
    n_model_points: int
    start: ModelPoses
    origin: Float
    given: tuple[GivenRows, ...]


def bodies_of(
    block: Block, models: Models, initial: Solution, centre_sigma_m: float | None
) -> tuple[Bodies, list[Note]]:
    """The models that `initial` orients, without those that hang on too little, and what is left out.

    Parameters
    ----------
    centre_sigma_m : float or None
        Standard deviation of the perspective centres; None: from the relative orientations.

    Raises
    ------
    GeometryError
        If `initial` orients no model, or nothing brings any to the ground.
    """
    o, images = models.orientations, initial.images
    oriented = np.flatnonzero(images.oriented[o.left] & images.oriented[o.right])
    if not len(oriented):
        raise GeometryError("`initial` orients no model", remedy="check `from`: initial wants the absolute orientation")
    origin, given, notes = _given(block, initial)
    chosen = oriented
    while True:
        bodies = _bodies(block, models, initial, chosen, centre_sigma_m, origin, given)
        loose = _loose(bodies)
        if not loose.any():
            break
        chosen = chosen[~loose]
        if not len(chosen):
            raise GeometryError(
                f"no model shares {FEWEST} points with another", remedy="measure common points of neighbouring models"
            )
    left = np.setdiff1d(oriented, chosen)
    if len(left):
        text = f"models that share fewer than {FEWEST} points with others, perspective centres counted, are left out"
        notes.append(Note("warning", text, tuple(o.id[left].tolist())))
    label, n = _components(bodies, len(block.points) + len(block.images))
    why = [_open(bodies, np.flatnonzero(label == k), o.id[chosen]) for k in range(n)]
    lost = np.isin(label, [k for k, text in enumerate(why) if text])
    texts = [text for text in why if text]
    if lost.all():
        raise GeometryError("; ".join(texts), remedy="more control, or observed positions of the images")
    if lost.any():
        notes += [Note("warning", f"left out: {text}") for text in texts]
        bodies = _bodies(block, models, initial, chosen[~lost], centre_sigma_m, origin, given)
    return bodies, notes


def _given(block: Block, initial: Solution) -> tuple[Float, list[GivenRows], list[Note]]:
    """Control, and positions reduced to the projection centres by the initial attitudes.

    Positions whose group has a shift of its own take no part: that is for the bundle.
    """
    control, positions = control_of(block), positions_of(block)
    origin = pieces.origin_of(control, positions)
    drifting = block.exterior.drift_group[positions.row] != ""
    arm = initial.images.ground_from_image[positions.image] @ positions.lever_arm_m[:, :, None]
    use = ~drifting & initial.images.oriented[positions.image]
    notes = []
    if drifting.any():
        text = "positions of drift groups take no part here"
        notes.append(Note("note", text, tuple(block.images.id[positions.image[drifting]].tolist())))
    ids = block.points.id[control.point]
    of_control = GivenPoints("control", control.point, control.xyz_m - origin, control.covariance_m2, control.given)
    given = [GivenRows(control.row, np.full(len(ids), ""), ids, of_control)]
    if use.any():
        p = positions.take(use)
        both = p.given[:, :, None] & p.given[:, None, :]
        xyz_m = np.where(p.given, p.position_m - arm[use, :, 0] - origin, 0.0)
        number = len(block.points) + p.image.astype(np.int64)
        centre = GivenPoints("position", number, xyz_m, np.where(both, p.covariance_m2, 0.0), p.given)
        given.append(GivenRows(p.row, block.images.id[p.image], np.full(len(p.row), ""), centre))
    return origin, given, notes


def _bodies(
    block: Block, models: Models, initial: Solution, chosen: Int, centre_sigma_m: float | None, origin: Float,
    given: list[GivenRows],
) -> Bodies:  # fmt: skip
    o, p, images = models.orientations, models.model_points, initial.images
    left, right = o.left[chosen], o.right[chosen]
    scale = np.linalg.norm(images.position_m[right] - images.position_m[left], axis=1)
    similarity = Similarities(images.position_m[left] - origin, scale, images.ground_from_image[left].copy())
    start = ModelPoses(similarity, np.zeros((len(chosen), LATENT)))
    place = np.full(len(o), -1)
    place[chosen] = np.arange(len(chosen))
    rows = np.flatnonzero(p.active & (place[p.model] >= 0))
    model, m = place[p.model[rows]], len(chosen)
    root = root_of(o.covariance[chosen])
    of_points = np.zeros((len(rows), 3, 5))
    centres = np.concatenate([np.zeros((m, 3)), o.base[chosen]])
    of_centres = np.zeros((2 * m, 3, 5))
    if centre_sigma_m is None:
        of_points = point_errors(p.xyz[rows], o.base[chosen][model], root[model])
        T = np.array([tangents(b) for b in o.base[chosen]])
        of_centres[m:] = T @ root[:, 3:]
        typical = float(np.median(np.einsum("nii->n", p.covariance[rows]))) / 3 if len(rows) else 1.0
        variance = np.full(2 * m, EXACT**2 * typical)
    else:
        variance = np.tile((centre_sigma_m / scale) ** 2, 2)
    every = ModelRows(
        np.concatenate([model, np.tile(np.arange(m), 2)]),
        np.concatenate([p.point[rows].astype(np.int64), len(block.points) + np.concatenate([left, right])]),
        np.concatenate([p.xyz[rows], centres]),
        np.concatenate([p.covariance[rows], variance[:, None, None] * np.eye(3)]),
        np.concatenate([of_points, of_centres]),
    )
    present = [g.take(np.isin(g.points.point, every.point)) if g.points.kind != "control" else g for g in given]
    return Bodies(chosen, every, len(rows), start, origin, tuple(present))


def _loose(bodies: Bodies) -> Bool:
    """Models that share too few points, perspective centres among them, with others or with what is given."""
    r = bodies.rows
    known = np.isin(r.point, np.concatenate([g.points.point for g in bodies.given]))
    shared = known | (np.bincount(r.point)[r.point] > 1)
    return np.asarray(np.bincount(r.model[shared], minlength=len(bodies.model)) < FEWEST)


def _components(bodies: Bodies, n_points: int) -> tuple[Int, int]:
    """Which models hang together by common points: label of each, and how many there are."""
    m, r = len(bodies.model), bodies.rows
    graph = coo_array((np.ones(len(r.model)), (r.model, m + r.point)), shape=(m + n_points,) * 2)
    label = connected_components(graph, directed=False)[1][:m]
    labels, label = np.unique(label, return_inverse=True)
    return np.asarray(label), len(labels)


def _open(bodies: Bodies, models: Int, names: Text) -> str:
    """What control and positions leave open of some models that hang together; empty where they determine all."""
    r, s = bodies.rows, bodies.start.similarity
    mine = np.flatnonzero(np.isin(r.model, models))
    k = r.model[mine]
    xyz = s.translation[k] + s.scale[k][:, None] * np.einsum("nij,nj->ni", s.rotation[k], r.x[mine])
    point, first = np.unique(r.point[mine], return_index=True)
    ids, at, given = list[str](), list[Float](), list[Bool]()
    for g in bodies.given:
        there = np.flatnonzero(np.isin(g.points.point, point) & g.points.given.any(axis=1))
        ids += [f"image {i}" if i else f"point {p}" for i, p in zip(g.image[there], g.point[there])]
        at.append(xyz[first[np.searchsorted(point, g.points.point[there])]])
        given.append(g.points.given[there])
    of = f"{len(models)} models, {names[models[0]]} to {names[models[-1]]}"
    if not ids:
        return f"{of}: they hold no control point and no observed position"
    found = analyse_datum(np.concatenate(at), np.concatenate(given), ids, xyz[first], weakest=WEAKEST)
    if not (found.open or found.defect):
        return ""
    return f"{of}: not determined: {', '.join(found.open) or f'{found.defect} of the seven parameters'}"
