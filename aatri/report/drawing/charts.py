"""Charts: sigma0 of the stages, convergence, normalised residuals against the normal distribution."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from aatri.arrays import Float
from aatri.report.drawing import svg
from aatri.report.drawing.scales import Axis, log_axis, tick_text

WIDTH, LEFT, RIGHT = 390.0, 135.0, 20.0


def sigma0_chart(sigma0: dict[str, float]) -> tuple[Markup, str] | None:
    """sigma0 of each stage on a logarithmic axis, with the line of 1.

    Parameters
    ----------
    sigma0 : {stage: sigma0}
        Positive values.
    """
    if not sigma0:
        return None
    values = np.array(list(sigma0.values()))
    axis = log_axis(np.append(np.clip(values, 1e-12, 1e12), [0.5, 2.0]), LEFT, WIDTH - RIGHT - 40)
    bottom = 22.0 * len(values) + 14
    unit = float(axis.px(1.0))
    marks = [*_ticks_below(axis, bottom), svg.line(np.array([[unit, 8], [unit, bottom]]), "axis strong-line")]
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


def convergence_chart(cost: Float, decrement: Float) -> tuple[Markup, str] | None:
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
    across = Axis(1.0, float(len(cost)), left, width - 20)
    marks: list[Markup] = []
    for values, class_, name in ((cost, "cost", "cost"), (decrement, "decrement", "Newton decrement")):
        rows = np.isfinite(values) & (values > 0)
        if not rows.any():
            continue
        top, bottom = (14.0, 86.0) if class_ == "cost" else (118.0, height - 30)
        axis = log_axis(values[rows], bottom, top)
        px = np.stack([across.px(steps[rows]), axis.px(values[rows])], axis=1)
        marks += [
            *_ticks_left(axis, left, width - 20),
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


def residual_histogram(normalised: Float) -> tuple[Markup, str] | None:
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
    across = Axis(-limit, limit, 20.0, width - 20)
    up = Axis(0.0, 1.1 * max(float(density.max()), float(normal.max())), height - 26, 12.0)
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


def _ticks_below(axis: Axis, y: float) -> list[Markup]:
    marks = [svg.line(np.array([[axis.start_px, y], [axis.end_px, y]]), "axis")]
    for value in axis.ticks():
        x = float(axis.px(value))
        marks += [
            svg.line(np.array([[x, 8], [x, y]]), "grid"),
            svg.text(x, y + 15, tick_text(value), "small", "middle"),
        ]
    return marks


def _ticks_left(axis: Axis, left: float, right: float) -> list[Markup]:
    marks = []
    ticks = axis.ticks()
    for value in ticks[:: max(1, len(ticks) // 3)]:
        y = float(axis.px(value))
        marks += [
            svg.line(np.array([[left, y], [right, y]]), "grid"),
            svg.text(left - 8, y + 4, tick_text(value), "small", "end"),
        ]
    return marks
