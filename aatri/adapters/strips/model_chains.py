"""Models of a block as chains of neighbours, and as the methods that join them want them."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from aatri.adapters.pairs.image_pairs import images_of_strip
from aatri.adapters.pairs.models import SCALE
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.errors import GeometryError
from aatri.orientation.strips.joints import JointTable, ModelTable


@dataclass(frozen=True)
class Gap:
    """A break in a strip of the Block; `left` or `right` is -1 where there is no image."""

    strip: int
    left: int
    right: int
    reason: str


@dataclass
class Chain:
    """Neighbouring models of a strip of the Block, with their joints."""

    strip: int
    """Row in the Block's strips."""
    images: list[int]
    """Rows in images, one more than models."""
    models: list[int] = field(default_factory=list)
    """Rows in the orientations of Models."""
    joints: list[int] = field(default_factory=list)
    """Rows in the table of joints."""


def names_of_joint(models: Models, joints: JointTable, joint: int) -> str:
    """The two models that are joined."""
    return f"{models.orientations.id[joints.first[joint]]} and {models.orientations.id[joints.second[joint]]}"


def model_table(models: Models) -> ModelTable:
    """Every model with its active points, as the methods want it."""
    o, p = models.orientations, models.model_points
    rows = active_rows(models)
    start = np.searchsorted(p.model[rows], np.arange(len(o) + 1))
    return ModelTable(
        o.left_from_right, o.base, o.covariance, start, p.point[rows].astype(np.int64), p.xyz[rows], p.covariance[rows]
    )


def active_rows(models: Models) -> Int:
    """Rows of the active model points, by model and point."""
    p = models.model_points
    rows = np.flatnonzero(p.active)
    place = p.model[rows].astype(np.int64) * (int(p.point.max(initial=0)) + 1) + p.point[rows]
    in_order = (place[1:] >= place[:-1]).all()  # as they mostly are: millions take long to be sorted
    return rows if in_order else rows[np.argsort(place, kind="stable")]


def carried_scales(models: Models, joints: JointTable) -> tuple[Float, Float, Bool]:
    """Scales of the second models of joints as the models carry them, their sigmas, and the points not rejected there.

    Raises
    ------
    GeometryError
        If the models carry none.
    """
    e = models.elements
    rows = np.zeros(0, dtype=np.int64) if e is None else np.flatnonzero(e.name == SCALE)
    if e is None or not len(rows):
        raise GeometryError(
            "the models carry no scale of their connection",
            remedy="take relative_orientation/connected before it, or strip_formation/scale_transfer",
        )
    scale, sigma = np.full(len(models.orientations), np.nan), np.full(len(models.orientations), np.nan)
    scale[e.model[rows]], sigma[e.model[rows]] = e.value[rows], e.sigma[rows]
    s, ties = models.suspects, models.suspects.kind == "model_tie"
    rejected = set(zip(s.image[ties].tolist(), s.point[ties].tolist()))
    names = models.orientations.id[joints.second[joints.of_row()]].tolist()
    points = models.points.id[models.model_points.point[active_rows(models)[joints.first_row]]].tolist()
    active = np.array([tie not in rejected for tie in zip(names, points)], dtype=bool)
    return scale[joints.second], sigma[joints.second], active


def unbroken_runs(block: Block, models: Models) -> tuple[list[Chain], list[Gap]]:
    """Runs of neighbouring models in every strip of the Block, before joining, and what breaks them."""
    o, u = models.orientations, models.unformed
    row_of = {(int(i), int(j)): k for k, (i, j) in enumerate(zip(o.left, o.right))}
    reason_of = {(int(i), int(j)): str(reason) for i, j, reason in zip(u.left, u.right, u.reason)}
    runs: list[Chain] = []
    gaps: list[Gap] = []
    for strip in range(len(block.strips)):
        images = [int(row) for row in images_of_strip(block, strip)]
        run = Chain(strip, images[:1])
        for pair in itertools.pairwise(images):
            if pair in row_of:
                run.models.append(row_of[pair])
                run.images.append(pair[1])
                continue
            gaps.append(Gap(strip, *pair, f"no model: {reason_of.get(pair, 'the pair was not oriented')}"))
            runs.append(run)
            run = Chain(strip, [pair[1]])
        runs.append(run)
    return [run for run in runs if run.models] + _runs_without_strip(block, models), gaps


def _runs_without_strip(block: Block, models: Models) -> list[Chain]:
    """Chains of models of images that belong to no strip of the Block, from left to right image."""
    o, strip = models.orientations, block.images.strip
    follows = {int(i): k for k, i in enumerate(o.left) if strip[i] < 0 and strip[o.right[k]] < 0}
    ends = {int(o.right[k]) for k in follows.values()}
    runs = []
    for image in sorted(set(follows) - ends):
        run, at = Chain(-1, [image]), image
        while at in follows and len(run.models) < len(follows):
            run.models.append(follows[at])
            at = int(o.right[follows[at]])
            run.images.append(at)
        runs.append(run)
    return runs


def chains_of(runs: Sequence[Chain], open_joints: Mapping[int, str]) -> tuple[list[Chain], list[Gap]]:
    """Runs of neighbouring models with their joints, numbered run by run; split at those that are not made.

    Parameters
    ----------
    open_joints : mapping
        Why a joint is not made, by its number.
    """
    chains, gaps, joint = list[Chain](), list[Gap](), -1
    for run in runs:
        chains.append(Chain(run.strip, run.images[:2], run.models[:1]))
        for image, following, model in zip(run.images[1:], run.images[2:], run.models[1:]):
            joint += 1
            if joint in open_joints:
                gaps.append(Gap(run.strip, image, following, open_joints[joint]))
                chains.append(Chain(run.strip, [image, following], [model]))
                continue
            chains[-1].models.append(model)
            chains[-1].images.append(following)
            chains[-1].joints.append(joint)
    return chains, gaps


def images_left_alone(block: Block, chains: Sequence[Chain]) -> list[Gap]:
    """Active images that are in no free strip."""
    placed = {image for chain in chains for image in chain.images}
    unpaired = [int(row) for row in np.flatnonzero(block.images.active) if row not in placed]
    strip = block.images.strip
    return [
        Gap(int(strip[row]), row, -1, "image alone: " + ("no model" if strip[row] >= 0 else "it belongs to no strip"))
        for row in unpaired
    ]
