"""Pictures of differences at ground points (plan vectors, height bars) and of residuals and errors over the format.

A vector starts at its dot and points in the direction of the difference (solution minus given). The exaggeration is a
round number and is printed, with a vector of round length beside it.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from aatri.arrays import Float
from aatri.artifacts.solution import ErrorFields
from aatri.report.drawing import svg
from aatri.report.drawing.plan import furniture
from aatri.report.drawing.scales import GroundPlan, length_text, near, plan_of, round_below, thinned
from aatri.report.drawing.svg import Picture

MOST_VECTORS = 1500
MOST_FIELDS = 4
MOST_STRIPS = 12
COLOURS = {
    "control": "red",
    "check": "green",
    "moved": "red",
    "stable": "green",
    "next control": "red",
    "planned": "green",
}
CELLS = 12
"""Cells of the image format along each side."""


Vectors = dict[str, tuple[Float, Float]]
"""Places and differences by class, both (n, 3) float64, m; a difference is NaN where a coordinate takes no part."""


def plan_vectors(groups: Vectors, title: str = "Differences", between: str = "solution minus given") -> Picture | None:
    """Differences in X and Y as vectors; None where there is nothing to draw."""
    on_screen = {name: (xyz, d[:, :2] * [1.0, -1.0]) for name, (xyz, d) in groups.items()}
    return _vectors(on_screen, f"{title} in plan, {between}")


def height_bars(groups: Vectors, title: str = "Differences", between: str = "solution minus given") -> Picture | None:
    """Differences in Z as vertical bars, up is too high; None where there is nothing to draw."""
    return bars(groups, f"{title} in height, {between}")


def bars(groups: Vectors, title: str) -> Picture | None:
    """The third coordinates as vertical bars; None where there is nothing to draw."""
    on_screen = {name: (xyz, d[:, [2]] * [0.0, -1.0]) for name, (xyz, d) in groups.items()}
    return _vectors(on_screen, title)


def tie_pictures(strips: Vectors) -> list[Picture]:
    """Tie residuals of each strip in plan and in height: smooth ones are a deformation that is left.

    Parameters
    ----------
    strips : {strip: (xyz_m, residual_m)}
        Both (n, 3) float64, m; the mean of the strips minus the single strip.
    """
    pictures = []
    for name, (xyz, v) in list(strips.items())[:MOST_STRIPS]:
        rms = ", ".join(f"{a} {length_text(float(np.sqrt(np.nanmean(v[:, k] ** 2))))}" for k, a in enumerate("XYZ"))
        more = f" {len(strips) - MOST_STRIPS} more strips are not drawn." if len(strips) > MOST_STRIPS else ""
        words = (f"Tie residuals of strip {name}", "mean of the strips minus this one")
        for made in (plan_vectors({"tie": (xyz, v)}, *words), height_bars({"tie": (xyz, v)}, *words)):
            if made is not None:
                pictures.append((made[0], f"{made[1]} RMS {rms}.{more}"))
    return pictures


def image_vectors(xy_mm: Float, residual_mm: Float) -> Picture | None:
    """Mean image residual in each cell of the format: what is left of systematic errors.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm
        Photo coordinates.
    residual_mm : (n, 2) float64, mm
    """
    if len(xy_mm) < 2:
        return None
    low, high = xy_mm.min(axis=0), xy_mm.max(axis=0)
    cell = np.clip(((xy_mm - low) / np.maximum(high - low, 1e-12) * CELLS).astype(int), 0, CELLS - 1)
    number = cell[:, 0] * CELLS + cell[:, 1]
    count = np.bincount(number, minlength=CELLS**2)
    filled = count > 0
    mean = _cell_means(number, residual_mm, count)[filled]
    place = _cell_means(number, xy_mm, count)[filled]
    picture, exaggeration = _over_format("Mean image residuals", np.stack([low, high]), place, mean, 95.0)
    caption = (
        f"Mean image residuals in {CELLS} x {CELLS} cells, {int(np.median(count[filled]))} points a cell (median); "
        f"the largest is {1e3 * float(np.hypot(*mean.T).max()):.2f} um. Exaggerated {_times(exaggeration)}."
    )
    return picture, caption


def error_field_pictures(fields: ErrorFields) -> list[Picture]:
    """Image errors of the cameras or sessions of a self-calibration, and what is left of them without orientation."""
    pictures = []
    for name in np.unique(fields.object)[:MOST_FIELDS]:
        field = fields.take(fields.object == name)
        sigma = np.sqrt((field.sigma_um**2).sum(axis=1).mean())
        precision = "" if np.isnan(sigma) else f", standard deviation {sigma:.2f} um"
        fits = f"; {len(np.unique(fields.object)) - MOST_FIELDS} more are not drawn"
        more = fits if len(np.unique(fields.object)) > MOST_FIELDS else ""
        for title, what, error_um in (
            ("Image errors", f"all additional parameters together (measured minus ideal){precision}", field.error_um),
            ("Shape of the image errors", "without shift, scale, rotation and tilt of the image", field.shape_um),
        ):
            length = np.hypot(*error_um.T)
            outline = np.stack([field.xy_mm.min(axis=0), field.xy_mm.max(axis=0)])
            picture, exaggeration = _over_format(title, outline, field.xy_mm, 1e-3 * error_um, 98.0)
            caption = (
                f"{title}, {name}: {what}. RMS {np.sqrt((length**2).mean()):.2f} um, the largest "
                f"{length.max():.2f} um. Exaggerated {_times(exaggeration)}{more}."
            )
            pictures.append((picture, caption))
    return pictures


def _over_format(
    title: str, outline_mm: Float, place_mm: Float, vector_mm: Float, percentile: float
) -> tuple[Markup, float]:
    """Vectors over the image format, and their exaggeration; the percentile of their lengths is some 22 pixels."""
    low, high = outline_mm
    plan = plan_of(outline_mm, width=360.0, margin=24.0, most_height=360.0)
    size = float(np.percentile(np.hypot(*vector_mm.T), percentile))
    exaggeration = round_below(22.0 / max(size, 1e-12) / plan.px_per_m)
    px_per_mm = exaggeration * plan.px_per_m
    start = plan.px(place_mm)
    marks = [
        svg.area(plan.px(np.array([low, [high[0], low[1]], high, [low[0], high[1]]])), "frame"),
        svg.segments(start, start + vector_mm * px_per_mm * [1.0, -1.0], "vector image"),
        svg.dots(start, "image"),
        *_key(plan, px_per_mm * 1e3),
    ]
    return svg.drawing(plan.width_px, plan.height_px + 34, title, *marks), exaggeration


def _vectors(groups: Vectors, title: str) -> Picture | None:
    """Vectors in the direction they have on the screen, at their places; far points are counted and not drawn."""
    drawn = {}
    for name, (xyz, v) in groups.items():
        complete = np.isfinite(v).all(axis=1) & np.isfinite(xyz[:, :2]).all(axis=1)
        drawn[name] = (xyz[complete, :2], v[complete])
    places, vectors = (np.concatenate(arrays) for arrays in zip(*drawn.values()))
    if not len(places):
        return None
    largest = float(np.hypot(*vectors.T).max())
    main = near(places)
    plan = plan_of(places[main], width=540.0, margin=52.0, most_height=560.0)
    longest = 50.0 if main.sum() < 300 else 25.0
    typical = float(np.percentile(np.hypot(*vectors[main].T), 98))
    exaggeration = round_below(longest / max(typical, 1e-12) / plan.px_per_m)
    px_per_m = exaggeration * plan.px_per_m
    marks: list[Markup] = []
    notes = []
    for (name, (xy, v)), inside in zip(drawn.items(), np.split(main, np.cumsum([len(xy) for xy, _ in drawn.values()]))):
        xy, v = xy[inside], v[inside]
        rows = thinned(len(xy), MOST_VECTORS)
        start = plan.px(xy[rows])
        marks += [svg.segments(start, start + px_per_m * v[rows], f"vector {name}"), svg.dots(start, name)]
        details = [COLOURS[name]] if name in COLOURS else []
        details += [f"{len(rows)} drawn"] if len(rows) < len(xy) else []
        noun = "images" if name == "position" else f"{name} points"
        notes.append(f"{len(xy)} {noun}" + (f" ({', '.join(details)})" if details else ""))
    marks += [*furniture(plan), *_key(plan, px_per_m)]
    caption = (
        f"{title}, at {', '.join(notes)}; the largest is {length_text(largest)}. Exaggerated {_times(exaggeration)}."
    )
    caption += f" Not drawn: {int((~main).sum())} points that lie far off." if not main.all() else ""
    return svg.drawing(plan.width_px, plan.height_px + 34, title.partition(",")[0], *marks), caption


def _key(plan: GroundPlan, px_per_m: float) -> list[Markup]:
    """A vector of round length."""
    length = round_below(60.0 / px_per_m)
    y, x = plan.height_px + 12, plan.width_px / 2
    end = x + length * px_per_m
    return [
        svg.segments(np.array([[x, y]]), np.array([[end, y]]), "vector ink"),
        svg.dots(np.array([[x, y]]), "ink"),
        svg.text((x + end) / 2, y + 14, _short(length), "small", "middle"),
    ]


def _short(length_m: float) -> str:
    return length_text(length_m) if length_m >= 1e-6 else f"{1e6 * length_m:.1e} um"


def _times(factor: float) -> str:
    return f"{factor:,.0f} times" if factor >= 1 else f"{factor:g} times"


def _cell_means(number: npt.NDArray[Any], values: Float, count: npt.NDArray[Any]) -> Float:
    sums = [np.bincount(number, weights=values[:, k], minlength=len(count)) for k in (0, 1)]
    return np.asarray(np.stack(sums, axis=1) / np.maximum(count, 1)[:, None])
