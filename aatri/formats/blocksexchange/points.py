"""Control and tie points of BlocksExchange XML with their systems, and the files that hold the tie points.

`TiePoints` may name a file beside it, `.xml` or `.xmlz`: `TiePoint` elements one after the other, without one around
them, as they would stand in `TiePoints`.
"""

import re
from collections.abc import Iterator
from itertools import count
from pathlib import Path

from aatri.formats.text.xml_tree import XmlElement, read_xml, xml_text

MOST_OF_NAME = 255
"""Bytes of a file name that disks take."""
DECLARATION = re.compile(r"\s*<\?xml[^>]*\?>")


def add_tie_points(block: XmlElement, path: Path) -> tuple[list[Path], list[str]]:
    """Put the tie points of files that a block names where it names them.

    Returns
    -------
    files, absent : list of Path, list of str
        What was read, and names of files that are not beside it.
    """
    files, absent = list[Path](), list[str]()
    for points in block.all("TiePoints"):
        for stated in points.all("Path"):
            name = re.split(r"[/\\]", stated.text)[-1]
            beside = [path.parent / name, path.parent / f"{name}z"] if 0 < len(name.encode()) < MOST_OF_NAME else []
            file = next((file for file in beside if file.is_file()), None)
            if file is None:
                absent.append(stated.text)
                continue
            text = DECLARATION.sub("", xml_text(file), count=1)
            ties = read_xml(file, ("TiePoints",), "tie points", f"<TiePoints>{text}</TiePoints>").all("TiePoint")
            if not ties:
                raise stated.error(f"{file.name} has no TiePoint", "export the tie points again")
            points.children += ties
            files.append(file)
    return files, absent


def points_of(block: XmlElement, kind: str) -> Iterator[tuple[int, XmlElement, XmlElement | None]]:
    """Number, point and SRSId of its `ControlPoint`s or `TiePoint`s: their own one, that of their list or the block."""
    numbers = count(1)
    of_block = block.optional("SRSId")
    for points in block.all(f"{kind}s"):
        of_list = points.optional("SRSId") or of_block
        for point in points.all(kind):
            yield next(numbers), point, point.optional("SRSId") or of_list
