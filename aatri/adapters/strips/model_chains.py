"""Models of a block as chains of neighbours, and the Strips made of them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from aatri.adapters.pairs.image_pairs import images_of_strip
from aatri.adapters.solution import stacked
from aatri.arrays import Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Discrepancies, FreeStrips, Gaps, Joints, StripImages, StripPoints, Strips
from aatri.artifacts.suspects import Suspects
from aatri.orientation.strips.chain import form_strips
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
    """Neighbouring models of a strip of the Block, with their joints.

    Attributes
    ----------
    strip : int
        Row in the Block's strips.
    images : list of int
        Rows in images, one more than models.
    models : list of int
        Rows in the orientations of Models.
    joints : list of int
        Rows in the table of joints.
    """

    strip: int
    images: list[int]
    models: list[int] = field(default_factory=list)
    joints: list[int] = field(default_factory=list)


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
    return rows[np.lexsort((p.point[rows], p.model[rows]))]


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


def images_left_alone(block: Block, chains: Sequence[Chain]) -> list[Gap]:
    """Active images that are in no free strip."""
    placed = {image for chain in chains for image in chain.images}
    alone = [int(row) for row in np.flatnonzero(block.images.active) if row not in placed]
    strip = block.images.strip
    return [
        Gap(int(strip[row]), row, -1, "image alone: " + ("no model" if strip[row] >= 0 else "it belongs to no strip"))
        for row in alone
    ]


def free_strip_ids(block: Block, chains: Sequence[Chain]) -> list[str]:
    """The Block's id of the strip, with .1 .2 ... where it is broken."""
    of_strip = [chain.strip for chain in chains]
    ids: list[str] = []
    taken = set(block.strips.id.tolist())
    for k, strip in enumerate(of_strip):
        number = of_strip[: k + 1].count(strip)
        if strip < 0:
            name = f"found {number}"
            ids.append(name if name not in taken else f"{name} by overlap")
            continue
        ids.append(str(block.strips.id[strip]) + (f".{number}" if of_strip.count(strip) > 1 else ""))
    return ids


def strips_of(
    block: Block, models: Models, table: ModelTable, joints: JointTable, chains: Sequence[Chain], gaps: Sequence[Gap]
) -> Strips:
    """Strips of chains and their geometry."""
    formed = form_strips(table, joints, [(chain.models, chain.joints) for chain in chains])
    used = np.array([k for chain in chains for k in chain.joints], dtype=np.int64)
    of_row = np.full(len(joints.first), -1)
    of_row[used] = np.arange(len(used))
    joint = of_row[joints.of_row()]
    rows = np.flatnonzero(joint >= 0)
    rows = rows[np.argsort(joint[rows], kind="stable")]
    return Strips(
        images=models.images,
        points=models.points,
        strips=FreeStrips(id=np.array(free_strip_ids(block, chains), dtype=np.str_)),
        strip_images=StripImages(
            strip=formed.image_strip.astype(np.int32),
            image=np.array([image for chain in chains for image in chain.images], dtype=np.int32),
            position=formed.position,
            strip_from_image=formed.strip_from_image,
        ),
        strip_points=StripPoints(
            strip=formed.strip.astype(np.int32),
            point=formed.point.astype(np.int32),
            xyz=formed.xyz,
            covariance=formed.covariance,
            models=formed.models.astype(np.int32),
        ),
        joints=_joints(joints, chains, used),
        discrepancies=Discrepancies(
            joint=joint[rows].astype(np.int32),
            point=table.point[joints.first_row[rows]].astype(np.int32),
            xyz=formed.placed[joints.second_row[rows]] - formed.placed[joints.first_row[rows]],
            log_scale=joints.log_scale[rows],
            active=joints.active[rows],
        ),
        gaps=_gaps(block, gaps),
        suspects=stacked([models.suspects, _suspects(block, models, table, joints, rows[~joints.active[rows]])]),
    )


def _joints(joints: JointTable, chains: Sequence[Chain], used: Int) -> Joints:
    count = np.array([len(chain.joints) for chain in chains], dtype=np.int64)
    return Joints(
        strip=np.repeat(np.arange(len(chains)), count).astype(np.int32),
        image=np.array([image for chain in chains for image in chain.images[1:-1]], dtype=np.int32),
        scale=joints.scale[used],
        sigma=joints.sigma[used],
        points=joints.used()[used].astype(np.int32),
    )


def _gaps(block: Block, gaps: Sequence[Gap]) -> Gaps:
    def named(table: Text, row: int) -> str:
        return str(table[row]) if row >= 0 else ""

    return Gaps(
        strip=np.array([named(block.strips.id, gap.strip) for gap in gaps], dtype=np.str_),
        left=np.array([named(block.images.id, gap.left) for gap in gaps], dtype=np.str_),
        right=np.array([named(block.images.id, gap.right) for gap in gaps], dtype=np.str_),
        reason=np.array([gap.reason for gap in gaps], dtype=np.str_),
    )


def _suspects(block: Block, models: Models, table: ModelTable, joints: JointTable, rows: Int) -> Suspects:
    """Rejected connection points, under the id of the second model."""
    n = len(rows)
    return Suspects(
        kind=np.full(n, "model_tie"),
        row=np.full(n, -1, dtype=np.int32),
        image=models.orientations.id[joints.second[joints.of_row()[rows]]],
        point=block.points.id[table.point[joints.first_row[rows]]],
        stage=np.full(n, "strip_formation"),
        size=joints.size[rows],
        unit=np.full(n, "log scale"),
        sigma=joints.size_sigma[rows],
        test=joints.test[rows],
        verdict=np.full(n, "rejected"),
    )
