"""What observations determine of the seven parameters of a free body, and what they leave open.

A motion z = (shift, rotation, change of scale) changes the observed values by J z and displaces the points of the body
by J_p z. Lengths count as they are, angles as what they move at the edge of the body; unknowns that kinds of
observation have of their own (drifts, orientations of sets) are eliminated from J. With N = J'J and M the mean of
J_p'J_p over the points,

    N z = lambda M z

compares them: a motion that moves the body's points by 1 (RMS) moves what is observed by sqrt(lambda) in all. So
1 / sqrt(lambda) is by how much errors of control are magnified in the body: the extrapolation factor. Motions with
lambda below `UNDETERMINED_MOTION` (a factor above 5) count as not determined; control on a line is the usual case. The
measure depends neither on units nor on the choice of parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import coo_array, csc_array, eye_array
from scipy.sparse.linalg import splu

from aatri.adjusting.added_variance import observed_components
from aatri.adjusting.tied_problem import is_coordinates
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.geometry.similarity import motions, motions_about
from aatri.observations.observed import Observed
from aatri.observations.poses import GENERATORS, POINT, POSE, by_similarity, position
from aatri.orientation.bodies.limits import NAMED_SHARE, UNDETERMINED_MOTION

RIDGE = 1e-12
"""Added to normal equations of unit diagonal, of which some unknowns may be open."""


class OpenDatumError(GeometryError):
    """All observations of a body together leave something open, so that fewer leave it open too."""


@dataclass(frozen=True)
class GivenPlaces:
    """Points and images of which coordinates are observed."""

    kind: np.ndarray
    """(n,) str."""
    name: np.ndarray
    """(n,) str. For messages."""
    xyz: Float
    """(n, 3). Where they are."""
    observed_m: Float
    """(n, 3), m. Where they are observed to be; of the coordinates that are not the place itself."""
    given: Bool
    """(n, 3). Coordinates that are observed."""
    row: Int
    """(n,). Among all observations, kind by kind."""

    def take(self, rows: Int | Bool) -> GivenPlaces:
        """The chosen ones."""
        return GivenPlaces(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


def given_places(observed: Sequence[Observed], state: State) -> GivenPlaces:
    """Given coordinates among observations, at the places of a state."""
    empty = (np.zeros(0, dtype="U1"),) * 2, (np.zeros((0, 3)),) * 2, (np.zeros((0, 3), bool), np.zeros(0, np.int64))
    parts = [tuple(column for columns in empty for column in columns)]
    first = 0
    for o in observed:
        ((group, block), *others) = o.records.touches
        if is_coordinates(o) and group in (POINT, POSE) and not any(g in (POINT, POSE) for g, _ in others):
            place, observed_here = position(state, group)[block], observed_components(o)
            v, (J, *_) = o.records.evaluate(state, np.arange(len(o)))
            target = place - np.einsum("nij,nj->ni", np.linalg.pinv(J[:, :, :3]), v)
            names = [f"image {i}" if i else f"point {p}" for i, p in zip(*o.names(np.arange(len(o))))]
            parts.append(
                (np.full(len(o), o.kind), np.array(names), place, target, observed_here, first + np.arange(len(o)))
            )
        first += len(o)
    return GivenPlaces(*(np.concatenate(columns) for columns in zip(*parts)))


@dataclass(frozen=True)
class DatumAnalysis:
    """What is open."""

    open: tuple[str, ...]
    """Names of what is not determined; empty if all is."""
    motions: Float
    """(7, d). The motions that are not: shift, rotation and change of scale about the origin."""
    extrapolation: float
    """Largest magnification of control errors in the body; infinite with a defect of rank."""


def analyse_datum(
    observed: Sequence[Observed],
    state: State,
    body: Float,
    use: Bool | None = None,
    weakest: float = UNDETERMINED_MOTION,
) -> DatumAnalysis:
    """Find what observations leave open.

    Parameters
    ----------
    observed : sequence of Observed
        Of the body.
    state : State
        Where the body lies on the ground, about.
    body : (m, 3) float64, m
        Points of the body there.
    use : (n,) bool, optional
        Observations that count, kind by kind; default: all.
    weakest : float
        Motions with a smaller lambda count as not determined.
    """
    places = given_places(observed, state)
    places = places if use is None else places.take(use[places.row])
    # Where heights are known is what the body can still turn about.
    is_placed: Bool = places.given[:, 2] if places.given[:, 2].any() else np.asarray(places.given.any(axis=1))
    centre = places.xyz[is_placed].mean(axis=0) if is_placed.any() else body.mean(axis=0)
    extent = float(np.sqrt(((body - body.mean(axis=0)) ** 2).sum(axis=1).mean()))
    axes, line = _axes(places.xyz[is_placed] - centre, extent)
    about_centre = motions_about(centre)
    about_centre[:, :3] *= extent
    about_centre[:, 3:6] = about_centre[:, 3:6] @ axes
    J = _seen(observed, state, use, extent) @ about_centre / extent
    J_body = (motions(body) @ about_centre / extent).reshape(-1, 7)
    M = J_body.T @ J_body / len(body)
    M += 1e-9 * np.trace(M) * np.eye(7)
    values, vectors = eigh(J.T @ J, M)
    missing = vectors[:, values < weakest]
    smallest = max(float(values[0]), 0.0)
    # Parameters refer to the centre of control, so that a rotation about the line of control is one of them.
    share = np.linalg.norm(np.linalg.qr(missing)[0], axis=1)
    labels = _labels(line, places, centre, axes, is_placed)
    names = tuple(label for label, s in zip(labels, share) if s > NAMED_SHARE)
    if missing.shape[1] and not names:
        names = (f"{missing.shape[1]} of the seven parameters",)
    factor = 1 / np.sqrt(smallest) if smallest > 1e-12 else float("inf")
    return DatumAnalysis(names, about_centre @ missing, factor)


def _seen(observed: Sequence[Observed], state: State, use: Bool | None, extent: float) -> Float:
    """What observations see of shift, rotation and change of scale, (k, 7), their own unknowns eliminated."""
    free = {u.name: u.free for o in observed for u in o.unknowns}
    own = list(free)
    seen, parts, k, first = [np.zeros((0, 7))], list[list[Float]](), 0, 0
    for o in observed:
        rows = np.flatnonzero(np.ones(len(o), dtype=bool) if use is None else use[first : first + len(o)])
        counted = np.where(observed_components(o)[rows], 1.0 if o.unit == "m" else extent, 0.0)[:, :, None]
        number, jacobians = k + np.arange(counted.size).reshape(counted.shape), o.records.evaluate(state, rows)[1]
        for (group, block), by_block in zip(o.records.touches, jacobians):
            if group not in GENERATORS:
                at = number, own.index(group), block[rows].astype(np.int64)[:, None, None], np.arange(by_block.shape[2])
                value, *columns_of_rows = np.broadcast_arrays(
                    counted * by_block * free[group][block[rows]][:, None], *at
                )
                parts.append([value.ravel(), *(x.ravel() for x in columns_of_rows)])
        seen.append((counted * by_similarity(o.records, rows, jacobians, state)).reshape(-1, 7))
        k, first = k + counted.size, first + len(o)
    J = np.concatenate(seen)
    if not parts:
        return J
    value, row, *columns_of_rows = (np.concatenate(columns) for columns in zip(*parts))
    column = np.unique(np.stack(columns_of_rows), axis=1, return_inverse=True)[1].ravel()
    size = np.sqrt(np.maximum(np.bincount(column, value**2), 1e-300))
    A = csc_array(coo_array((value / size[column], (row, column)), shape=(k, len(size))))
    normal = csc_array(A.T @ A + RIDGE * eye_array(len(size)))
    return np.asarray(J - A @ splu(normal).solve(A.T @ J))


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


def _labels(line: bool, places: GivenPlaces, centre: Float, axes: Float, is_placed: Bool) -> list[str]:
    first, second = "rotation about X", "rotation about Y"
    if line:
        along = np.where(is_placed, (places.xyz - centre) @ axes[:, 0], np.nan)
        a, b = places.name[int(np.nanargmin(along))], places.name[int(np.nanargmax(along))]
        first, second = f"rotation about the line through {a} and {b}", "tilt along that line"
    return ["shift X", "shift Y", "shift Z", first, second, "rotation about Z", "scale"]
