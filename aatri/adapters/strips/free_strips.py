"""Joined models as the artifact Strips; in metres, their scale by control, and models in their strip, kept apart.

    m = sqrt( sum |X - X0|^2 / sum |x - x0|^2 )        metres of a first base, over the control points of a strip
    scale number of an image = m z / c,                 z the median distance of its points along its axis,
                                                        each point of its two models once

Source: lecture notes, free strips: X_S2 = X_S1 + m B_x, m the denominator of the photo scale (A404).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adapters.observation_tables import seen_by_one, still_in_no_model, unchecked
from aatri.adapters.solution import stacked, suspect_rows
from aatri.adapters.strips.model_chains import Chain, Gap, active_rows
from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import (
    Discrepancies,
    FreeStrips,
    Gaps,
    ImageScales,
    Joints,
    PlacedPoints,
    StripImages,
    StripPoints,
    Strips,
    StripScales,
)
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.observations.control import control_of
from aatri.orientation.strips.chain import ChainedModels, form_strips
from aatri.orientation.strips.joints import JointTable, ModelTable


def with_models_apart(
    strips: Strips, block: Block, models: Models, table: ModelTable, formed: ChainedModels, chains: Sequence[Chain]
) -> Strips:
    """The strips with their scales, those of their images, and all points of all models."""
    strip_of = np.full(len(models.orientations), -1)
    for k, chain in enumerate(chains):
        strip_of[chain.models] = k
    model = table.of_row()
    rows = np.flatnonzero(strip_of[model] >= 0)
    strip, point = strip_of[model[rows]], table.point[rows]
    metres, counts = _metres(block, strips)
    x = formed.placed[rows]
    images = strips.strip_images
    number = np.full(len(images), np.nan)
    c = block.cameras.principal_distance_mm[block.images.camera[images.image]]
    ends = models.orientations.left[model[rows]], models.orientations.right[model[rows]]
    for k, (s, image) in enumerate(zip(images.strip.tolist(), images.image.tolist())):
        seen = np.flatnonzero((strip == s) & ((ends[0] == image) | (ends[1] == image)))
        once = seen[np.unique(point[seen], return_index=True)[1]]  # most points of an image are in both its models
        away = -(x[once] - images.position[k]) @ images.strip_from_image[k][:, 2]
        number[k] = metres[s] * float(np.median(away)) / (1e-3 * c[k]) if len(once) else np.nan
    per_strip = [number[(images.strip == s) & np.isfinite(number)] for s in range(len(metres))]
    return replace(
        strips,
        scales=StripScales(
            strip=np.arange(len(metres), dtype=np.int32),
            control_points=counts.astype(np.int32),
            metres=metres,
            scale_number=np.array(
                [float(np.median(scale_numbers)) if len(scale_numbers) else np.nan for scale_numbers in per_strip]
            ),
        ),
        image_scales=ImageScales(strip=images.strip, image=images.image, scale_number=number),
        placed_points=PlacedPoints(
            strip=strip.astype(np.int32),
            model=models.orientations.id[model[rows]],
            point=point.astype(np.int32),
            xyz=x,
            xyz_m=x * metres[strip][:, None],
        ),
    )


def _metres(block: Block, strips: Strips) -> tuple[Float, Int]:
    """Length of the first base of each strip, m, NaN with fewer than two control points; how many it has."""
    control, p = control_of(block), strips.strip_points
    full = control.given.all(axis=1)
    X = np.full((len(block.points), 3), np.nan)
    X[control.point[full]] = control.xyz_m[full]
    metres, counts = np.full(len(strips.strips), np.nan), np.zeros(len(strips.strips), dtype=np.int64)
    for s in range(len(metres)):
        rows = np.flatnonzero((p.strip == s) & np.isfinite(X[p.point]).all(axis=1))
        counts[s] = len(rows)
        if len(rows) > 1:
            ground, inside = X[p.point[rows]], p.xyz[rows]
            squares = [((places - places.mean(axis=0)) ** 2).sum() for places in (ground, inside)]
            metres[s] = np.sqrt(squares[0] / squares[1])
    return metres, counts


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
