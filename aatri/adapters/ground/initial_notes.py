"""What an initial orientation has to say of what it leaves out."""

from __future__ import annotations

import numpy as np

from aatri.adapters.ground.initial_tests import STAGE
from aatri.adapters.strips import strips as pieces
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.ids import shown
from aatri.notes import Level, Note
from aatri.orientation.graph.component import ImageComponent


def rejected_note(suspects: Suspects) -> list[Note]:
    """How many image points, control points and positions are rejected, and what points have no two rays that meet."""
    notes = []
    open_ = np.unique(suspects.point[(suspects.verdict == "undecidable") & (suspects.stage == STAGE)])
    if len(open_):
        text = f"{len(open_)} points whose image points contradict each other are not determined"
        notes.append(Note("note", text, tuple(open_.tolist())))
    for kind in np.unique(suspects.kind[(suspects.verdict == "rejected") & (suspects.stage == STAGE)]).tolist():
        rows = np.flatnonzero((suspects.kind == kind) & (suspects.verdict == "rejected") & (suspects.stage == STAGE))
        ids = tuple("/".join(x for x in pair if x) for pair in zip(suspects.image[rows], suspects.point[rows]))
        level: Level = "note" if kind == "image_point" else "warning"
        notes.append(Note(level, f"{kind}: {len(rows)} rejected", ids))
    return notes


def not_oriented(block: Block, solution: Solution) -> list[Note]:
    """A warning that names the images in use that are not oriented."""
    return pieces.left_out(block, solution.images.oriented)


def shown_components(components: tuple[ImageComponent, ...], block: Block) -> list[Note]:
    """Sizes of the components; the images of all but the first by name."""
    if len(components) == 1:
        return [Note("note", f"one component of {int(components[0].images.sum())} images")]
    return [
        Note("warning", f"{len(components)} components that are not joined; number {k} has {int(c.images.sum())} "
             f"images: {shown(block.images.id[c.images])}")
        for k, c in enumerate(components, 1)
        if k > 1
    ]  # fmt: skip
