"""Matrices as pictures: correlations of the parameters of cameras."""

from itertools import pairwise

import numpy as np

from aatri.artifacts.solution import Solution
from aatri.report.drawing.picture import ChartAxis, Marks, Picture

MOST = 60
"""Parameters of a matrix."""

FILM = "film"
LEVELS = (0.1, 0.3, 0.5, 0.7, 0.9, 1.01)


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
    place[rows[:MOST]] = np.arange(len(rows[:MOST]))
    n = len(rows[:MOST])
    matrix = np.full((n, n), np.nan)
    inside = (place[c.first] >= 0) & (place[c.second] >= 0)
    i, j = c.first[inside], c.second[inside]
    matrix[place[i], place[j]] = matrix[place[j], place[i]] = c.covariance[inside] / (p.sigma[i] * p.sigma[j])
    several = len(np.unique(p.object[rows])) > 1
    names = [f"{p.object[k]} {p.name[k]}" if several else str(p.name[k]) for k in rows[:MOST]]
    marks = []
    unit = np.array([[0.5, 0.5], [1.5, 0.5], [1.5, 1.5], [0.5, 1.5]])
    for sign, colour, word in ((1, "red", "positive"), (-1, "blue", "negative")):
        for low, high in pairwise(LEVELS):
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
    caption += f" The first {MOST} of {len(rows)}." if len(rows) > MOST else ""
    size = 130.0 + 17.0 * n
    title = "Correlations of parameters"
    return [Picture("correlations", title, caption, marks, across, up, width=max(size, 320.0), height=size)]
