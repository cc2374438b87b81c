"""Models connected along their strips: each with its scale in units of the model before as an unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adapters.pairs.image_pairs import Pairs, models_of
from aatri.adapters.pairs.pair_methods import PairRules, adjusted_pairs, refresh_points, with_elements
from aatri.adapters.pairs.pair_notes import notes_of_pairs
from aatri.adapters.solution import stacked
from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Elements, Models
from aatri.artifacts.suspects import Suspects
from aatri.notes import Note
from aatri.orientation.relative.classical_points import classical_points, connection_points
from aatri.orientation.relative.image_scale import limit_of
from aatri.orientation.relative.orientations import RelativeOrientations
from aatri.orientation.strips.connected import Before, Connected, connected_orientation
from aatri.progress import Reporter

SCALE = "scale"
"""Name of the element that tells the scale of a model in units of the model before."""


def connected_pairs(
    block: Block, image_points: ImagePoints, images: Int, rules: PairRules, reporter: Reporter
) -> tuple[Models, tuple[Note, ...]]:
    """Models of consecutive images, each after the first of a strip connected with the one before."""
    pairs, found, notes = adjusted_pairs(block, image_points, images, "dependent", rules, reporter)
    joints: dict[int, tuple[Connected, Int]] = {}
    loose = []
    pair_of = {(int(i), int(j)): k for k, (i, j) in enumerate(zip(pairs.left, pairs.right))}
    ends_at = {j: k for (_, j), k in pair_of.items()}
    for pair, left in enumerate(pairs.left.tolist()):
        before = ends_at.get(left)
        if before is None or not (found.formed[pair] and found.formed[before]):
            continue
        joint = _joined(pairs, found, before, pair, limit_of(pairs.rays, rules.snooping_limit))
        if joint is None:
            loose.append(pair)
        else:
            joints[pair] = joint
    if rules.coordinates == "coefficients":
        _by_the_rules(pairs, found, joints, ends_at)
    names = pairs.names(block)
    told = list(notes)
    if loose:
        text = "models without connection to the one before: fewer than three points of both fit, their scale is open"
        told.append(Note("warning", text, tuple(str(names[k]) for k in loose)))
    models = with_elements(models_of(block, image_points, pairs, found), "dependent")
    models = _with_scales(models, found, joints)
    suspects = [_suspects(block, str(names[k]), *joints[k]) for k in joints]
    models = replace(models, suspects=stacked([models.suspects, *suspects]))
    wrong = sum(int((~one.connects).sum()) for one, _ in joints.values())
    told.append(Note("note", f"{len(joints)} connections; {wrong} connection points are rejected there"))
    reporter.progress(len(pairs.left), len(pairs.left), "models")
    return models, (*told, *notes_of_pairs(block, image_points, pairs, found, models))


def _joined(
    pairs: Pairs, found: RelativeOrientations, before: int, pair: int, limit: float
) -> tuple[Connected, Int] | None:
    """The connection of a pair, put in the place of its orientation, and its connection points."""
    a, b = (slice(int(pairs.start[k]), int(pairs.start[k + 1])) for k in (before, pair))
    common, at_a, at_b = np.intersect1d(pairs.point[a], pairs.point[b], return_indices=True)
    good = found.active[a][at_a] & found.active[b][at_b] & np.isfinite(found.point_covariance[a][at_a]).all(axis=(1, 2))
    common, at_a, at_b = common[good], at_a[good], at_b[good]
    rays = pairs.rays.take(np.arange(b.start, b.stop))
    one = connected_orientation(
        rays, found.active[b], found.left_from_right[pair], found.base[pair],
        Before(found.left_from_right[before], found.base[before], found.covariance[before], at_b,
               found.xyz[a][at_a], found.point_covariance[a][at_a]),
        limit=limit,
    )  # fmt: skip
    if one is None:
        return None
    found.left_from_right[pair], found.base[pair] = one.left_from_right, one.base
    found.covariance[pair], found.sigma0[pair] = one.covariance, one.sigma0
    found.redundancy[pair], found.iterations[pair] = one.redundancy, found.iterations[pair] + one.iterations
    refresh_points(pairs, found, pair)
    return one, common


def _by_the_rules(
    pairs: Pairs, found: RelativeOrientations, joints: dict[int, tuple[Connected, Int]], ends_at: dict[int, int]
) -> None:
    """Model points by projection coefficients; connection points keep the height of the model before, pair by pair."""
    for pair in np.flatnonzero(found.formed).tolist():
        mine = np.arange(pairs.start[pair], pairs.start[pair + 1])
        R, base, rays = found.left_from_right[pair], found.base[pair], pairs.rays.take(mine)
        found.xyz[mine] = classical_points(R, base, rays)
        if pair not in joints:
            continue
        one, common = joints[pair]
        before = ends_at[int(pairs.left[pair])]
        used = common[one.connects]
        there = int(pairs.start[before]) + np.searchsorted(
            pairs.point[pairs.start[before] : pairs.start[before + 1]], used
        )
        seen = (found.xyz[there] - found.base[before]) @ found.left_from_right[before]
        here = np.searchsorted(pairs.point[mine], used)
        found.xyz[mine[here]] = connection_points(R, base, rays.take(here), seen[:, 2] / one.scale)


def _with_scales(models: Models, found: RelativeOrientations, joints: dict[int, tuple[Connected, Int]]) -> Models:
    """The elements of the models with the scales of those that are connected."""
    model_of = np.cumsum(found.formed) - 1
    assert models.elements is not None  # of with_elements
    e = models.elements
    model = np.concatenate([e.model, [model_of[k] for k in joints]]).astype(np.int32)
    order = np.argsort(model, kind="stable")
    table = Elements(
        model=model[order],
        name=np.concatenate([e.name, np.full(len(joints), SCALE)])[order],
        value=np.concatenate([e.value, [one.scale for one, _ in joints.values()]])[order],
        sigma=np.concatenate([e.sigma, [one.scale_sigma for one, _ in joints.values()]])[order],
    )
    return replace(models, elements=table)


def _suspects(block: Block, model: str, one: Connected, common: Int) -> Suspects:
    """Connection points rejected, under the id of the second model."""
    rows = np.flatnonzero(~one.connects)
    n = len(rows)
    return Suspects(
        kind=np.full(n, "model_tie"),
        row=np.full(n, -1, dtype=np.int32),
        image=np.full(n, model),
        point=block.points.id[common[rows]],
        stage=np.full(n, "relative_orientation"),
        size=one.size[rows],
        unit=np.full(n, "log scale"),
        sigma=one.size_sigma[rows],
        test=one.test[rows],
        verdict=np.full(n, "rejected"),
    )
