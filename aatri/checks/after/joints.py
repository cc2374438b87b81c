"""Joints of models in strips, and the gaps between them.

Seen: scales that jump, connection points too few, too near to each other or against each other, strips that turn round,
places where a strip is split.
Test: the limits of the options; of single connection points that of the number of tests made.
"""

from collections.abc import Sequence

import numpy as np

from aatri.adapters.strips.model_chains import Chain, Gap, names_of_joint
from aatri.arrays import Bool
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.checks.finding import Finding
from aatri.checks.limits import CHECKED_POINTS, UNSTABLE_SPREAD
from aatri.ids import several
from aatri.orientation.strips.joints import JointTable


def findings_of_joints(
    block: Block,
    models: Models,
    joints: JointTable,
    chains: Sequence[Chain],
    gaps: Sequence[Gap],
    turned: Bool,
    scale_jump: float,
    limit: float,
) -> list[Finding]:
    """Doubtful joints, each at its image, gaps, and strips that turn round.

    Parameters
    ----------
    chains, gaps : sequence
        Of which the strips are made, and what is between them.
    turned : (j,) bool
        Joints at which the base runs backwards.
    scale_jump : float
        A scale factor above this, or below its inverse, is told.
    limit : float
        Of the test statistics of connection points.
    """
    at = {joint: image for chain in chains for joint, image in zip(chain.joints, chain.images[1:])}
    used, worst, scale = joints.used(), joints.largest_test(), joints.scale
    jumps = ~((scale >= 1 / scale_jump) & (scale <= scale_jump))
    few, disagree = used < CHECKED_POINTS, worst > limit
    unstable = ~few & (joints.spread < UNSTABLE_SPREAD)
    findings = []
    for k in np.flatnonzero(jumps | few | disagree | unstable).tolist():
        covered = f"the connection points cover {joints.spread[k]:.0%} of the width of the models"
        texts = (
            (jumps, f"the scale jumps by a factor of {scale[k]:.3g}: change of height, or wrong points"),
            (few, f"only {several(used[k], 'connection point')}: a wrong one cannot be located"),
            (disagree, f"the scales of the connection points disagree by {worst[k]:.1f} standard deviations"),
            (unstable, f"bridge unstable: {covered}"),
        )
        if k in at:
            where = f"joint of {names_of_joint(models, joints, k)} at image {block.images.id[at[k]]}"
            findings += [_warning(text, where=where) for holds, text in texts if holds[k]]
    findings += [_warning(gap.reason, where=_place(block, gap)) for gap in gaps]
    backwards = tuple(str(block.images.id[at[k]]) for k in np.flatnonzero(turned).tolist() if k in at)
    if backwards:
        text = "strips turn round (the base runs backwards): is the sequence of the images right?"
        findings.append(_warning(text, backwards))
    return findings


def _warning(text: str, ids: tuple[str, ...] = (), where: str = "") -> Finding:
    return Finding("joints", "warning", text, ids=ids, where=where)


def _place(block: Block, gap: Gap) -> str:
    strip = f"strip {block.strips.id[gap.strip]}" if gap.strip >= 0 else "no strip"
    return f"{strip}, {' - '.join(str(block.images.id[row]) for row in (gap.left, gap.right) if row >= 0)}"
