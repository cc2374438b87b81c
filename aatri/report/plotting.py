"""Pictures drawn by matplotlib, for papers and other reports: SVG, PNG or PDF with the marks that the page shows."""

import io
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError, SpecError
from aatri.ids import did_you_mean
from aatri.report.drawing.picture import COLOURS, ChartAxis, Marks, Picture
from aatri.report.drawing.scales import length_text, round_below

FORMATS = ("svg", "png", "pdf")
INCHES_PER_PX = 1 / 96
POINTS_PER_PX = 0.75
MOST_LABELS = 200
LEAST_HEIGHT, MOST_HEIGHT = 0.35, 1.4
"""Of the file of a plan, by its width: that of what it shows between these."""
SYMBOLS = {"dots": "o", "triangles": "^", "circles": "o", "crosses": "x"}
SIZE_PX = 9.0
"""Width of triangles, circles and crosses."""


def file_name(picture: Picture, form: str) -> str:
    """A file for a picture: ids of cameras, which are in names, may have any character."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in picture.name) + f".{form}"


def plotted(picture: Picture, form: str) -> bytes:
    """A picture as a file.

    Parameters
    ----------
    form : str
        svg, png or pdf.

    Raises
    ------
    InputError
        If matplotlib is not installed.
    SpecError
        If there is no such format.
    """
    if form not in FORMATS:
        raise SpecError(f"no format {form!r}{did_you_mean(form, FORMATS)}", remedy=f"one of {', '.join(FORMATS)}")
    try:
        import matplotlib
        import matplotlib.image
        from matplotlib.figure import Figure
    except ImportError:
        remedy = "pip install 'aatri[plot]'"
        raise InputError("matplotlib is not installed, which draws the pictures", remedy=remedy) from None
    settings: Any = {"svg.hashsalt": picture.name, "font.size": 8.0, "axes.linewidth": 0.5}
    with matplotlib.rc_context(settings):
        figure = Figure(layout="constrained")
        axes: Any = figure.add_subplot()
        for behind in picture.backdrops:
            pixels = matplotlib.image.imread(io.BytesIO(behind.jpeg), format="jpeg")
            extent = (behind.low[0], behind.high[0], behind.low[1], behind.high[1])
            axes.imshow(pixels, cmap="gray", vmin=0, vmax=255, extent=extent)
        for marks in picture.marks:
            if len(marks.xy):
                _draw(axes, marks)
        if picture.across is not None and picture.up is not None:
            figure.set_size_inches(picture.width * INCHES_PER_PX, picture.height * INCHES_PER_PX)
            _scale(axes.xaxis, axes.set_xlim, axes.set_xscale, picture.across)
            _scale(axes.yaxis, axes.set_ylim, axes.set_yscale, picture.up)
        else:
            west_east, south_north = np.ptp(_places(picture), axis=0)
            share = min(max(south_north / max(west_east, 1e-9), LEAST_HEIGHT), MOST_HEIGHT)
            figure.set_size_inches(*(picture.width * INCHES_PER_PX * np.array([1.0, share])))
            axes.set_aspect("equal", adjustable="datalim")
            axes.set_axis_off()
            _lengths(axes, picture)
        axes.set_title(picture.title)
        if any(m.name for m in picture.marks):
            axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
        file = io.BytesIO()
        dated = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(form, {})
        figure.savefig(file, format=form, dpi=200, metadata=dated)
    return file.getvalue()


def _draw(axes: Any, marks: Marks) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    colour, name = COLOURS[marks.colour], marks.name or None
    width, style = marks.width * POINTS_PER_PX, "--" if marks.dashed else "-"
    x, y = marks.xy[..., 0], marks.xy[..., 1]
    match marks.shape:
        case "line":
            axes.plot(x, y, color=colour, linewidth=width, linestyle=style, label=name)
        case "segments":
            lines = LineCollection(list(marks.xy), colors=colour, linewidths=width, linestyles=style, label=name)
            axes.add_collection(lines)
        case "areas":
            within: Any = (colour, marks.fill)
            areas = PolyCollection(list(marks.xy), edgecolors=colour, facecolors=within, linewidths=width, label=name)
            axes.add_collection(areas)
        case "texts":
            for at, text in zip(marks.xy[:MOST_LABELS], marks.ids):
                axes.annotate(text, at, (4, 4), textcoords="offset points", weight="bold", color=COLOURS["ink"])
        case _:
            hollow = marks.shape in ("triangles", "circles")
            size = (marks.width if marks.shape == "dots" else SIZE_PX) * POINTS_PER_PX
            edge, within = (0.0 if marks.shape == "dots" else width), "none" if hollow else colour
            look = {"linestyle": "none", "markersize": size, "markeredgewidth": edge, "markerfacecolor": within}
            axes.plot(x, y, SYMBOLS[marks.shape], color=colour, label=name, **look)
    if marks.labelled:
        for at, text in zip(marks.xy[:MOST_LABELS], marks.ids):
            axes.annotate(text, at, (4, -2), textcoords="offset points", fontsize=6.0)


def _scale(axis: Any, limits: Any, scale: Any, of: ChartAxis) -> None:
    if of.logarithmic:
        scale("log")
        limits(10 ** np.floor(np.log10(of.low)), 10 ** np.ceil(np.log10(of.high)))
    else:
        limits(of.low, of.high if of.high > of.low else of.low + 1.0)
    if of.names:
        axis.set_ticks(list(of.names), list(of.names.values()))
    if of.names and max(map(len, of.names.values())) > 4 and axis.axis_name == "x":
        axis.set_tick_params(labelrotation=60)
    axis.set_label_text(of.title)
    if of.grid:
        axis.grid(linewidth=0.4, color=COLOURS["line"])


def _places(picture: Picture) -> Float:
    """All places of a plan, (n, 2)."""
    return np.concatenate([m.xy.reshape(-1, 2) for m in picture.marks if len(m.xy)])


def _lengths(axes: Any, picture: Picture) -> None:
    """Bar of the scale and vector of round length, below the plan."""
    axes.autoscale_view()
    places = _places(picture)
    (west, south), (east, north) = places.min(axis=0), places.max(axis=0)
    extent = max(east - west, north - south, 1e-9)
    below = south - 0.06 * extent
    bars = []
    if picture.ground:
        length = round_below(0.25 * max(east - west, 0.2 * extent))
        bars.append((west, length, length_text(length, picture.metric)))
    if picture.key is not None:
        bars.append((0.5 * (west + east), *picture.key))
    for start, length, text in bars:
        axes.plot(
            [start, start + length], [below, below], color=COLOURS["ink"], linewidth=1.0, marker="|", markersize=4
        )
        axes.annotate(text, (start + length / 2, below), (0, -10), textcoords="offset points", ha="center")
