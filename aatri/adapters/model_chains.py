"""Models of a block as chains of neighbours, and the Strips made of them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from aatri.adapters.image_pairs import images_of_strip
from aatri.adapters.solution import stacked
from aatri.arrays import Text
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Discrepancies, FreeStrips, Gaps, Joints, StripImages, StripPoints, Strips
from aatri.artifacts.suspects import Suspects
from aatri.orientation.strips.chain import FreeStrip
from aatri.orientation.strips.scale_transfer import Joint, Model


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
    joints : list of Joint
    """

    strip: int
    images: list[int]
    models: list[int] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)


def model_geometry(models: Models) -> list[Model]:
    """Every model with its active points, as the methods want it."""
    o, p = models.orientations, models.model_points
    rows = np.flatnonzero(p.active)
    rows = rows[np.lexsort((p.point[rows], p.model[rows]))]
    first = np.searchsorted(p.model[rows], np.arange(len(o) + 1))
    parts = [rows[first[k] : first[k + 1]] for k in range(len(o))]
    return [
        Model(o.left_from_right[k], o.base[k], o.covariance[k], p.point[part], p.xyz[part], p.covariance[part])
        for k, part in enumerate(parts)
    ]


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
    return [run for run in runs if run.models], gaps


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
    ids = []
    for k, strip in enumerate(of_strip):
        number = of_strip[: k + 1].count(strip)
        ids.append(str(block.strips.id[strip]) + (f".{number}" if of_strip.count(strip) > 1 else ""))
    return ids


def strips_of(
    block: Block, models: Models, chains: Sequence[Chain], formed: Sequence[FreeStrip], gaps: Sequence[Gap]
) -> Strips:
    """Strips of chains and their geometry."""
    first_joint = np.cumsum([0, *(len(chain.joints) for chain in chains)])
    parts = list(enumerate(zip(chains, formed)))
    return Strips(
        images=models.images,
        points=models.points,
        strips=FreeStrips(id=np.array(free_strip_ids(block, chains), dtype=np.str_)),
        strip_images=stacked([StripImages.empty(), *(_images(k, chain, strip) for k, (chain, strip) in parts)]),
        strip_points=stacked([StripPoints.empty(), *(_points(k, strip) for k, (_, strip) in parts)]),
        joints=stacked([Joints.empty(), *(_joints(k, chain) for k, (chain, _) in parts)]),
        discrepancies=stacked(
            [Discrepancies.empty(), *(_discrepancies(int(first_joint[k]), c, s) for k, (c, s) in parts)]
        ),
        gaps=_gaps(block, gaps),
        suspects=stacked([models.suspects, *(_suspects(block, models, chain) for chain in chains)]),
    )


def _images(row: int, chain: Chain, strip: FreeStrip) -> StripImages:
    return StripImages(
        strip=np.full(len(chain.images), row, dtype=np.int32),
        image=np.array(chain.images, dtype=np.int32),
        position=strip.position,
        strip_from_image=strip.strip_from_image,
    )


def _points(row: int, strip: FreeStrip) -> StripPoints:
    return StripPoints(
        strip=np.full(len(strip.point), row, dtype=np.int32),
        point=strip.point.astype(np.int32),
        xyz=strip.xyz,
        covariance=strip.covariance,
        models=strip.models.astype(np.int32),
    )


def _joints(row: int, chain: Chain) -> Joints:
    return Joints(
        strip=np.full(len(chain.joints), row, dtype=np.int32),
        image=np.array(chain.images[1:-1], dtype=np.int32),
        scale=np.array([joint.scale for joint in chain.joints], dtype=np.float64),
        sigma=np.array([joint.sigma for joint in chain.joints], dtype=np.float64),
        points=np.array([joint.active.sum() for joint in chain.joints], dtype=np.int32),
    )


def _discrepancies(first_joint: int, chain: Chain, strip: FreeStrip) -> Discrepancies:
    return stacked(
        [
            Discrepancies.empty(),
            *(
                Discrepancies(
                    joint=np.full(len(joint.point), first_joint + k, dtype=np.int32),
                    point=joint.point.astype(np.int32),
                    xyz=xyz,
                    log_scale=joint.log_scale,
                    active=joint.active,
                )
                for k, (joint, xyz) in enumerate(zip(chain.joints, strip.discrepancy))
            ),
        ]
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


def _suspects(block: Block, models: Models, chain: Chain) -> Suspects:
    """Rejected connection points, under the id of the second model."""
    tables = [Suspects.empty()]
    for model, joint in zip(chain.models[1:], chain.joints):
        rows = np.flatnonzero(~joint.active)
        n = len(rows)
        tables.append(
            Suspects(
                kind=np.full(n, "model_tie"),
                row=np.full(n, -1, dtype=np.int32),
                image=np.full(n, models.orientations.id[model]),
                point=block.points.id[joint.point[rows]],
                stage=np.full(n, "strip_formation"),
                size=joint.size[rows],
                unit=np.full(n, "log scale"),
                sigma=joint.size_sigma[rows],
                test=joint.test[rows],
                verdict=np.full(n, "rejected"),
            )
        )
    return stacked(tables)
