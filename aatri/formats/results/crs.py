"""The coordinate system beside a model whose own form has no place for it: `crs.txt`, a line a fact."""

from pathlib import Path

from aatri.artifacts.block import Block
from aatri.errors import ResourceError

NAME = "crs.txt"
MAP = "east,north,up"
"""The order of map coordinates in a Solution, whatever their order in the tables."""


def write_crs(block: Block, folder: Path) -> Path | None:
    """Write in which system the coordinates of an export are; None where the block declares none.

    Parameters
    ----------
    folder : Path
        With the export.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    crs, vertical = str(block.frames.crs[0]), str(block.frames.vertical[0])
    if crs == "local":
        return None
    given = str(block.frames.axes[0])
    axes = MAP if sorted(given.split(",")) == sorted(MAP.split(",")) else given
    lines = [f"crs: {crs}", *([f"vertical: {vertical}"] if vertical else []), f"axes: {axes}", "unit: m"]
    path = folder / NAME
    try:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise ResourceError(f"cannot write: {error.strerror}", where=str(path), remedy="another place") from error
    return path
