"""`aatri new` of a network beside the images that show its points: what `block/merged` takes of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from aatri.errors import InputError, SpecError

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts
    from aatri.formats.registry.settings import Setting, SourceWithSettings

FIRST_IMAGES = (
    "aatri new IMAGES --from the others, `aatri run` it, then `block/merged` of its Block and the network: "
    "docs/methods/merging.md"
)
INTO_NETWORK = "write the points into the network: of GNU Gama, <point> with x, y, z and fix, or as <coordinates>"


def check_merged(
    sources: Sequence[SourceWithSettings], parts: Sequence[BlockParts], settings: Sequence[Setting]
) -> None:
    """Refuse beside a network what `block/merged` does not take: other sources than one of images, and options."""
    from aatri.formats.registry.settings import FRAME

    others = [(s, p) for s, p in zip(sources, parts) if not is_network(p)]
    images = [s for s, p in others if p.images or p.image_points]
    what, where = "", images[-1:]
    if len(images) < len(others):
        what, where = "a list without images", [s for s, _ in others if s not in images]
    elif len(images) > 1:
        what = "several sources of images"
    elif not images[0].format.stage:
        what = f"images of {images[0].format.title}, which no stage of their own reads"
    if what:
        remedy = FIRST_IMAGES if images else INTO_NETWORK
        raise InputError(f"a network beside {what}", where=str(where[0].path), remedy=remedy)
    of_sources = [(s, setting) for s in sources for setting in s.settings]
    refused = [s for s in settings if s.key not in FRAME] + [s for _, s in of_sources if s.key not in FRAME]
    if refused:
        what = f"{refused[0].key} is no option of a network and images, which block/merged puts together"
        raise SpecError(what, where=refused[0].text, remedy=f"options are {', '.join(FRAME)}")
    for source, setting in of_sources:
        if source.format.name == "tables":
            what = f"{source.path} says its coordinate system itself"
            raise SpecError(what, where=setting.text, remedy="write it in its block.yaml")


def is_network(parts: BlockParts) -> bool:
    return "geodetic" in parts.others and not parts.images
