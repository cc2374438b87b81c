"""Errors along free strips: heights beside the law of independent errors, and the mean errors along X and Z."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from aatri.arrays import Float
from aatri.artifacts.evaluation import StripErrors
from aatri.report.drawing import svg
from aatri.report.drawing.scales import Axis, tick_text

WIDTH, HEIGHT, PANEL = 760.0, 230.0, 190.0


def growth_chart(errors: StripErrors) -> tuple[Markup, str] | None:
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
    return svg.drawing(WIDTH, HEIGHT, "Errors along free strips", *panels), caption


def _panel(place: int, title: str, n: Float, curves: dict[str, tuple[str, Float]]) -> list[Markup]:
    """One panel: class of the curve to its name and values."""
    left = 50.0 + 252.0 * place
    top, bottom, right = 30.0, HEIGHT - 34, left + PANEL
    values = 1e3 * np.concatenate([v for _, v in curves.values()])
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    across, up = Axis(0.0, float(n[-1]), left, right), Axis(low, max(high, low + 1e-9), bottom, top)
    marks = [svg.text(left, 18, title, "small strong")]
    for value in up.ticks():
        y = float(up.px(value))
        marks += [svg.line(np.array([[left, y], [right, y]]), "axis" if value == 0 else "grid"),
                  svg.text(left - 6, y + 4, tick_text(value), "small", "end")]  # fmt: skip
    for value in across.ticks():
        marks.append(svg.text(float(across.px(value)), bottom + 15, tick_text(value), "small", "middle"))
    marks.append(svg.text(right, bottom + 29, "model n", "small", "end"))
    for row, (class_, (name, v)) in enumerate(curves.items()):
        y = top + 16 * (row + 1)  # errors that only grow leave this corner free
        marks.append(svg.line(np.stack([across.px(n), up.px(1e3 * v)], axis=1), f"curve {class_}"))
        if name:
            marks.append(svg.line(np.array([[left + 8, y - 4], [left + 28, y - 4]]), f"curve {class_}"))
            marks.append(svg.text(left + 34, y, name, "small"))
    return marks
