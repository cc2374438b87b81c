"""Models: relative orientations of pairs as tables, and Models as the graph of their pairs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adapters.cameras.image_parameters import film_parameters
from aatri.adapters.observation_tables import in_no_model, seen_by_one
from aatri.adapters.pairs.image_pairs import joining_pairs, pair_names
from aatri.adapters.solution import stacked, suspect_rows
from aatri.adjustment.statistics.global_test import largest_sigma0, pooled_test, refuse_misfit
from aatri.adjustment.statistics.limits import LEAST_CONTROLLED
from aatri.arrays import Float, Int, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Elements, ModelPoints, Models, Orientations, SecondOrientations, Turns, Unformed
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.graph.pair_graph import PairGraph, RotationPairs
from aatri.orientation.relative.connected_pairs import Connection
from aatri.orientation.relative.critical import angle_sigmas
from aatri.orientation.relative.elements import DEPENDENT, INDEPENDENT, dependent_elements, independent_elements
from aatri.orientation.relative.film import film_in_orientations
from aatri.orientation.relative.orientations import EssentialOrientations, ImagePairs, RelativeOrientations

SCALE = "scale"
"""Name of the element that tells the scale of a model in units of the model before."""


def models_of(block: Block, image_points: ImagePoints, pairs: ImagePairs, orientations: RelativeOrientations) -> Models:
    """Models of oriented pairs, and the pairs that make none with the reason."""
    formed, unformed = np.flatnonzero(orientations.formed), np.flatnonzero(~orientations.formed)
    model_of = np.full(len(pairs.left), -1, dtype=np.int32)
    model_of[formed] = np.arange(len(formed))
    model = np.repeat(model_of, np.diff(pairs.start))
    covariance, film = orientations.covariance, film_parameters(block, image_points)
    if film is not None and film.basis is not None:
        covariance = covariance + film_in_orientations(pairs, orientations, film.basis, film.covariance)
    points, parallax = _model_points(pairs, model, orientations)
    models = Models(
        images=image_points.images,
        points=image_points.points,
        orientations=Orientations(
            id=np.asarray(pair_names(block, pairs)[formed], dtype=np.str_),
            left=pairs.left[formed],
            right=pairs.right[formed],
            left_from_right=orientations.left_from_right[formed],
            base=orientations.base[formed],
            covariance=covariance[formed],
            sigma0=orientations.sigma0[formed],
            redundancy=orientations.redundancy[formed].astype(np.int32),
            iterations=orientations.iterations[formed].astype(np.int32),
        ),
        model_points=points,
        unformed=Unformed(
            left=pairs.left[unformed],
            right=pairs.right[unformed],
            common_points=np.diff(pairs.start)[unformed].astype(np.int32),
            reason=np.array([orientations.reasons[pair] for pair in unformed.tolist()], dtype=np.str_),
        ),
        suspects=stacked([image_points.suspects, _suspects(block, pairs, model, orientations)]),
    )
    in_model, m = model >= 0, image_points.measurements
    in_models = np.concatenate([pairs.left_row[in_model], pairs.right_row[in_model]])
    in_none = in_no_model(block, m.active & finite_rows(m.xy_mm) & block.images.active[m.image], in_models)
    return replace(models, uncontrolled=stacked([in_none, _uncontrolled(block, models, parallax)]))


def _uncontrolled(block: Block, models: Models, redundancy: Float) -> Uncontrolled:
    """Along the base the points of one model only; across it those whose y-parallax is not controlled."""
    p = models.model_points
    single = np.bincount(p.point[p.active], minlength=len(block.points))[p.point] == 1
    weak = redundancy < LEAST_CONTROLLED
    across = seen_by_one(block, models, np.flatnonzero(p.active & weak), redundancy[p.active & weak])
    return stacked([across, seen_by_one(block, models, np.flatnonzero(p.active & single))])


def _model_points(pairs: ImagePairs, model: Int, orientations: RelativeOrientations) -> tuple[ModelPoints, Float]:
    """Points that have an intersection, and the redundancy numbers of their y-parallaxes; the others are suspects."""
    rows = np.flatnonzero((model >= 0) & finite_rows(orientations.point_covariance))
    error = np.abs(orientations.error_mm[rows])
    # The estimated error of a parallax is the parallax over its redundancy number.
    with np.errstate(divide="ignore", invalid="ignore"):
        redundancy = np.where(error > 0, np.abs(orientations.parallax_mm[rows]) / error, 1.0)
    redundancy = np.where(np.isnan(orientations.test[rows]), 0.0, redundancy)
    points = ModelPoints(
        model=model[rows],
        point=pairs.point[rows],
        xyz=orientations.xyz[rows],
        covariance=orientations.point_covariance[rows],
        parallax_mm=orientations.parallax_mm[rows],
        active=orientations.active[rows],
    )
    return points, redundancy


def _suspects(block: Block, pairs: ImagePairs, model: Int, orientations: RelativeOrientations) -> Suspects:
    """Rejected points; the row is that of the right image's measurement, though the error may be in the left one."""
    rows = np.flatnonzero((model >= 0) & ~orientations.active)
    return suspect_rows(
        "relative_orientation",
        "image_point",
        row=pairs.right_row[rows],
        image=block.images.id[np.repeat(pairs.right, np.diff(pairs.start))[rows]],
        point=block.points.id[pairs.point[rows]],
        size=orientations.error_mm[rows],
        sigma=orientations.error_sigma_mm[rows],
        test=orientations.test[rows],
    )


def with_elements(models: Models, frame: str) -> Models:
    """The models with the elements of a method."""
    o = models.orientations
    elements_of = independent_elements if frame == "independent" else dependent_elements
    names = INDEPENDENT if frame == "independent" else DEPENDENT
    values, sigma = elements_of(o.left_from_right, o.base, o.covariance)
    return replace(
        models,
        elements=Elements(
            model=np.repeat(np.arange(len(o)), len(names)).astype(np.int32),
            name=np.tile(np.array(names, dtype=np.str_), len(o)),
            value=values.ravel(),
            sigma=sigma.ravel(),
        ),
    )


def with_connections(
    block: Block, models: Models, orientations: RelativeOrientations, connections: Sequence[Connection]
) -> Models:
    """The models with the scales of their connections among the elements, and the connection points rejected."""
    model_of = np.cumsum(orientations.formed) - 1
    assert models.elements is not None  # of with_elements
    e, each = models.elements, [c.orientation for c in connections]
    model = np.concatenate([e.model, [model_of[c.pair] for c in connections]]).astype(np.int32)
    order = np.argsort(model, kind="stable")
    table = Elements(
        model=model[order],
        name=np.concatenate([e.name, np.full(len(each), SCALE)])[order],
        value=np.concatenate([e.value, [one.scale for one in each]])[order],
        sigma=np.concatenate([e.sigma, [one.scale_sigma for one in each]])[order],
    )
    names = models.orientations.id
    rejected = [_rejected_connection_points(block, str(names[model_of[c.pair]]), c) for c in connections]
    return replace(models, elements=table, suspects=stacked([models.suspects, *rejected]))


def _rejected_connection_points(block: Block, model: str, connection: Connection) -> Suspects:
    """Connection points rejected, under the id of the second model."""
    one = connection.orientation
    rows = np.flatnonzero(~one.connects)
    return suspect_rows(
        "relative_orientation",
        "model_tie",
        image=np.full(len(rows), model),
        point=block.points.id[connection.point[rows]],
        size=one.size[rows],
        unit="log scale",
        sigma=one.size_sigma[rows],
        test=one.test[rows],
    )


def essential_models(
    block: Block, image_points: ImagePoints, pairs: ImagePairs, essential: EssentialOrientations
) -> Models:
    """Models of oriented pairs; second orientations of ambiguous ones; pairs without base."""
    formed = np.flatnonzero(essential.orientations.formed)
    also = np.flatnonzero(finite_rows(essential.second[formed]))
    turned = np.flatnonzero(finite_rows(essential.turned))
    return replace(
        models_of(block, image_points, pairs, essential.orientations),
        second_orientations=SecondOrientations(
            model=also.astype(np.int32),
            left_from_right=essential.second[formed[also]][:, :, :3],
            base=essential.second[formed[also]][:, :, 3],
        ),
        turns=Turns(
            left=pairs.left[turned],
            right=pairs.right[turned],
            left_from_right=essential.turned[turned],
            sigma_rad=essential.turned_sigma_rad[turned],
            points=essential.turned_points[turned].astype(np.int32),
        ),
    )


def turns_of(models: Models) -> RotationPairs:
    """Pairs of which the rotation is known and nothing else."""
    t = models.turns if models.turns is not None else Turns.empty()
    return RotationPairs(
        t.left.astype(np.int64), t.right.astype(np.int64), t.left_from_right, t.sigma_rad, t.points.astype(np.int64)
    )


def graph_of(models: Models, enough: int, least: int) -> PairGraph:
    """The graph of models with enough points that fit, and of those with fewer that join what these do not."""
    o, p = models.orientations, models.model_points
    order = np.lexsort((p.point, p.model))
    order = order[p.active[order]]
    count = np.bincount(p.model[order], minlength=len(o))
    kept = np.flatnonzero(joining_pairs(np.column_stack([o.left, o.right]), count, len(models.images), enough, least))
    rows = order[np.isin(p.model[order], kept)]
    base = o.base[p.model[rows]]
    left, right = p.xyz[rows], p.xyz[rows] - base
    depth = np.column_stack([np.linalg.norm(left, axis=1), np.linalg.norm(right, axis=1)])
    across = np.linalg.norm(np.cross(left, right), axis=1)
    variance = [
        np.linalg.eigvalsh(c)[:, -1] if len(kept) else np.zeros(0)
        for c in (o.covariance[kept, :3, :3], o.covariance[kept, 3:, 3:])
    ]
    second = np.full((len(o), 3, 3), np.nan)
    if models.second_orientations is not None:
        second[models.second_orientations.model] = models.second_orientations.left_from_right
    return PairGraph(
        len(models.images),
        o.left[kept].astype(np.int64),
        o.right[kept].astype(np.int64),
        o.left_from_right[kept],
        o.base[kept],
        np.sqrt(variance[0]),
        np.sqrt(variance[1]),
        np.concatenate([[0], np.cumsum(count[kept])]).astype(np.int64),
        p.point[rows].astype(np.int64),
        depth,
        np.arctan2(across, np.einsum("ni,ni->n", left, right)),
        second[kept],
    )


def refuse_misfits(orientations: RelativeOrientations, max_sigma0: float | None, rays: RayPairs) -> None:
    """Pairs whose sigma0 is beyond the limit make no model; where all together are, there is no result.

    Parameters
    ----------
    max_sigma0 : float, optional
        Default: by the standard deviations of `rays`, as stated.

    Raises
    ------
    ConvergenceError
        If the pooled sigma0 is beyond the limit.
    """
    formed = np.flatnonzero(orientations.formed)
    what = f"of {len(formed)} models together"
    if max_sigma0 is None:
        max_sigma0 = largest_sigma0(float(np.median(angle_sigmas(rays))) if len(rays.left) else 0.0)
    refuse_misfit(pooled_test(orientations.sigma0[formed], orientations.redundancy[formed]), max_sigma0, what)
    for pair in formed[np.nan_to_num(orientations.sigma0[formed]) > max_sigma0].tolist():
        orientations.formed[pair] = False
        orientations.reasons[pair] = f"sigma0 {orientations.sigma0[pair]:.1f}, beyond max_sigma0 = {max_sigma0:g}"
