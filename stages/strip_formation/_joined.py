"""What the variants share: options, joining the models of every strip, and what is to be said of joints and gaps."""

import re
from collections import Counter
from collections.abc import Callable

import numpy as np

from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.free_strips import strips_of
from aatri.adapters.strips.model_chains import chains_of, images_left_alone, model_table, names_of_joint, unbroken_runs
from aatri.adjustment.statistics.limits import limit_of_tests
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Strips
from aatri.checks.after.joints import findings_of_joints
from aatri.checks.after.of_stage import findings_of
from aatri.checks.finding import report
from aatri.errors import GeometryError
from aatri.ids import several
from aatri.notes import Note
from aatri.orientation.strips.joints import JointTable, ModelTable, scale_transfers, turns_round
from aatri.plugin import Context, Field, Options

NO_REJECTION = 1e9
"""Limit of test statistics that no point exceeds."""


class JoiningOptions(Options):
    """Options of the strip formation."""

    min_connection_points: int = Field(
        2, ge=1, description="models with fewer usable common points are not joined: the strip is split there"
    )
    models_apart: bool = Field(
        False,
        description="scales of strips and images by control, coordinates in metres, and the points of every model in "
        "its strip, none averaged",
    )
    scale_jump: float = Field(2.0, gt=1, description="a scale factor above this, or below its inverse, is reported")


class SnoopingOptions(JoiningOptions):
    """Options of the strip formation with data snooping of the connection points."""

    snooping_limit: float | None = Field(
        None,
        gt=0,
        description="a connection point is rejected if its scale is wrong by more standard deviations; null: by the "
        "number of points, 4 at least",
    )


def limit_of_joints(models: Models, limit: float | None) -> float:
    """Limit of the test statistics of connection points; by the number of points where none is given."""
    return limit_of_tests(int(models.model_points.active.sum())) if limit is None else limit


def joined(
    block: Block,
    models: Models,
    method: Callable[[ModelTable, JointTable], JointTable],
    options: JoiningOptions,
    context: Context,
    *,
    limit: float,
    rejecting: bool,
) -> Strips:
    """Join the models of every strip.

    Parameters
    ----------
    method : callable
        The joints as a variant wants them, from those of the weighted mean.
    limit : float
        Test statistics of connection points above it disagree; they are rejected where the variant is `rejecting`.

    Raises
    ------
    GeometryError
        If there are no models.
    """
    check_same_block(block, models=models)
    runs, gaps = unbroken_runs(block, models)
    if not runs:
        raise GeometryError(
            f"no strip: none of {len(models.unformed)} pairs of neighbouring images makes a model{_commonest(models)}",
            remedy="check strip and sequence of the images, the ids of their points, principal distance and pixel size",
        )
    table = model_table(models)
    first = np.array([model for run in runs for model in run.models[:-1]], dtype=np.int64)
    second = np.array([model for run in runs for model in run.models[1:]], dtype=np.int64)
    transfers = scale_transfers(table, first, second, snooping_limit=limit if rejecting else NO_REJECTION)
    joints = method(table, transfers)
    chains, breaks = chains_of(runs, _open_joints(models, joints, options.min_connection_points))
    gaps += [*breaks, *images_left_alone(block, chains)]
    strips = strips_of(block, models, table, joints, chains, gaps, apart=options.models_apart)
    strip_ids = strips.strips.id.tolist()
    turned = turns_round(table, joints)
    findings = findings_of_joints(block, models, joints, chains, gaps, turned, options.scale_jump, limit)
    counted = Note("note", several(len(strip_ids), "free strip"), tuple(strip_ids))
    report(_scale_notes(strips), context)
    report([*findings, counted, *findings_of(block, strips, "strip_formation")], context)
    return strips


def _scale_notes(strips: Strips) -> list[Note]:
    """Scales by control; strips without."""
    if strips.scales is None:
        return []
    s, ids = strips.scales, strips.strips.id
    scaled = np.isfinite(s.metres)
    texts = [f"{ids[k]} 1 : {s.scale_number[k]:.0f} (base {s.metres[k]:.1f} m)" for k in np.flatnonzero(scaled)]
    notes = [Note("note", "scales of strips by control", tuple(texts))] if texts else []
    if not scaled.all():
        text = "strips with fewer than two control points of three known coordinates have no scale"
        notes.append(Note("warning", text, tuple(ids[~scaled].tolist())))
    return notes


def _commonest(models: Models) -> str:
    """The commonest reason of pairs without model, whatever its numbers, and how many have it."""
    reasons = models.unformed.reason.tolist()
    if not reasons:
        return ""
    kinds = [re.sub(r"[0-9.]+", "#", reason) for reason in reasons]
    kind, count = Counter(kinds).most_common(1)[0]
    return f"; {count} of them: {reasons[kinds.index(kind)]}"


def _open_joints(models: Models, joints: JointTable, needed: int) -> dict[int, str]:
    """Why models are not joined, by joint."""
    used, open_ = joints.used(), {}
    for joint in np.flatnonzero((used < needed) | ~np.isfinite(joints.scale)).tolist():
        few = f"share {several(used[joint], 'usable point')}, {needed} are needed"
        what = few if used[joint] < needed else "carry no scale of their connection"
        open_[joint] = f"models {names_of_joint(models, joints, joint)} {what}"
    return open_
