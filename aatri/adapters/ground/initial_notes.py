"""What an initial orientation has to say of its components."""

from aatri.artifacts.block import Block
from aatri.ids import shown
from aatri.notes import Note
from aatri.orientation.graph.component import ImageComponent


def shown_components(components: tuple[ImageComponent, ...], block: Block) -> list[Note]:
    """Sizes of the components; the images of all but the first by name."""
    if len(components) == 1:
        return [Note("note", f"one component of {int(components[0].images.sum())} images")]
    return [
        Note(
            "warning",
            f"{len(components)} components that are not joined; number {k} has {int(c.images.sum())} "
            f"images: {shown(block.images.id[c.images])}",
        )
        for k, c in enumerate(components, 1)
        if k > 1
    ]
