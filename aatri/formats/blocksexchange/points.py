"""Control and tie points of BlocksExchange XML with their systems, and the files that hold the tie points.

`TiePoints` may name a file beside it, `.xml` or `.xmlz`: `TiePoint` elements one after the other, without one around
them, as they would stand in `TiePoints`.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from aatri.formats.text.xml_text import xml_text
from aatri.formats.text.xml_tree import XmlElement, read_xml

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
            file = next((f for f in (path.with_name(name), path.with_name(f"{name}z")) if name and f.is_file()), None)
            if file is None:
                absent.append(stated.text)
                continue
            text = DECLARATION.sub("", xml_text(file), count=1)
            points.children += read_xml(file, ("TiePoints",), "tie points", f"<TiePoints>{text}</TiePoints>").children
            files.append(file)
    return files, absent


def system_of(*elements: XmlElement) -> XmlElement | None:
    """The SRSId of the first of some elements that has one: a point, the list it is in, the block."""
    return next((stated for element in elements if (stated := element.optional("SRSId")) is not None), None)


def points_of(block: XmlElement, kind: str) -> Iterator[tuple[int, XmlElement, XmlElement | None]]:
    """Number, point and SRSId of its `ControlPoint`s or `TiePoint`s."""
    of_kind = [(point, points) for points in block.all(f"{kind}s") for point in points.all(kind)]
    for number, (point, points) in enumerate(of_kind, 1):
        yield number, point, system_of(point, points, block)
