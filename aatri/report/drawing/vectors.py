"""Differences at points as vectors in plan and bars in height, residuals and errors over the image format.

A vector starts at its dot and points in the direction of the difference (solution minus given). The exaggeration is a
round number and is printed, with a vector of round length beside it.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from aatri.arrays import Bool, Float
from aatri.artifacts.solution import ErrorFields
from aatri.ids import several
from aatri.report.drawing.picture import Marks, Picture, Shape
from aatri.report.drawing.scales import length_text, near, round_below, thinned

MOST_VECTORS = 1500
MOST_FIELDS = 4
MOST_STRIPS = 12
LEFT_OUT = "control left out"
COLOURS = {
    "control": "red",
    LEFT_OUT: "red",
    "check": "green",
    "moved": "red",
    "stable": "green",
    "next control": "red",
    "planned": "green",
    "truth": "violet",
}
NOUNS = {"position": "images", "truth": "new points"}
"""What the places of a class are called, where it is not the class and `points`."""

CELLS = 12
"""Cells of the image format along each side."""

LONGEST = 0.08
"""Of the extent of the picture: so long is a vector that is longer than nearly all; half of it where they are many."""

CUT = 0.25
"""Of the extent: a vector that would be longer, as of control that is left out, is cut short there."""

MANY = 300

ROUNDING_M = 1e-9
"""Differences below are rounding, as at exact control."""

Vectors = Mapping[str, tuple[Float, Float, Sequence[str]]]
"""Places, differences and ids by class, both (n, 3) float64, m; NaN where a coordinate takes no part."""


def plan_vectors(
    name: str, groups: Vectors, title: str = "Differences", between: str = "solution minus given"
) -> Picture | None:
    """Differences in X and Y as vectors; None where there is nothing to draw."""
    return _vectors(
        f"{name}_plan", {k: (xyz, d[:, :2], ids) for k, (xyz, d, ids) in groups.items()}, f"{title} in plan", between
    )


def height_bars(
    name: str, groups: Vectors, title: str = "Differences", between: str = "solution minus given"
) -> Picture | None:
    """Differences in Z as vertical bars, up is too high; None where there is nothing to draw."""
    return bars(f"{name}_height", groups, f"{title} in height", between)


def bars(name: str, groups: Vectors, title: str, between: str = "") -> Picture | None:
    """The third coordinates as vertical bars; None where there is nothing to draw."""
    return _vectors(
        name, {k: (xyz, d[:, [2]] * [0.0, 1.0], ids) for k, (xyz, d, ids) in groups.items()}, title, between
    )


def both(name: str, groups: Vectors, title: str, between: str) -> list[Picture]:
    """Differences in plan and in height."""
    made = (plan_vectors(name, groups, title, between), height_bars(name, groups, title, between))
    return [picture for picture in made if picture is not None]


def tie_pictures(strips: Mapping[str, tuple[Float, Float, Sequence[str]]], hidden: int) -> list[Picture]:
    """Tie residuals of some strips in plan and in height: smooth ones are a deformation that is left.

    Parameters
    ----------
    strips : {strip: (xyz_m, residual_m, ids)}
        (n, 3) float64, m; the mean of the strips minus the single strip.
    hidden : int
        How many more there are.
    """
    pictures = []
    more = f" {several(hidden, 'more strip', 'is', 'are')} not drawn." if hidden else ""
    for name, of_strip in strips.items():
        rms = ", ".join(
            f"{a} {length_text(float(np.sqrt(np.nanmean(of_strip[1][:, k] ** 2))))}" for k, a in enumerate("XYZ")
        )
        words = (f"Tie residuals of strip {name}", f"mean of the strips minus this one. RMS {rms}.{more}")
        pictures += both(f"ties_{name}", {"tie": of_strip}, *words)
    return pictures


def image_vectors(camera: str, xy_mm: Float, residual_mm: Float) -> Picture | None:
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
    place, mean = (
        np.stack([np.bincount(number, v[:, k], CELLS**2) for k in (0, 1)], axis=1)[filled] / count[filled, None]
        for v in (xy_mm, residual_mm)
    )
    caption = (
        f"In {CELLS} x {CELLS} cells, {int(np.median(count[filled]))} points a cell "
        f"(median); the largest is {1e3 * float(np.hypot(*mean.T).max()):.2f} um."
    )
    tells = [
        f"{1e3 * a:.2f}, {1e3 * b:.2f} um from {several(n, 'point')}" for (a, b), n in zip(mean.tolist(), count[filled])
    ]
    title = f"Mean image residuals, {camera}"
    return _over_format(f"residual_field_{camera}", title, caption, np.stack([low, high]), place, mean, 95.0, tells)


def error_field_pictures(fields: ErrorFields) -> list[Picture]:
    """Image errors of the cameras or sessions of a self-calibration, and what is left of them without orientation."""
    pictures = []
    left = len(np.unique(fields.object)) - MOST_FIELDS
    more = f"; {left} more are not drawn" if left > 0 else ""
    for name in np.unique(fields.object)[:MOST_FIELDS]:
        field = fields.take(fields.object == name)
        sigma = np.sqrt((field.sigma_um**2).sum(axis=1).mean())
        precision = "" if np.isnan(sigma) else f", standard deviation {sigma:.2f} um"
        for short, title, what, error_um in (
            (
                "image_errors",
                "Image errors",
                f"all additional parameters together (measured minus ideal){precision}",
                field.error_um,
            ),
            (
                "image_error_shape",
                "Shape of the image errors",
                "without shift, scale, rotation and tilt of the image",
                field.shape_um,
            ),
        ):
            length = np.hypot(*error_um.T)
            outline = np.stack([field.xy_mm.min(axis=0), field.xy_mm.max(axis=0)])
            caption = (
                f"{what[0].upper()}{what[1:]}. RMS {np.sqrt((length**2).mean()):.2f} um, the largest "
                f"{length.max():.2f} um{more}."
            )
            tells = [f"{a:.2f}, {b:.2f} um" for a, b in error_um.tolist()]
            pictures.append(
                _over_format(
                    f"{short}_{name}", f"{title}, {name}", caption, outline, field.xy_mm, 1e-3 * error_um, 98.0, tells
                )
            )
    return pictures


def _over_format(
    name: str,
    title: str,
    caption: str,
    outline_mm: Float,
    place_mm: Float,
    vector_mm: Float,
    percentile: float,
    tells: Sequence[str],
) -> Picture:
    """Vectors over the image format."""
    low, high = outline_mm
    extent = float((high - low).max())
    size = float(np.percentile(np.hypot(*vector_mm.T), percentile))
    exaggeration = round_below(LONGEST * max(extent, 1e-9) / max(size, 1e-12))
    frame = np.array([[low, [high[0], low[1]], high, [low[0], high[1]]]])
    ids = [f"x {x:.1f}, y {y:.1f} mm" for x, y in place_mm.tolist()]
    marks = [
        Marks("areas", frame, "soft"),
        Marks("segments", np.stack([place_mm, place_mm + exaggeration * vector_mm], axis=1), "blue"),
        Marks("dots", place_mm, "blue", width=3.5, ids=ids, tells=tells),
    ]
    length = round_below(0.15 * extent / exaggeration)
    caption = f"{caption} Exaggerated {times(exaggeration)}."
    key = (length * exaggeration, length_text(1e-3 * length))
    return Picture(name, title, caption, marks, key=key, ground=False, width=400.0)


def _vectors(name: str, groups: Vectors, title: str, between: str) -> Picture | None:
    """Vectors (n, 2) at their places; far points are counted and not drawn."""
    by_group = dict[str, tuple[Float, Float, list[str]]]()
    for group, (xyz, v, ids) in groups.items():
        complete: Bool = np.asarray(np.isfinite(np.column_stack([v, xyz[:, :2]])).all(axis=1))
        v = np.where(np.abs(v) < ROUNDING_M, 0.0, v)
        by_group[group] = (xyz[complete, :2], v[complete], [name for name, drawn in zip(ids, complete) if drawn])
    places, vectors = (np.concatenate([pair[k] for pair in by_group.values()]) for k in (0, 1))
    if not len(places):
        return None
    main = near(places)
    extent = max(float(np.ptp(places[main], axis=0).max()), 1e-9)
    used = main & np.repeat([group != LEFT_OUT for group in by_group], [len(pair[0]) for pair in by_group.values()])
    typical = float(np.percentile(np.hypot(*vectors[used if used.any() else main].T), 98))
    longest = LONGEST * extent * (1.0 if main.sum() < MANY else 0.5)
    exaggeration = round_below(longest / max(typical, 1e-12))
    drawn_length = exaggeration * np.hypot(*vectors.T)
    shortened = np.minimum(1.0, CUT * extent / np.maximum(drawn_length, 1e-12))
    marks, notes, before = list[Marks](), [], 0
    for (group, (xy, v, ids)), inside in zip(
        by_group.items(), np.split(main, np.cumsum([len(pair[0]) for pair in by_group.values()]))
    ):
        rows = np.flatnonzero(inside)[thinned(int(inside.sum()), MOST_VECTORS)]
        colour, out = COLOURS.get(group, "blue"), group == LEFT_OUT
        noun = NOUNS.get(group, group if out else f"{group} points")
        ends = np.stack([xy[rows], xy[rows] + (exaggeration * shortened[before + rows])[:, None] * v[rows]], axis=1)
        before += len(xy)
        tells = [
            " ".join(length_text(float(abs(x))) if x >= 0 else f"-{length_text(float(-x))}" for x in one if x)
            for one in v[rows]
        ]
        marks.append(Marks("segments", ends, colour, dashed=out, width=1.3))
        shape: Shape = "crosses" if out else "dots"
        marks.append(
            Marks(
                shape,
                xy[rows],
                colour,
                noun,
                width=2.5 if out else 4.5,
                ids=[ids[k] for k in rows],
                tells=tells,
                labelled=out,
            )
        )
        drawn = f" ({len(rows)} drawn)" if len(rows) < len(xy) else ""
        notes.append(f"{len(xy)} {noun}{drawn}")
    largest = float(np.hypot(*vectors.T).max())
    if largest < ROUNDING_M:
        return Picture(name, title, f"{_begun(between)}{', '.join(notes)}: all are zero.", marks)
    caption = f"{_begun(between)}{', '.join(notes)}; the largest is {length_text(largest)}."
    caption += f" Exaggerated {times(exaggeration)}."
    if not main.all():
        caption += f" Not drawn: {several(int((~main).sum()), 'point', 'that lies', 'that lie')} far off."
    cut = int((shortened[main] < 1).sum())
    caption += f" {cut} longer ones are cut short." if cut > 1 else " A longer one is cut short." if cut else ""
    length = round_below(0.12 * extent / exaggeration)
    key = (length * exaggeration, length_text(length) if length >= 1e-6 else f"{1e6 * length:.1e} um")
    return Picture(name, title, caption, marks, key=key)


def _begun(between: str) -> str:
    return f"{between[0].upper()}{between[1:]}, at " if between else "At "


def times(factor: float) -> str:
    """How many times longer something is drawn."""
    return f"{factor:,.0f} times" if factor >= 1 else f"{factor:g} times"
