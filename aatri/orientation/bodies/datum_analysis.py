"""What control determines of the seven parameters of a free body, and what it leaves open.

A motion z = (shift, rotation, change of scale) displaces the observed coordinates by J z and the points of the body by
J_p z. With N = J'J over the observed coordinates (a row per coordinate) and M the mean of J_p'J_p over the points,

    N z = lambda M z

compares them: a motion that moves the body's points by 1 (RMS) moves the control by sqrt(lambda) in all. So
1 / sqrt(lambda) is by how much errors of control are magnified in the body: the extrapolation factor. Motions with
lambda below `UNDETERMINED` (a factor above 5) count as not determined; control on a line is the usual case. The
measure depends neither on units nor on the choice of parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh

from aatri.arrays import Bool, Float
from aatri.geometry.similarity import Similarity, jacobian

UNDETERMINED = 0.04
NAMED = 0.3
"""A parameter is named if at least this share of it lies in what is not determined."""


@dataclass(frozen=True)
class DatumAnalysis:
    """What is open.

    Attributes
    ----------
    open : tuple of str
        Names of what is not determined; empty if all is.
    defect : int
        Number of independent motions not determined.
    extrapolation : float
        Largest magnification of control errors in the body; infinite with a defect of rank.
    """

    open: tuple[str, ...]
    defect: int
    extrapolation: float


def analyse_datum(
    observed: Float,
    given: Bool,
    names: Sequence[str],
    body: Float,
    *,
    length: Float | None = None,
    turned: int = 0,
    weakest: float = UNDETERMINED,
) -> DatumAnalysis:
    """Find what control leaves open.

    Parameters
    ----------
    observed : (n, 3) float64
        Control points and observed positions in the levelled frame of the body (Z up).
    given : (n, 3) bool
        Coordinates observed.
    names : (n,) sequence of str
    body : (m, 3) float64
        Points of the body in the same frame.
    length : (k,) float64, optional
        Of observed distances in the body: they see the scale.
    turned : int
        How many attitudes are observed: they see the rotation, each like a point at the edge of the body.
    weakest : float
        Motions with a smaller lambda count as not determined.
    """
    # Where heights are known is what the body can still turn about.
    some: Bool = given[:, 2] if given[:, 2].any() else np.asarray(given.any(1))
    centre = observed[some].mean(0) if some.any() else body.mean(0)
    extent = float(np.sqrt(((body - body.mean(0)) ** 2).sum(1).mean()))
    axes, line = _axes(observed[some] - centre, extent)
    J = _design((observed - centre) / extent, axes)[given]
    J = np.concatenate([J, *_relations(np.zeros(0) if length is None else length / extent, turned, axes)])
    J_body = _design((body - centre) / extent, axes).reshape(-1, 7)
    M = J_body.T @ J_body / len(body)
    M += 1e-9 * np.trace(M) * np.eye(7)
    values, vectors = eigh(J.T @ J, M)
    missing = vectors[:, values < weakest]
    smallest = max(float(values[0]), 0.0)
    # Parameters refer to the centre of control, so that a rotation about the line of control is one of them.
    share = np.linalg.norm(np.linalg.qr(missing)[0], axis=1)
    labels = _labels(line, observed - centre, axes, some, names)
    named = tuple(label for label, s in zip(labels, share) if s > NAMED)
    return DatumAnalysis(named, missing.shape[1], 1 / np.sqrt(smallest) if smallest > 1e-12 else float("inf"))


def _axes(reduced: Float, extent: float) -> tuple[Float, bool]:
    """Axes of rotation as columns: along the control's longest extent, across, up; and whether there is a line."""
    if len(reduced) < 2:
        return np.eye(3), False
    _, spread, vt = np.linalg.svd(reduced, full_matrices=False)
    along = vt[0]
    if spread[0] < 1e-6 * extent or abs(along[2]) > 0.7:
        return np.eye(3), False
    across = np.cross([0.0, 0.0, 1.0], along)
    across /= np.linalg.norm(across)
    return np.stack([along, across, np.cross(along, across)], 1), True


def _design(x: Float, axes: Float) -> Float:
    J = jacobian(Similarity(np.zeros(3), 1.0, np.eye(3)), x)
    J[:, :, 3:6] = J[:, :, 3:6] @ axes
    return J


def _relations(length: Float, turned: int, axes: Float) -> tuple[Float, Float]:
    """Rows of distances and of attitudes."""
    scale, turns = np.zeros((len(length), 7)), np.zeros((turned, 3, 7))
    scale[:, 6], turns[:, :, 3:6] = length, axes
    return scale, turns.reshape(-1, 7)


def _labels(line: bool, reduced: Float, axes: Float, some: Bool, names: Sequence[str]) -> list[str]:
    first, second = "tilt about X", "tilt about Y"
    if line:
        along = np.where(some, reduced @ axes[:, 0], np.nan)
        a, b = names[int(np.nanargmin(along))], names[int(np.nanargmax(along))]
        first, second = f"rotation about the line through {a} and {b}", "tilt along that line"
    return ["shift in X", "shift in Y", "height", first, second, "azimuth", "scale"]
