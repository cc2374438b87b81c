"""Layout of a test field, planned or built: its targets, pillars and cameras against the rules of the notes.

Some tens of targets, evenly spread, extended along all three axes; room for the cameras, which stand outside of them;
two or more pillars from which the targets are measured again. Every rule that is broken is a warning with its figure.
The field is the control and check points of a block; cameras are those of `solution`, or the approximate or true ones
of the block, so that a plan is checked before anything is built.

Source: lecture notes on close range, 5.4 (A1508); see aatri/evaluation/field_layout.py.
"""

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.evaluation.field_layout import FieldOptions, layout_of_field
from aatri.plugin import SILENT, Context, stage


@stage(version=1, uses=("ground_points:check",))
def field_layout(
    block: Block,
    solution: Solution | None = None,
    *,
    options: FieldOptions = FieldOptions(),
    context: Context = SILENT,
) -> Evaluation:
    """Check the layout of a test field.

    Raises
    ------
    InputError
        If the block has no targets.
    """
    position_m = block.positions_m
    if block.true_images is not None:
        position_m[block.true_images.image] = block.true_images.position_m
    if solution is not None:
        position_m = solution.images.position_m
    result, broken = layout_of_field(block, position_m, options)
    context.log(result.verdict)
    for text in broken:
        context.warn(f"test field: {text}")
    return result
