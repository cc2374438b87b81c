"""Charts: sigma0 of the stages and iterations, distributions, a priori beside a posteriori, errors along strips.

Matrices as pictures: correlations of the parameters of cameras.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.evaluation import StripErrors
from aatri.artifacts.solution import Solution
from aatri.report.drawing.picture import ChartAxis, Marks, Picture

NOTHING = 1e-12
"""What is drawn of a sigma0 of nothing."""

MOST_IN_MATRIX = 60
"""Parameters of a matrix of correlations, the first ones."""

FILM = "film"
"""Group of the parameters of single film images: no matrix has them."""

CORRELATION_LEVELS = (0.1, 0.3, 0.5, 0.7, 0.9, 1.01)
"""Correlations from which on an area of a matrix gets its next darker colour, and the end."""


def sigma0_chart(sigma0: dict[str, float]) -> Picture | None:
    """sigma0 of each stage on a logarithmic axis, with the line of 1.

    Parameters
    ----------
    sigma0 : {stage: sigma0}
        Positive values.
    """
    if not sigma0:
        return None
    values = np.clip(list(sigma0.values()), NOTHING, 1 / NOTHING)
    rows = np.arange(len(values), 0, -1.0)
    across = ChartAxis("sigma0", min(values.min(), 0.5), max(values.max(), 2.0), logarithmic=True)
    up = ChartAxis("", 0.3, len(values) + 0.7, names=dict(zip(rows.tolist(), sigma0)), grid=False)
    places = np.stack([values, rows], axis=1)
    marks = [
        Marks("line", np.array([[1.0, up.low], [1.0, up.high]]), "ink"),
        Marks("segments", np.stack([np.stack([np.ones_like(rows), rows], axis=1), places], axis=1), "blue", width=3.0),
        Marks("dots", places, "blue", width=8.0, ids=list(sigma0), tells=[f"{v:.3g}" for v in sigma0.values()]),
        Marks("texts", places, "ink", ids=[f"{v:.3g}" for v in sigma0.values()]),
    ]
    caption = "sigma0 of each stage: a posteriori over a priori, 1 where the stage's standard deviations are right."
    return Picture("sigma0", "sigma0 of the stages", caption, marks, across, up, height=60 + 24.0 * len(values))


def iterations_chart(solution: Solution) -> Picture | None:
    """sigma0 before every step, and the Newton decrement of the step, on a logarithmic axis."""
    cost, decrement = solution.history.cost, solution.history.decrement
    if len(cost) < 2 or solution.redundancy < 1:
        return None
    sigma0 = np.sqrt(np.maximum(cost, 0.0) / solution.redundancy)
    curves = ((sigma0, "blue", "sigma0 before the step"), (decrement, "violet", "step in standard deviations"))
    marks = []
    for values, colour, name in curves:
        rows = np.flatnonzero(np.isfinite(values) & (values > 0))
        xy = np.stack([rows + 1.0, values[rows]], axis=1)
        tells = [f"{v:.4g}" for v in values[rows].tolist()]
        marks.append(Marks("line", xy, colour, width=1.6))
        marks.append(Marks("dots", xy, colour, name, width=6.0, ids=[f"iteration {k + 1}" for k in rows], tells=tells))
    drawn = np.concatenate([m.xy[:, 1] for m in marks])
    steps = np.arange(1, len(cost) + 1, max(1, len(cost) // 10))
    across = ChartAxis("iteration", 0.8, len(cost) + 0.2, names={float(k): str(k) for k in steps})
    up = ChartAxis("", float(drawn.min()), float(drawn.max()), logarithmic=True)
    caption = (
        "sigma0 of all observations with their weights at each iteration, and how long its step is: the adjustment "
        "has converged where the step no longer matters against the standard deviations."
    )
    return Picture("iterations", "sigma0 per iteration", caption, marks, across, up)


def residual_histogram(normalised: Float) -> Picture | None:
    """Histogram of normalised residuals against N(0, 1).

    Parameters
    ----------
    normalised : (n,) float64
        Residual over its standard deviation.
    """
    if len(normalised) < 10:
        return None
    limit = 5.0
    edges = np.linspace(-limit, limit, 41)
    count, _ = np.histogram(normalised, edges)
    density = count / len(normalised) / (edges[1] - edges[0])
    grid = np.linspace(-limit, limit, 121)
    normal = np.exp(-0.5 * grid**2) / np.sqrt(2 * np.pi)
    beyond = int((np.abs(normalised) > limit).sum())
    ids = [f"{a:.2f} to {b:.2f}" for a, b in pairwise(edges)]
    marks = [
        Marks("areas", columns(edges, density), "blue", "residuals", fill=0.3, ids=ids, tells=[f"{n}" for n in count]),
        Marks("line", np.stack([grid, normal], axis=1), "red", "N(0, 1)", width=1.6),
    ]
    caption = (
        f"Normalised image residuals ({len(normalised):,}) and the curve of N(0, 1): residual over its a priori "
        f"standard deviation times the root of the mean redundancy number. {beyond or 'None'} beyond {limit:g}."
    )
    up = ChartAxis("", 0.0, 1.1 * max(float(density.max()), float(normal.max())))
    title = "Normalised image residuals"
    return Picture(
        "residual_histogram", title, caption, marks, ChartAxis("residual / sigma", -limit, limit, grid=False), up
    )


def columns(edges: Float, heights: Float) -> Float:
    """The columns of a histogram as areas, (n, 4, 2)."""
    low, high = np.broadcast_to(edges[:-1], heights.shape), np.broadcast_to(edges[1:], heights.shape)
    zero = np.zeros(len(heights))
    corners = [np.stack(xy, axis=1) for xy in ((low, zero), (high, zero), (high, heights), (low, heights))]
    return np.asarray(np.stack(corners, axis=1))


def counts_chart(
    name: str, title: str, caption: str, across: str, edges: Float, count: Int, names: dict[float, str] | None = None
) -> Picture:
    """A histogram of counts; `names` are ticks that are not round values."""
    ids = [f"{a:g} to {b:g}" for a, b in pairwise(edges)]
    marks = [
        Marks(
            "areas",
            columns(edges, count.astype(np.float64)),
            "blue",
            fill=0.35,
            ids=ids,
            tells=[f"{n:,}" for n in count],
        )
    ]
    up = ChartAxis("", 0.0, 1.05 * max(float(count.max()), 1.0))
    return Picture(
        name,
        title,
        caption,
        marks,
        ChartAxis(across, edges[0], edges[-1], names=names or {}, grid=False),
        up,
        width=400.0,
    )


def redundancy_chart(solution: Solution) -> Picture | None:
    """How well observations are controlled: the redundancy numbers of image points."""
    residuals, tests = solution.residuals, solution.tests
    if tests is None:
        return None
    r = tests.redundancy[residuals.used("image_point")]
    r = r[np.isfinite(r)]
    if not len(r):
        return None
    caption = (
        f"Redundancy numbers of {len(r):,} image coordinates, {r.mean():.2f} in the mean: the share of an error that "
        "shows in its own residual. What is near 0 controls nothing, and nothing controls it."
    )
    edges = np.linspace(0.0, 1.0, 21)
    count = np.histogram(np.clip(r, 0.0, 1.0), edges)[0]
    return counts_chart("redundancy", "Redundancy numbers", caption, "redundancy number", edges, count)


def groups_chart(groups: Sequence[tuple[str, float, float, float, str]]) -> Picture | None:
    """A priori beside a posteriori: the factor on the standard deviations of every group, with 95 % limits.

    Parameters
    ----------
    groups : sequence of (name, factor, low, high, words)
        Those that are not finite are not drawn.
    """
    groups = [group for group in groups if np.isfinite(group[1:4]).all() and group[1] > 0]
    if not groups:
        return None
    names, factor, low, high, words = zip(*groups)
    at = np.arange(len(groups), 0, -1.0)
    ends = np.stack([np.stack([limit, at], axis=1) for limit in (low, high)], axis=1)
    tells = [f"{f:.3g} ({a:.3g} to {b:.3g}){w}" for f, a, b, w in zip(factor, low, high, words)]
    up = ChartAxis("", 0.3, len(groups) + 0.7, names=dict(zip(at.tolist(), names)), grid=False)
    marks = [
        Marks("line", np.array([[1.0, up.low], [1.0, up.high]]), "ink", "as given"),
        Marks("segments", ends, "blue", "95 % limits", width=2.5),
        Marks("dots", np.stack([factor, at], axis=1), "blue", width=8.0, ids=names, tells=tells),
    ]
    caption = (
        "What the residuals say of the standard deviations given: the factor by which those of a group would have to "
        "be multiplied, with 95 % limits. A bar across 1 is as given."
    )
    across = ChartAxis("a posteriori / a priori", min(*low, 0.7), max(*high, 1.4))
    return Picture("groups", "A priori and a posteriori", caption, marks, across, up, height=70 + 24.0 * len(groups))


def growth_charts(errors: StripErrors) -> list[Picture]:
    """Errors over the number of the model."""
    if len(errors) < 2:
        return []
    caption = (
        f"Errors of {errors.strips[0]} free strips laid on their first model, in thousandths of the first base, at the "
        "n-th model. Independent errors follow the law sigma_b sqrt(n(n+1)(2n+1)/6). An error that all models have in "
        "common stays in the mean and grows as n^2."
    )
    pictures = []
    for name, title, curves in (
        (
            "growth_height",
            "Height along free strips, RMS",
            (("blue", "measured", errors.rms[:, 2]), ("red", "law", errors.law[:, 2])),
        ),
        ("growth_mean_dz", "Mean dZ along free strips", (("blue", "", errors.mean[:, 2]),)),
        ("growth_mean_dx", "Mean dX along free strips", (("violet", "", errors.mean[:, 0]),)),
    ):
        n, values = errors.model.astype(np.float64), 1e3 * np.concatenate([v for *_, v in curves])
        marks = [Marks("line", np.stack([n, 1e3 * v], axis=1), colour, label, 1.6) for colour, label, v in curves]
        up = ChartAxis("", min(float(values.min()), 0.0), max(float(values.max()), float(values.min()) + 1e-9, 0.0))
        pictures.append(Picture(name, title, caption, marks, ChartAxis("model n", 0.0, float(n[-1])), up, width=380.0))
        caption = f"{title}, likewise."
    return pictures


def correlation_pictures(solution: Solution) -> list[Picture]:
    """All correlations between the parameters that were estimated, those of single film images apart."""
    p, c = solution.parameters, solution.parameter_covariances
    if c is None or not len(c):
        return []
    rows = np.flatnonzero((p.group != FILM) & (np.nan_to_num(p.sigma) > 0))
    rows = rows[np.isin(rows, np.concatenate([c.first, c.second]))]
    if len(rows) < 2:
        return []
    place = np.full(len(p), -1)
    place[rows[:MOST_IN_MATRIX]] = np.arange(len(rows[:MOST_IN_MATRIX]))
    n = len(rows[:MOST_IN_MATRIX])
    matrix = np.full((n, n), np.nan)
    inside = (place[c.first] >= 0) & (place[c.second] >= 0)
    i, j = c.first[inside], c.second[inside]
    matrix[place[i], place[j]] = matrix[place[j], place[i]] = c.covariance[inside] / (p.sigma[i] * p.sigma[j])
    several = len(np.unique(p.object[rows])) > 1
    names = [f"{p.object[k]} {p.name[k]}" if several else str(p.name[k]) for k in rows[:MOST_IN_MATRIX]]
    marks = []
    unit = np.array([[0.5, 0.5], [1.5, 0.5], [1.5, 1.5], [0.5, 1.5]])
    for sign, colour, word in ((1, "red", "positive"), (-1, "blue", "negative")):
        for low, high in pairwise(CORRELATION_LEVELS):
            a, b = np.nonzero((sign * matrix >= low) & (sign * matrix < high) & ~np.eye(n, dtype=bool))
            areas = np.stack([b, n - 1 - a], axis=1)[:, None] + unit
            ids = [f"{names[r]} with {names[s]}" for r, s in zip(a, b)]
            tells = [f"{v:.3f}" for v in matrix[a, b]]
            name = f"{word}, {low} or more" if low in (0.5, 0.9) else ""
            marks.append(Marks("areas", areas, colour, name, 0.0, min(low, 0.9), ids=ids, tells=tells))
    across, up = (
        ChartAxis("", 0.5, n + 0.5, names={float(at): name for at, name in zip(order, names)}, grid=False)
        for order in (range(1, n + 1), range(n, 0, -1))
    )
    strongest = np.nan_to_num(np.abs(matrix - np.diag(np.diag(matrix))))
    at, other = divmod(int(strongest.argmax()), n)
    caption = (
        f"Correlations of the {n} parameters: the strongest is {matrix[at, other]:.3f}, {names[at]} with "
        f"{names[other]}. Two parameters near 1 or -1 are known together better than each of them."
    )
    caption += f" The first {MOST_IN_MATRIX} of {len(rows)}." if len(rows) > MOST_IN_MATRIX else ""
    size = 130.0 + 17.0 * n
    title = "Correlations of parameters"
    return [Picture("correlations", title, caption, marks, across, up, width=max(size, 320.0), height=size)]
