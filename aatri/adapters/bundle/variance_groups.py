"""Which observations of a block have a standard deviation in common, by what the tables say of them."""

from collections.abc import Collection
from typing import Literal

import numpy as np

from aatri.adjusting.adjusted_observations import classes_of
from aatri.arrays import Int, Text
from aatri.artifacts.block import Block
from aatri.ids import rows_of
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.variance_groups import VarianceGroups, grouped

Level = Literal["kind", "camera", "flight", "group"]


def variance_groups(block: Block, inputs: BundleInput, levels: Collection[Level]) -> VarianceGroups:
    """Groups of all observations: their kind and its parts always; of image points the camera, flight and group."""
    labels: list[list[str]] = []
    parts: list[Int] = []
    for o in inputs.observed:
        if o.exact or not len(o):
            labels.append([])
            parts.append(np.full((len(o), o.records.rows), -1, dtype=np.int64))
            continue
        of_rows, row = np.unique(_of_rows(block, o, levels), return_inverse=True)
        names, number = classes_of(o, of_rows.tolist(), row)
        labels.append(names)
        parts.append(number)
    return grouped(inputs.observed, labels, parts)


def _of_rows(block: Block, o: Observed, levels: Collection[Level]) -> Text:
    """What distinguishes the observations of one kind, (n,) str."""
    image, _ = o.names(np.arange(len(o)))
    row = rows_of(image, block.images.id)
    of_image = row >= 0
    texts = np.full(len(o), "", dtype="U256")
    in_image = {POSE, POINT} <= o.records.groups
    if "camera" in levels and in_image and len(block.cameras) > 1:
        camera = block.cameras.id[block.images.camera[np.maximum(row, 0)]]
        texts = np.where(of_image, np.char.add(texts, np.char.add(" camera ", camera)), texts)
    if "flight" in levels and of_image.any():
        flight = block.images.flight[np.maximum(row, 0)]
        texts = np.where(of_image & (flight != ""), np.char.add(texts, np.char.add(" flight ", flight)), texts)
    if "group" in levels and o.group is not None:
        texts = np.where(o.group != "", np.char.add(texts, np.char.add(" group ", o.group)), texts)
    return np.char.strip(texts)
