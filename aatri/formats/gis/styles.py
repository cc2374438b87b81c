"""Styles of the layers as QGIS keeps them (QML): one symbol a layer, names beside images and control.

Source: QGIS documentation, appendix A, QML; the table layer_styles of its GeoPackage provider.
"""

from typing import NamedTuple

from aatri.formats.text.xml_writing import element, xml_of


class Symbol(NamedTuple):
    """Kind and class of a symbol of QGIS, its options, and the field that labels it."""

    kind: str
    of: str
    options: dict[str, str]
    label: str = ""


SYMBOLS = {
    "footprints": Symbol("fill", "SimpleFill", {
        "color": "90,140,200,25", "outline_color": "60,100,160,160", "outline_width": "0.2", "style": "solid",
    }),
    "strips": Symbol("line", "SimpleLine", {"line_color": "60,100,160,255", "line_width": "0.4"}, "strip"),
    "ellipses": Symbol("fill", "SimpleFill", {
        "style": "no", "outline_color": "200,60,40,255", "outline_width": "0.2",
    }),
    "points": Symbol("marker", "SimpleMarker", {
        "name": "circle", "color": "120,120,120,255", "size": "0.8", "outline_style": "no",
    }),
    "images": Symbol("marker", "SimpleMarker", {
        "name": "cross", "outline_color": "60,100,160,255", "size": "2",
    }, "image"),
    "control": Symbol("marker", "SimpleMarker", {"name": "triangle", "color": "200,60,40,255", "size": "3"}, "point"),
}  # fmt: skip


def style_of(layer: str) -> str:
    """The QML of a layer."""
    symbol = SYMBOLS[layer]
    options = [element("Option", type="QString", name=name, value=value) for name, value in symbol.options.items()]
    drawn = element(
        "layer", element("Option", *options, type="Map"), **{"class": symbol.of, "enabled": "1", "pass": "0"}
    )
    renderer = element(
        "renderer-v2",
        element("symbols", element("symbol", drawn, type=symbol.kind, name="0", alpha="1")),
        type="singleSymbol",
    )
    parts = [renderer]
    if symbol.label:
        text = element("text-style", fieldName=symbol.label, fontSize="8", textColor="40,40,40,255")
        parts.append(element("labeling", element("settings", text), type="simple"))
    root = element(
        "qgis",
        *parts,
        version="3.28.0",
        styleCategories="Symbology|Labeling",
        labelsEnabled="1" if symbol.label else "0",
    )
    return xml_of(root)
