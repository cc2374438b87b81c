"""Scales and turns of joints by the method asked for, and strips that turn round."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adapters.pairs.models import SCALE
from aatri.adapters.strips.model_chains import Chain
from aatri.arrays import Bool
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.errors import GeometryError
from aatri.notes import Note
from aatri.orientation.strips.joints import JointTable, ModelTable
from aatri.orientation.strips.similarity_joints import similarity_joints


def by_method(models: Models, table: ModelTable, joints: JointTable, method: str) -> JointTable:
    """The joints of `scale_transfers`, changed as the method wants it; see `JointRules`."""
    if method == "mean":
        return _means(joints)
    if method == "connected":
        return _carried(models, joints)
    return similarity_joints(table, joints) if method == "similarity" else joints


def _means(joints: JointTable) -> JointTable:
    """Scales as the plain mean of those of the points; their scatter gives the standard deviation."""
    own = np.exp(joints.log_scale) * joints.scale[joints.of_row()]
    count = np.bincount(joints.of_row(), minlength=len(joints.first))
    mean = np.bincount(joints.of_row(), own, minlength=len(count)) / np.where(count > 0, count, np.nan)
    square = np.bincount(joints.of_row(), (own - mean[joints.of_row()]) ** 2, minlength=len(count))
    sigma = np.sqrt(square / np.where(count > 1, count * (count - 1), np.nan))
    everything = np.ones(len(own), dtype=bool)
    return replace(joints, scale=mean, sigma=sigma, active=everything, log_scale=np.log(own / mean[joints.of_row()]))


def _carried(models: Models, joints: JointTable) -> JointTable:
    """Scales as the models carry them."""
    e = models.elements
    rows = np.zeros(0, dtype=np.int64) if e is None else np.flatnonzero(e.name == SCALE)
    if e is None or not len(rows):
        raise GeometryError(
            "the models carry no scale of their connection",
            remedy="take relative_orientation/connected before it, or strip_formation/scale_transfer",
        )
    scale, sigma = np.full(len(models.orientations), np.nan), np.full(len(models.orientations), np.nan)
    scale[e.model[rows]], sigma[e.model[rows]] = e.value[rows], e.sigma[rows]
    s = models.suspects
    wrong = s.kind == "model_tie"
    rejected = set(zip(s.image[wrong].tolist(), s.point[wrong].tolist()))
    names = models.orientations.id[joints.second[joints.of_row()]]
    own = joints.log_scale + np.log(joints.scale[joints.of_row()])
    return replace(
        joints,
        scale=scale[joints.second],
        sigma=sigma[joints.second],
        log_scale=own - np.log(scale[joints.second])[joints.of_row()],
        active=_not_among(joints, models, names.tolist(), rejected),
    )


def _not_among(joints: JointTable, models: Models, names: list[str], rejected: set[tuple[str, str]]) -> Bool:
    found = np.ones(len(names), dtype=bool)
    if rejected:
        rows = np.flatnonzero(models.model_points.active)
        rows = rows[np.lexsort((models.model_points.point[rows], models.model_points.model[rows]))]
        points = models.points.id[models.model_points.point[rows]][joints.first_row]
        found = np.array([(name, point) not in rejected for name, point in zip(names, points.tolist())], dtype=bool)
    return found


def reversals(block: Block, models: Models, joints: JointTable, chains: Sequence[Chain]) -> list[Note]:
    """A warning where a strip turns round: the base of a model runs against that of the model before."""
    o = models.orientations
    before = np.einsum("nji,nj->ni", o.left_from_right[joints.first], o.base[joints.first])
    against = (before * o.base[joints.second]).sum(axis=1) < 0
    images = [
        str(block.images.id[chain.images[k + 1]])
        for chain in chains
        for k, joint in enumerate(chain.joints)
        if against[joint]
    ]
    text = "strips turn round (the base runs backwards): is the sequence of the images right?"
    return [Note("warning", text, tuple(images))] if images else []
