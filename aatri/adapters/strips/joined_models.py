"""Models of strips joined by scale transfer: from Models to Strips, and what is to be said of joints and gaps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.strips.joint_methods import by_method, reversals
from aatri.adapters.strips.model_chains import (
    Chain,
    Gap,
    images_left_alone,
    model_table,
    strips_of,
    unbroken_runs,
)
from aatri.adapters.strips.strip_uncontrolled import uncontrolled_in_strips
from aatri.adapters.uncontrolled_before import notes_of
from aatri.adjustment.statistics.limits import limit_of_tests
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Strips
from aatri.errors import GeometryError
from aatri.notes import Note
from aatri.orientation.strips.joints import JointTable, scale_transfers

CHECKED_POINTS = 3
"""With fewer connection points a wrong one cannot be located."""

NO_REJECTION = 1e9
"""Limit of test statistics that no point exceeds."""

UNSTABLE_SPREAD = 0.2
"""Connection points that cover less of the width of the models make an unstable bridge."""


@dataclass(frozen=True)
class JointRules:
    """When models are joined, and when a joint is remarked upon.

    Attributes
    ----------
    min_connection_points : int
        With fewer usable common points models are not joined.
    snooping_limit : float or None
        None: by the number of points tested.
        A connection point whose scale is wrong by more standard deviations is rejected.
    scale_jump : float
        A scale factor above this, or below its inverse, is reported.
    method : {'robust', 'weighted', 'mean', 'connected', 'similarity'}
        Scales by the weighted mean of the points with or without rejection, by their plain mean, as the models carry
        them, or with a turn by a similarity.
    """

    min_connection_points: int
    snooping_limit: float | None
    scale_jump: float
    method: str = "robust"


def joined_models(block: Block, models: Models, rules: JointRules) -> tuple[Strips, tuple[Note, ...]]:
    """Join the models of every strip.

    Raises
    ------
    GeometryError
        If there are no models.
    """
    runs, gaps = unbroken_runs(block, models)
    if not runs:
        raise GeometryError(
            f"no strip: none of {len(models.unformed)} pairs of neighbouring images makes a model",
            remedy="see the reasons in the table `unformed` of the relative orientation; check strip and sequence",
        )
    table = model_table(models)
    tests = int(models.model_points.active.sum())
    snooping = limit_of_tests(tests) if rules.snooping_limit is None else rules.snooping_limit
    first = np.array([model for run in runs for model in run.models[:-1]], dtype=np.int64)
    second = np.array([model for run in runs for model in run.models[1:]], dtype=np.int64)
    limit = snooping if rules.method in ("robust", "similarity") else NO_REJECTION
    joints = by_method(models, table, scale_transfers(table, first, second, snooping_limit=limit), rules.method)
    chains, breaks, notes = _joined(block, models, runs, joints, rules, snooping)
    gaps += breaks
    gaps += images_left_alone(block, chains)
    strips = strips_of(block, models, table, joints, chains, gaps)
    strips = replace(strips, uncontrolled=uncontrolled_in_strips(block, models, strips.strip_points, joints, chains))
    notes += [Note("warning", f"{_place(block, gap)}: {gap.reason}") for gap in gaps]
    notes += reversals(block, models, joints, chains)
    notes.append(Note("note", f"{len(chains)} free strips", tuple(strips.strips.id.tolist())))
    assert strips.uncontrolled is not None
    notes += notes_of(strips.uncontrolled, "are in one model of their strip")
    return strips, tuple(notes)


def _joined(
    block: Block, models: Models, runs: list[Chain], joints: JointTable, rules: JointRules, limit: float
) -> tuple[list[Chain], list[Gap], list[Note]]:
    """Join runs of neighbouring models, splitting them where the connection is too weak; joints in the runs' order."""
    chains: list[Chain] = []
    gaps: list[Gap] = []
    notes: list[Note] = []
    used, warnings = joints.used().tolist(), _warnings(joints, rules, limit)
    joint = -1
    for run in runs:
        chain = Chain(run.strip, run.images[:2], run.models[:1])
        chains.append(chain)
        for k, (before, model) in enumerate(zip(run.models[:-1], run.models[1:])):
            joint += 1
            image, following = run.images[k + 1], run.images[k + 2]
            if used[joint] < rules.min_connection_points:
                names = f"{models.orientations.id[before]} and {models.orientations.id[model]}"
                needed = rules.min_connection_points
                reason = f"models {names} share {used[joint]} usable points, {needed} are needed"
                gaps.append(Gap(run.strip, image, following, reason))
                chain = Chain(run.strip, [image, following], [model])
                chains.append(chain)
                continue
            if not np.isfinite(joints.scale[joint]):
                names = f"{models.orientations.id[before]} and {models.orientations.id[model]}"
                gaps.append(Gap(run.strip, image, following, f"models {names} carry no scale of their connection"))
                chain = Chain(run.strip, [image, following], [model])
                chains.append(chain)
                continue
            for warning in warnings.get(joint, ()):
                names = f"{models.orientations.id[before]} and {models.orientations.id[model]}"
                notes.append(Note("warning", f"joint of {names} at image {block.images.id[image]}: {warning}"))
            chain.models.append(model)
            chain.images.append(following)
            chain.joints.append(joint)
    return chains, gaps, notes


def _warnings(joints: JointTable, rules: JointRules, limit: float) -> dict[int, list[str]]:
    """What is to be said of joints that are made, by joint."""
    used, worst = joints.used(), joints.largest_test()
    jumps = ~((joints.scale >= 1 / rules.scale_jump) & (joints.scale <= rules.scale_jump))
    few, disagree = used < CHECKED_POINTS, worst > limit
    unstable = ~few & (joints.spread < UNSTABLE_SPREAD)
    texts: dict[int, list[str]] = {}
    for k in np.flatnonzero(jumps | few | disagree | unstable).tolist():
        found = texts.setdefault(k, [])
        if jumps[k]:
            found.append(f"the scale jumps by a factor of {joints.scale[k]:.3g}: change of height, or wrong points")
        if few[k]:
            found.append(f"only {used[k]} connection points: a wrong one cannot be located")
        if disagree[k]:
            found.append(f"the scales of the connection points disagree by {worst[k]:.1f} standard deviations")
        if unstable[k]:
            covered = f"the connection points cover {joints.spread[k]:.0%} of the width of the models"
            found.append(f"bridge unstable: {covered}")
    return texts


def _place(block: Block, gap: Gap) -> str:
    strip = f"strip {block.strips.id[gap.strip]}" if gap.strip >= 0 else "no strip"
    images = " - ".join(str(block.images.id[row]) for row in (gap.left, gap.right) if row >= 0)
    return f"{strip}, {images}"
