"""XML made of nested elements, indented; numbers with all their digits."""

from xml.etree import ElementTree as ET


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
