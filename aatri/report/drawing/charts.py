"""Charts: sigma0 of the stages, convergence, residuals against the normal distribution, errors along strips."""

import numpy as np
from markupsafe import Markup

from aatri.arrays import Float
from aatri.artifacts.evaluation import StripErrors
from aatri.report.drawing import svg
from aatri.report.drawing.scales import Scale, log_scale, tick_text
from aatri.report.drawing.svg import Picture

WIDTH, LEFT, RIGHT = 390.0, 135.0, 20.0
STRIPS_WIDTH, STRIPS_HEIGHT, PANEL = 760.0, 230.0, 190.0


def sigma0_chart(sigma0: dict[str, float]) -> Picture | None:
    """sigma0 of each stage on a logarithmic axis, with the line of 1.

    Parameters
    ----------
    sigma0 : {stage: sigma0}
        Positive values.
    """
    if not sigma0:
        return None
    values = np.array(list(sigma0.values()))
    axis = log_scale(np.append(np.clip(values, 1e-12, 1e12), [0.5, 2.0]), LEFT, WIDTH - RIGHT - 40)
    bottom = 22.0 * len(values) + 14
    unit = float(axis.px(1.0))
    base = svg.line(np.array([[axis.start_px, bottom], [axis.end_px, bottom]]), "axis")
    marks = [
        base,
        *_ticks_below(axis, bottom, 8.0),
        svg.line(np.array([[unit, 8], [unit, bottom]]), "axis strong-line"),
    ]
    for row, (name, value) in enumerate(sigma0.items()):
        y = 22.0 * row + 20
        x = float(axis.px(max(value, 1e-12)))
        marks += [
            svg.text(LEFT - 10, y + 4, name, "small", "end"),
            svg.line(np.array([[unit, y], [x, y]]), "bar"),
            svg.dots(np.array([[x, y]]), "mark"),
            svg.text(max(x, unit) + 9, y + 4, f"{value:.3g}", "small"),
        ]
    return (
        svg.drawing(WIDTH, bottom + 24, "sigma0 of the stages", *marks),
        "sigma0 of each stage: a posteriori over a priori, 1 where the stage's standard deviations are right.",
    )


def convergence_chart(cost: Float, decrement: Float) -> Picture | None:
    """Cost and Newton decrement of the iterations on logarithmic axes.

    Parameters
    ----------
    cost : (n,) float64
    decrement : (n,) float64
        NaN where there is none.
    """
    if len(cost) < 2:
        return None
    width, height, left = 360.0, 200.0, 64.0
    steps = np.arange(1, len(cost) + 1)
    across = Scale(1.0, float(len(cost)), left, width - 20)
    marks: list[Markup] = []
    for values, class_, name in ((cost, "cost", "cost"), (decrement, "decrement", "Newton decrement")):
        rows = np.isfinite(values) & (values > 0)
        if not rows.any():
            continue
        top, bottom = (14.0, 86.0) if class_ == "cost" else (118.0, height - 30)
        axis = log_scale(values[rows], bottom, top)
        px = np.stack([across.px(steps[rows]), axis.px(values[rows])], axis=1)
        marks += [
            *_ticks_left(axis, left, width - 20, 3),
            svg.line(px, f"curve {class_}"),
            svg.dots(px, class_),
            svg.text(width - 22, top + 2, name, "small strong", "end"),
        ]
    stride = max(1, len(cost) // 10)
    marks += [svg.text(float(across.px(k)), height - 12, str(k), "small", "middle") for k in steps[::stride]]
    marks.append(svg.text(left - 8, height - 12, "iteration", "small", "end"))
    return svg.drawing(
        width, height, "Convergence", *marks
    ), "Convergence: cost before each step, and Newton decrement."


def residual_histogram(normalised: Float) -> Picture | None:
    """Histogram of normalised residuals against N(0, 1).

    Parameters
    ----------
    normalised : (n,) float64
        Residual over its standard deviation.
    """
    if len(normalised) < 10:
        return None
    width, height, limit = 360.0, 220.0, 5.0
    edges = np.linspace(-limit, limit, 41)
    count, _ = np.histogram(normalised, edges)
    density = count / len(normalised) / (edges[1] - edges[0])
    grid = np.linspace(-limit, limit, 121)
    normal = np.exp(-0.5 * grid**2) / np.sqrt(2 * np.pi)
    across = Scale(-limit, limit, 20.0, width - 20)
    up = Scale(0.0, 1.1 * max(float(density.max()), float(normal.max())), height - 26, 12.0)
    x, base = across.px(edges), float(up.px(0.0))
    steps = np.stack([np.repeat(x, 2)[1:-1], np.repeat(up.px(density), 2)], axis=1)
    outline = np.concatenate([[[x[0], base]], steps, [[x[-1], base]]])
    beyond = int((np.abs(normalised) > limit).sum())
    marks = [
        svg.area(outline, "histogram"),
        svg.line(np.stack([across.px(grid), up.px(normal)], axis=1), "curve normal"),
        svg.line(np.array([[x[0], base], [x[-1], base]]), "axis"),
        *(svg.text(float(across.px(k)), height - 10, f"{k:g}", "small", "middle") for k in range(-5, 6)),
    ]
    caption = (
        f"Normalised image residuals ({len(normalised):,}) and the curve of N(0, 1): residual over its a priori "
        f"standard deviation times the root of the mean redundancy number. {beyond or 'None'} beyond {limit:g}."
    )
    return svg.drawing(width, height, "Normalised image residuals", *marks), caption


def growth_chart(errors: StripErrors) -> Picture | None:
    """Errors over the number of the model, each panel to its own scale."""
    if len(errors) < 2:
        return None
    n = errors.model.astype(np.float64)
    panels = [
        *_panel(0, "height, RMS", n, {"cost": ("measured", errors.rms[:, 2]), "normal": ("law", errors.law[:, 2])}),
        *_panel(1, "mean dZ", n, {"cost": ("", errors.mean[:, 2])}),
        *_panel(2, "mean dX", n, {"decrement": ("", errors.mean[:, 0])}),
    ]
    caption = (
        f"Errors of {errors.strips[0]} free strips laid on their first model, in thousandths of the first base, at the "
        "n-th model; each panel to its own scale. Independent errors follow the law sigma_b sqrt(n(n+1)(2n+1)/6). An "
        "error that all models have in common stays in the mean and grows as n^2."
    )
    return svg.drawing(STRIPS_WIDTH, STRIPS_HEIGHT, "Errors along free strips", *panels), caption


def _panel(place: int, title: str, n: Float, curves: dict[str, tuple[str, Float]]) -> list[Markup]:
    """One panel: class of the curve to its name and values."""
    left = 50.0 + 252.0 * place
    top, bottom, right = 30.0, STRIPS_HEIGHT - 34, left + PANEL
    values = 1e3 * np.concatenate([v for _, v in curves.values()])
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    across, up = Scale(0.0, float(n[-1]), left, right), Scale(low, max(high, low + 1e-9), bottom, top)
    marks = [svg.text(left, 18, title, "small strong")]
    marks += [*_ticks_left(up, left, right), *_ticks_below(across, bottom)]
    marks.append(svg.text(right, bottom + 29, "model n", "small", "end"))
    for row, (class_, (name, v)) in enumerate(curves.items()):
        y = top + 16 * (row + 1)  # errors that only grow leave this corner free
        marks.append(svg.line(np.stack([across.px(n), up.px(1e3 * v)], axis=1), f"curve {class_}"))
        if name:
            marks.append(svg.line(np.array([[left + 8, y - 4], [left + 28, y - 4]]), f"curve {class_}"))
            marks.append(svg.text(left + 34, y, name, "small"))
    return marks


def _ticks_below(scale: Scale, bottom: float, top: float | None = None) -> list[Markup]:
    """Tick values below a chart, with lines of the grid up to `top` if it is given."""
    px = [(float(scale.px(value)), value) for value in scale.ticks()]
    grid = [svg.line(np.array([[x, top], [x, bottom]]), "grid") for x, _ in px if top is not None]
    return [*grid, *(svg.text(x, bottom + 15, tick_text(value), "small", "middle") for x, value in px)]


def _ticks_left(scale: Scale, left: float, right: float, most: int = 6) -> list[Markup]:
    """Tick values left of a chart, at most so many, with lines of the grid; that of zero is an axis."""
    marks = []
    ticks = scale.ticks()
    for value in ticks[:: max(1, len(ticks) // most)]:
        y = float(scale.px(value))
        marks += [
            svg.line(np.array([[left, y], [right, y]]), "axis" if value == 0 else "grid"),
            svg.text(left - 8, y + 4, tick_text(value), "small", "end"),
        ]
    return marks
