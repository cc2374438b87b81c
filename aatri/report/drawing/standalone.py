"""A picture as an SVG file of its own: with its title, legend and light colours, for documents and notebooks."""

import textwrap

import jinja2
from markupsafe import Markup

from aatri.report.drawing.picture import COLOURS, Picture
from aatri.report.drawing.svg import element, parts_of, sample, text

LETTER_PX, TITLE_LETTER_PX, ENTRY_PX, ROW_PX = 6.4, 7.6, 34.0, 18.0
"""Room of a letter, of one in the title, of what stands around an entry of the legend, of a row."""


def standalone(picture: Picture) -> str:
    """The text of the file; hovering and what it needs are the page's, not the file's."""
    marks, furniture, height = parts_of(picture, tells=False)
    title = textwrap.wrap(picture.title, int(picture.width / TITLE_LETTER_PX))
    top = ROW_PX * len(title) + 8.0
    x, y, entries = 8.0, top + height + 4.0, list[Markup]()
    for m in picture.marks:
        if m.name and len(m.xy):
            room = LETTER_PX * len(m.name) + ENTRY_PX
            if x > 8.0 and x + room > picture.width:
                x, y = 8.0, y + ROW_PX
            entries += [sample(m, x, y), text(x + 20.0, y + 10.0, m.name)]
            x += room
    height_px = y + ROW_PX if entries else y
    return element(
        "svg",
        element("title", picture.title),
        element("style", Markup(_rules())),  # ours
        element("rect", width=picture.width, height=height_px, class_="paper"),
        *(text(8.0, ROW_PX * (k + 1), words, "title") for k, words in enumerate(title)),
        element("g", *marks, *furniture, transform=f"translate(0 {top:g})"),
        *entries,
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {picture.width:g} {height_px:g}",
        width=picture.width,
        height=height_px,
        role="img",
    )


def _rules() -> str:
    """The rules of the page for pictures, with the colours of paper."""
    environment = jinja2.Environment(loader=jinja2.PackageLoader("aatri.report"), autoescape=True)
    rules = environment.get_template("picture.css").render(colours=list(COLOURS))
    for name, colour in {**COLOURS, "panel": "#f5f7f9"}.items():
        rules = rules.replace(f"var(--{name})", colour)
    return f"{rules}svg .paper {{ fill: #f5f7f9; }} svg .title {{ font-size: 13px; font-weight: 600; }}"
