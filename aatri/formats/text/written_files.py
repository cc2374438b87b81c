"""Files that are written: each whole, or as it was; XML of nested elements, indented, numbers with all their digits."""

import os
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree as ET

from aatri.errors import ResourceError


def write_files(folder: Path, texts: Mapping[str, str | bytes]) -> None:
    """Write files into a folder, which is made if it is not there; each is there whole, or as it was.

    Parameters
    ----------
    texts : mapping of str to str or bytes
        Content by path within the folder.

    Raises
    ------
    ResourceError
        If one cannot be written.
    """
    path = folder
    try:
        for name, content in texts.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            part = path.with_name(f".{path.name}.part")
            with part.open("wb") as file:
                file.write(content if isinstance(content, bytes) else content.encode("utf-8"))
                file.flush()
                os.fsync(file.fileno())  # else a power cut after the renaming leaves an empty file
            part.replace(path)
    except OSError as error:
        raise ResourceError(f"cannot write: {error.strerror}", where=str(path), remedy="another place") from error


def element(tag: str, *content: ET.Element | str | float, **attributes: str | float) -> ET.Element:
    """An element with attributes, and in it a text, a number or elements."""
    made = ET.Element(tag, {name: _text(value) for name, value in attributes.items()})
    for part in content:
        if isinstance(part, ET.Element):
            made.append(part)
        else:
            made.text = _text(part)
    return made


def numbers(tag: str, *values: float) -> ET.Element:
    """An element with numbers between blanks."""
    return element(tag, " ".join(map(_text, values)))


def xml_of(root: ET.Element) -> str:
    """The document of a root element."""
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _text(value: str | float) -> str:
    return value if isinstance(value, str) else repr(int(value) if isinstance(value, int) else float(value))
