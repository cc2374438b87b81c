"""Inline SVG: elements as escaped text, and the few marks the pictures are made of.

Pixels, origin top left, y down. Many marks of one kind are one path, so that a picture of thousands of points stays
small. Colours come from the page's style by class name.
"""

from markupsafe import Markup, escape

from aatri.arrays import Float

Picture = tuple[Markup, str]
"""A picture and its caption."""


def element(name: str, *children: str, **attributes: object) -> Markup:
    """An element; `class_` is class, other underscores become hyphens. Children that are not markup are escaped."""
    listed = "".join(f' {_attribute(key)}="{escape(_value(value))}"' for key, value in attributes.items())
    return Markup(f"<{name}{listed}>{''.join(escape(child) for child in children)}</{name}>")


def drawing(width: float, height: float, label: str, *children: str) -> Markup:
    """A picture with a label for those who do not see it."""
    return element(
        "svg", element("title", label), *children, viewBox=f"0 0 {width:g} {height:g}", role="img", width=f"{width:g}"
    )


def dots(xy: Float, class_: str) -> Markup:
    """Round dots at points (n, 2), sized by the style's stroke width."""
    return element("path", d="".join(f"M{x:.1f} {y:.1f}h0" for x, y in xy), class_=f"dots {class_}")


def segments(start: Float, end: Float, class_: str) -> Markup:
    """Straight lines from points (n, 2) to points (n, 2)."""
    d = "".join(f"M{a:.1f} {b:.1f}L{c:.1f} {e:.1f}" for (a, b), (c, e) in zip(start, end))
    return element("path", d=d, class_=class_)


def line(points: Float, class_: str) -> Markup:
    """One line through points (n, 2)."""
    return element("path", d="M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points), class_=class_)


def area(points: Float, class_: str) -> Markup:
    """A closed polygon with corners (n, 2)."""
    return element("path", d="M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) + "Z", class_=class_)


def triangles(xy: Float, class_: str, size: float = 5.0) -> Markup:
    """Upright triangles around points (n, 2); `size` is half their width."""
    corners = f"l{size:g} {1.7 * size:g}h{-2 * size:g}Z"
    return element("path", d="".join(f"M{x:.1f} {y - size:.1f}{corners}" for x, y in xy), class_=class_)


def circles(xy: Float, class_: str, radius: float = 5.0) -> Markup:
    """Circles around points (n, 2)."""
    half = f"a{radius:g} {radius:g} 0 1 0"
    d = "".join(f"M{x - radius:.1f} {y:.1f}{half} {2 * radius:g} 0{half} {-2 * radius:g} 0Z" for x, y in xy)
    return element("path", d=d, class_=class_)


def text(x: float, y: float, content: str, class_: str = "", anchor: str = "start") -> Markup:
    """A line of text."""
    return element("text", content, x=f"{x:.1f}", y=f"{y:.1f}", class_=class_, text_anchor=anchor)


def _attribute(key: str) -> str:
    return key.rstrip("_").replace("_", "-")


def _value(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
