"""Joined models as the artifact Strips."""

from collections.abc import Sequence

import numpy as np

from aatri.adapters.solution import stacked, suspect_rows
from aatri.adapters.strips.model_chains import Chain, Gap, active_rows
from aatri.adapters.strips.models_in_strips import with_models_apart
from aatri.adapters.uncontrolled_before import seen_by_one, still_in_no_model, unchecked
from aatri.arrays import Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Discrepancies, FreeStrips, Gaps, Joints, StripImages, StripPoints, Strips
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.orientation.strips.chain import ChainedModels, form_strips
from aatri.orientation.strips.joints import JointTable, ModelTable


def free_strip_ids(block: Block, chains: Sequence[Chain]) -> list[str]:
    """The Block's id of the strip, with .1 .2 ... where it is broken."""
    of_strip = [chain.strip for chain in chains]
    ids: list[str] = []
    used_ids = set(block.strips.id.tolist())
    for k, strip in enumerate(of_strip):
        number = of_strip[: k + 1].count(strip)
        if strip < 0:
            name = f"found {number}"
            ids.append(name if name not in used_ids else f"{name} by overlap")
            continue
        ids.append(str(block.strips.id[strip]) + (f".{number}" if of_strip.count(strip) > 1 else ""))
    return ids


def strips_of(
    block: Block,
    models: Models,
    table: ModelTable,
    joints: JointTable,
    chains: Sequence[Chain],
    gaps: Sequence[Gap],
    *,
    apart: bool = False,
) -> Strips:
    """Strips of chains and their geometry; `apart`: with their scale in metres and the points of every model."""
    formed = form_strips(table, joints, [(chain.models, chain.joints) for chain in chains])
    used = np.array([k for chain in chains for k in chain.joints], dtype=np.int64)
    of_row = np.full(len(joints.first), -1)
    of_row[used] = np.arange(len(used))
    joint = of_row[joints.of_row()]
    rows = np.flatnonzero(joint >= 0)
    rows = rows[np.argsort(joint[rows], kind="stable")]
    strips = Strips(
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
        uncontrolled=_uncontrolled(block, models, formed, joints, chains),
    )
    return with_models_apart(strips, block, models, table, formed, chains) if apart else strips


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
    return suspect_rows(
        "strip_formation",
        "model_tie",
        image=models.orientations.id[joints.second[joints.of_row()[rows]]],
        point=block.points.id[table.point[joints.first_row[rows]]],
        size=joints.size[rows],
        unit="log scale",
        sigma=joints.size_sigma[rows],
        test=joints.test[rows],
    )


def _uncontrolled(
    block: Block, models: Models, formed: ChainedModels, joints: JointTable, chains: Sequence[Chain]
) -> Uncontrolled:
    """Image points in one model of their strip or in none, joints of one connection point."""
    p, n = models.model_points, len(block.points)
    rows = active_rows(models)
    strip = np.full(len(models.orientations), -1, dtype=np.int64)
    for number, chain in enumerate(chains):
        strip[chain.models] = number
    is_formed = np.zeros(len(joints.first), dtype=bool)
    is_formed[[k for chain in chains for k in chain.joints]] = True
    use = strip[p.model[rows]] >= 0
    rejected = ~joints.active & is_formed[joints.of_row()]
    use[joints.first_row[rejected]] = use[joints.second_row[rejected]] = False
    rows = rows[use]
    key = formed.strip.astype(np.int64) * n + formed.point
    place = np.searchsorted(key, strip[p.model[rows]] * n + p.point[rows])
    single = formed.models[place] == 1
    single_tie = np.flatnonzero(joints.active & (is_formed & (joints.used() == 1))[joints.of_row()])
    ties = unchecked(
        "model_tie",
        models.orientations.id[joints.second[joints.of_row()[single_tie]]],
        block.points.id[p.point[active_rows(models)[joints.second_row[single_tie]]]],
    )
    return stacked([still_in_no_model(models.uncontrolled), seen_by_one(block, models, rows[single]), ties])
