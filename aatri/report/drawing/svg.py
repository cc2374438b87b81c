"""Pictures as inline SVG: what the marks of a picture are as paths, with its axes, legend, labels and scales.

Pixels, origin top left, y down. Marks of one kind are one path, so that a picture of thousands of points stays small.
Every mark begins with an absolute M at its place: the page's script reads the places back from there, to tell what the
pointer is at, and draws large pictures on a canvas.
"""

import base64
from collections.abc import Mapping

import numpy as np
from markupsafe import Markup, escape

from aatri.arrays import Float
from aatri.report.drawing.labels import Labels
from aatri.report.drawing.picture import Backdrop, ChartAxis, Marks, Picture
from aatri.report.drawing.scales import GroundPlan, Scale, length_text, log_scale, plan_of, round_below, tick_text

MANY = 6000
"""Marks from which on the script draws on a canvas."""

MOST_LABELS = 300
"""Of one kind of marks."""

NOTHING: Mapping[str, object] = {}

SIZE = 5.0
"""Half the width of triangles, circles and crosses, px."""

LEFT, RIGHT, TOP, BOTTOM = 58.0, 16.0, 12.0, 42.0
"""Room around a chart, px."""


def element(name: str, *children: str, **attributes: object) -> Markup:
    """An element; `class_` is class, other underscores become hyphens. Children that are not markup are escaped."""
    listed = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(f"{value:g}" if isinstance(value, float) else str(value))}"'
        for key, value in attributes.items()
        if value != "" and value is not None
    )
    return Markup(f"<{name}{listed}>{''.join(escape(child) for child in children)}</{name}>")


def drawn(picture: Picture) -> Markup:
    """A picture with its legend as an element of the page."""
    shown = [m for m in picture.marks if len(m.xy)]
    marks, furniture, height = parts_of(picture)
    plan = _ground_plan(picture) if picture.across is None and picture.ground and shown else None
    corner = (plan.west_m, plan.north_m, plan.left_px, plan.top_px, plan.px_per_m) if plan else ()
    many = sum(len(m.xy) for m in shown if m.shape != "line") > MANY
    image = element(
        "svg",
        element("title", picture.title),
        element("g", *marks, class_="marks"),
        element("g", *furniture, class_="furniture"),
        viewBox=f"0 0 {picture.width:g} {height:g}",
        role="img",
        width=picture.width,
        data_at=" ".join(f"{value:.12g}" for value in corner),
        class_=("plan" if picture.across is None else "chart") + (" many" if many else ""),
    )
    samples = [
        element("li", element("svg", sample(m), viewBox="0 0 16 12", width=16, height=12), f" {m.name}")
        for m in shown
        if m.name
    ]
    legend = element("ul", *samples, class_="legend") if samples else Markup("")
    return element("div", image, legend, class_="picture", data_name=picture.name)


def parts_of(picture: Picture, *, tells: bool = True) -> tuple[list[Markup], list[Markup], float]:
    """The marks of a picture, what stands around them, and its height; `tells`: with what the pointer is told."""
    shown = [m for m in picture.marks if len(m.xy)]
    return (_plan if picture.across is None else _chart)(picture, shown, tells)


def sample(marks: Marks, x: float = 0.0, y: float = 0.0) -> Markup:
    """A mark of a kind for the legend, 16 by 12 px from a corner."""
    place = np.array([[8.0, 6.0]])
    if marks.shape == "segments":
        place = np.array([[[1.0, 6.0], [15.0, 6.0]]])
    elif marks.shape == "line":
        place = np.array([[1.0, 6.0], [15.0, 6.0]])
    elif marks.shape == "areas":
        place = np.array([[[2.0, 2.0], [14.0, 2.0], [14.0, 10.0], [2.0, 10.0]]])
    return _path(marks, place + np.array([x, y]), 4.5)


def _path(marks: Marks, px: Float, size: float = SIZE, more: Mapping[str, object] = NOTHING) -> Markup:
    """The marks as one path."""
    match marks.shape:
        case "dots":
            d = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in px.tolist())
        case "triangles":
            shape = f"m0 {-size:g}l{size:g} {1.7 * size:g}h{-2 * size:g}Z"
            d = "".join(f"M{x:.1f} {y:.1f}{shape}" for x, y in px.tolist())
        case "circles":
            shape = f"m{-size:g} 0a{size:g} {size:g} 0 1 0 {2 * size:g} 0a{size:g} {size:g} 0 1 0 {-2 * size:g} 0Z"
            d = "".join(f"M{x:.1f} {y:.1f}{shape}" for x, y in px.tolist())
        case "crosses":
            shape = f"m{-size:g} {-size:g}l{2 * size:g} {2 * size:g}m{-2 * size:g} 0l{2 * size:g} {-2 * size:g}"
            d = "".join(f"M{x:.1f} {y:.1f}{shape}" for x, y in px.tolist())
        case "segments":
            d = "".join(f"M{a:.1f} {b:.1f}L{c:.1f} {e:.1f}" for (a, b), (c, e) in px.tolist())
        case "areas":
            d = "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in corners) + "Z" for corners in px.tolist())
        case _:
            d = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in px.tolist())
    filled = {"fill_opacity": marks.fill} if marks.fill else {}
    classes = [marks.colour, *(["filled"] if marks.fill else []), *(["dots"] if marks.shape == "dots" else [])]
    classes += ["dashed"] if marks.dashed else []
    return element("path", d=d, class_=" ".join(classes), stroke_width=float(marks.width), **filled, **more)


def _paths(marks: list[Marks], px: list[Float], tells: bool) -> list[Markup]:
    """A path for each kind of marks, with what the pointer is told if `tells`."""
    paths = []
    for m, at in zip(marks, px):
        if m.shape == "texts":
            continue
        more: dict[str, object] = {}
        if m.shape != "line" and tells:
            more = {"data_ids": "\n".join(m.ids), "data_tells": "\n".join(m.tells), "data_shape": m.shape}
        if m.seen_from and tells:
            more["data_seen"] = ";".join(",".join(str(k) for k in images) for images in m.seen_from)
        if m.sees and tells:
            more["data_sees"] = "1"
        paths.append(_path(m, at, more=more))
    return paths


def _labels(marks: list[Marks], px: list[Float], width: float, height: float) -> list[Markup]:
    """Ids beside their marks, as far as there is room; texts before all others."""
    places, written = Labels(width, height), list[Markup]()
    for m, at in zip(marks, px):
        if m.labelled:
            places.keep_free(at[:MOST_LABELS], 4.0)
    for m, at in sorted(zip(marks, px), key=lambda one: one[0].shape != "texts"):
        if m.shape == "texts" or m.labelled:
            class_ = "strong label" if m.shape == "texts" else "label"
            room = places.around(at[:MOST_LABELS], m.ids[:MOST_LABELS])
            written += [text(x, y, content, class_, anchor) for x, y, anchor, content in room]
    return written


def _ground_plan(picture: Picture) -> GroundPlan:
    """The scale and place of a plan."""
    return plan_of(np.concatenate([m.xy.reshape(-1, 2) for m in picture.marks if len(m.xy)]), width=picture.width)


def _plan(picture: Picture, marks: list[Marks], tells: bool) -> tuple[list[Markup], list[Markup], float]:
    plan = _ground_plan(picture)
    px = [plan.px(m.xy.reshape(-1, 2)).reshape(m.xy.shape) for m in marks]
    furniture = [*(_bar_and_north(plan, picture.metric) if picture.ground else []), *_key(picture, plan)]
    height = plan.height_px + (34.0 if furniture else 0.0)
    behind = [_photograph(backdrop, plan) for backdrop in picture.backdrops]
    labels = _labels(marks, px, plan.width_px, plan.height_px)
    return [*behind, *_paths(marks, px, tells), *labels], furniture, height


def _photograph(backdrop: Backdrop, plan: GroundPlan) -> Markup:
    (left, top), (right, bottom) = plan.px(
        np.array([[backdrop.low[0], backdrop.high[1]], [backdrop.high[0], backdrop.low[1]]])
    )
    data = base64.b64encode(backdrop.jpeg).decode()
    return element(
        "image",
        href=f"data:image/jpeg;base64,{data}",
        x=float(left),
        y=float(top),
        width=float(right - left),
        height=float(bottom - top),
        preserveAspectRatio="none",
    )


def _bar_and_north(plan: GroundPlan, metric: bool) -> list[Markup]:
    length = round_below(0.25 * plan.width_px / plan.px_per_m)
    x, y = 30.0, plan.height_px + 12
    end = x + length * plan.px_per_m
    north = np.array([[plan.width_px - 24, y + 8], [plan.width_px - 24, y - 14]])
    head = north[1] + np.array([[0.0, -4.0], [4.0, 6.0], [-4.0, 6.0]])
    return [
        _path(Marks("line", np.zeros((0, 2)), "soft"), np.array([[x, y - 5], [x, y], [end, y], [end, y - 5]])),
        text((x + end) / 2, y + 14, length_text(length, metric), "scale", "middle", data_length=length),
        _path(Marks("line", np.zeros((0, 2)), "soft"), north),
        _path(Marks("areas", np.zeros((0, 2)), "ink", fill=1.0), head[None]),
        text(plan.width_px - 34, y + 4, "N", "", "end"),
    ]


def _key(picture: Picture, plan: GroundPlan) -> list[Markup]:
    """A vector of round length."""
    if picture.key is None:
        return []
    length, meaning = picture.key
    y, x = plan.height_px + 12, plan.width_px / 2
    end = x + length * plan.px_per_m
    line = Marks("segments", np.zeros((0, 2)), "ink", width=1.4)
    return [
        _path(line, np.array([[[x, y], [end, y]]])),
        _path(Marks("dots", np.zeros((0, 2)), "ink", width=4.0), np.array([[x, y]])),
        text((x + end) / 2, y + 14, meaning, "key", "middle"),
    ]


def _chart(picture: Picture, marks: list[Marks], tells: bool) -> tuple[list[Markup], list[Markup], float]:
    assert picture.across is not None
    assert picture.up is not None
    longest = max([len(name) for name in picture.up.names.values()], default=0)
    below = max([len(name) for name in picture.across.names.values()], default=0)
    slanted = below > 4
    left, bottom = max(LEFT, 7.0 * longest + 16), BOTTOM + (4.6 * below if slanted else 0.0)
    across = scale_of(picture.across, left, picture.width - RIGHT)
    up = scale_of(picture.up, picture.height - bottom, TOP)
    px = [np.stack([across.px(m.xy[..., 0]), up.px(m.xy[..., 1])], axis=-1) for m in marks]
    foot, end = picture.height - bottom, picture.width - RIGHT
    lines, texts = [], []
    for at, name in _ticks(picture.up, up):
        if picture.up.grid:
            lines.append(_path(Marks("line", np.zeros((0, 2)), "line"), np.array([[left, at], [end, at]])))
        texts.append(text(left - 7, at + 4, name, "", "end"))
    for at, name in _ticks(picture.across, across):
        if picture.across.grid:
            lines.append(_path(Marks("line", np.zeros((0, 2)), "line"), np.array([[at, TOP], [at, foot]])))
        turn = f"rotate(-40 {at:.1f} {foot + 14:.1f})" if slanted else ""
        texts.append(text(at, foot + 15, name, "", "end" if slanted else "middle", transform=turn))
    base = _path(Marks("line", np.zeros((0, 2)), "soft"), np.array([[left, foot], [end, foot]]))
    texts.append(text((left + end) / 2, picture.height - 6, picture.across.title, "", "middle"))
    if picture.up.title:
        middle = (TOP + foot) / 2
        texts.append(text(13, middle, picture.up.title, "", "middle", transform=f"rotate(-90 13 {middle:.1f})"))
    labels = _labels(marks, px, picture.width, picture.height)
    return [*lines, base, *_paths(marks, px, tells), *labels], texts, picture.height


def scale_of(axis: ChartAxis, start_px: float, end_px: float) -> Scale:
    """From values of an axis to pixels."""
    if axis.logarithmic:
        return log_scale(np.array([axis.low, axis.high]), start_px, end_px)
    return Scale(axis.low, axis.high if axis.high > axis.low else axis.low + 1.0, start_px, end_px)


def _ticks(axis: ChartAxis, scale: Scale) -> list[tuple[float, str]]:
    if axis.names:
        return [(float(scale.px(value)), name) for value, name in axis.names.items()]
    return [(float(scale.px(value)), tick_text(value)) for value in scale.ticks()]


def text(x: float, y: float, content: str, class_: str = "", anchor: str = "start", **more: object) -> Markup:
    """A line of text."""
    return element("text", content, x=f"{x:.1f}", y=f"{y:.1f}", class_=class_, text_anchor=anchor, **more)
