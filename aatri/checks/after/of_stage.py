"""Any stage that rejects observations: the checks of its artifact.

Seen: what the files it calls look for.
Test: theirs.
"""

from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects
from aatri.checks.after.rejections import exchanged_numbers, rejections
from aatri.checks.after.uncontrolled import uncontrolled_observations
from aatri.checks.at_start.sharp_conditions import sharp_conditions
from aatri.checks.finding import Finding


def findings_of(
    block: Block, artifact: Models | Strips | Solution, stage: str, before: Suspects | None = None
) -> list[Finding]:
    """What was rejected, what of it has another's number, what nothing controls, and what rounding may hide.

    Parameters
    ----------
    block : Block
        In the frame of a Solution.
    stage : str
        Its role.
    before : Suspects, optional
        Of the Solution it began from.
    """
    exchanged = exchanged_numbers(block, artifact, before or Suspects.empty()) if isinstance(artifact, Solution) else []
    findings = [*rejections(artifact.suspects, stage), *exchanged]
    if artifact.uncontrolled:
        findings += uncontrolled_observations(artifact.uncontrolled)
    if not isinstance(artifact, Solution) or not len(block.relative_control):
        return findings
    return [*sharp_conditions(block, artifact.images.position_m, artifact.points.xyz_m), *findings]
