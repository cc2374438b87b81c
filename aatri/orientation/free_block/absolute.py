"""Absolute orientation: one similarity from a free component to the ground, from all its control together.

    X = T + s R x + v,      position of an antenna: X = T + s R x0 + R b + v

with x the component's points or projection centres, b the lever arm along the component's axes in metres. Control may
be full, plan only or height only; every coordinate has its role and its standard deviation. Components are deformed;
the deformation tau added to the standard deviation of their points is estimated together with the unknowns, so that
control of 2 cm and positions of 10 cm work together (tied_adjustment: each control point is an unknown ground
point, observed in the component and in the control). Wrong control is found by data snooping.

Start: closed form of at least three full points that are not on a line; otherwise, or where asked for (`two_points`),
the component is levelled by the mean viewing direction of its images and fitted in plan: to all points known in plan,
or to the two that lie farthest apart (the frame tp, geometry.two_point). What control leaves open is found beforehand
and named (datum_analysis).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.rejection import Snooping
from aatri.arrays import Bool, Float
from aatri.errors import GeometryError
from aatri.geometry.similarity import Similarity, compose, robust_closed_form, transform
from aatri.geometry.two_point import two_point_frame
from aatri.ids import shown
from aatri.orientation.free_block.datum_analysis import DatumAnalysis, analyse_datum
from aatri.orientation.free_block.similarity_ties import Similarities, similarities_of, similarity_ties
from aatri.orientation.free_block.tie_records import GivenPoints
from aatri.orientation.free_block.tied_adjustment import TiedResult, adjust_tied

CONTROL_LIMIT = 5.0
"""Test statistic of wrong control; larger than for pure noise, as a component is deformed smoothly."""

COLLINEAR = 0.01
"""Full points count as lying on a line if the ratio of the eigenvalues of their scatter is below this."""


@dataclass(frozen=True)
class Datum:
    """What is known of a component on the ground: control points and observed positions, one row each.

    Attributes
    ----------
    name : (n,) tuple of str
    x : (n, 3) float64, unit of the component
    covariance : (n, 3, 3) float64, unit of the component squared
    offset_m : (n, 3) float64, m
        Lever arm along the component's axes; zero for points.
    xyz_m : (n, 3) float64, m
        On the ground; reduced to an origin near the block.
    covariance_m2 : (n, 3, 3) float64, m^2
        Zero where exact.
    given : (n, 3) bool
        Coordinates that are known.
    n_control : int, optional
        The first rows are control points, the others positions; default: all are control points.
    """

    name: tuple[str, ...]
    x: Float
    covariance: Float
    offset_m: Float
    xyz_m: Float
    covariance_m2: Float
    given: Bool
    n_control: int | None = None


@dataclass(frozen=True)
class OrientedComponent:
    """Result of the absolute orientation of a component.

    Attributes
    ----------
    ground_from_component : Similarity
    residual_m : (n, 3) float64, m
        Component on the ground minus given; NaN where not given.
    active : (n,) bool
        Rows of the datum not rejected.
    analysis : DatumAnalysis
    tied : TiedResult
        The adjustment; its last n observations are the rows of the datum.
    """

    ground_from_component: Similarity
    residual_m: Float
    active: Bool
    analysis: DatumAnalysis
    tied: TiedResult[Similarities]


def orient_component(
    datum: Datum,
    body: Float,
    up: Float,
    *,
    what: str,
    active: Bool | None = None,
    limit: float = CONTROL_LIMIT,
    two_points: bool = False,
) -> OrientedComponent:
    """Orient one component.

    Parameters
    ----------
    datum : Datum
    body : (m, 3) float64, unit of the component
        All points of the component: what the orientation has to carry.
    up : (3,) float64
        Direction against the mean viewing direction of its images, in the component.
    what : str
        The component, for messages.
    active : (n,) bool, optional
        Rows of the datum to begin with; the others are tested for re-admission.
    limit : float
        Test statistic of wrong control.
    two_points : bool
        Start from two points.

    Raises
    ------
    GeometryError
        If something is not determined; the message names it. If the images would look upwards.
    """
    use: Bool = np.asarray(datum.given.any(1))
    if active is not None:
        use = use & active
    rotation, closed = (_levelling(up), None) if two_points else _attitude(datum, up, use)
    _analysed(datum, use, rotation, body, what)
    start = closed if closed is not None else _levelled_start(datum, rotation, use, what, two_points=two_points)
    tied, centre = _adjust(datum, start, use, limit, what)
    n = len(datum.x)
    kept = tied.active[n:] & datum.given.any(1)
    similarity = compose(tied.state[0], Similarity(-centre, 1.0, np.eye(3)))
    if float((similarity.rotation @ up)[2]) < 0:
        raise GeometryError(
            f"{what}: oriented by its control the images look upwards, so the control is mirrored",
            remedy="declare the axes of the control in their true order, [north, east, up] or [east, north, up]",
        )
    # What remains must still determine the component: rejected control does not count.
    analysis = _analysed(datum, kept, similarity.rotation, body, what)
    residual = transform(similarity, datum.x, datum.offset_m) - datum.xyz_m
    return OrientedComponent(similarity, np.where(datum.given, residual, np.nan), tied.active[n:], analysis, tied)


def _analysed(datum: Datum, use: Bool, rotation: Float, body: Float, what: str) -> DatumAnalysis:
    """What the used rows determine, in a levelled frame; an error if that is not all."""
    names = [datum.name[k] for k in np.flatnonzero(use)]
    analysis = analyse_datum(datum.x[use] @ rotation.T, datum.given[use], names, body @ rotation.T)
    if analysis.open or analysis.defect:
        raise GeometryError(_undetermined(datum, use, analysis, what), remedy=_remedy(analysis))
    return analysis


def _attitude(datum: Datum, up: Float, use: Bool) -> tuple[Float, Similarity | None]:
    """Rotation to a levelled frame, and the closed form where full points allow it."""
    full = np.flatnonzero(datum.given.all(1) & use)
    if len(full) >= 3:
        x, X = datum.x[full], datum.xyz_m[full]
        spread = np.linalg.svd(x - x.mean(0), compute_uv=False)
        if spread[1] ** 2 > COLLINEAR * spread[0] ** 2:
            similarity, _ = robust_closed_form(x, X)
            if datum.offset_m[full].any():
                similarity, _ = robust_closed_form(x, X - datum.offset_m[full] @ similarity.rotation.T)
            return similarity.rotation, similarity
    return _levelling(up), None


def _levelling(up: Float) -> Float:
    """The smallest rotation that turns `up` to Z."""
    u = up / np.linalg.norm(up)
    # For u opposite to Z any half turn about a horizontal axis does.
    if u[2] < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    v = np.array([u[0], u[1], u[2] + 1.0])
    return np.asarray(np.diag([-1.0, -1.0, 1.0]) @ (2 * np.outer(v, v) / (v @ v) - np.eye(3)))


def _levelled_start(datum: Datum, rotation: Float, use: Bool, what: str, *, two_points: bool) -> Similarity:
    """Plan similarity of a levelled component by all points or by two, and a mean height."""
    level = datum.x @ rotation.T
    plan = np.flatnonzero(datum.given[:, :2].all(1) & use)
    heights = np.flatnonzero(datum.given[:, 2] & use)
    if len(plan) < 2 or not len(heights):
        raise GeometryError(
            f"{what}: no initial values from {len(plan)} points known in plan and {len(heights)} in height",
            remedy="give two points with X and Y and one with Z",
        )
    if two_points:
        turn, scale, shift = _by_two_points(level[plan], datum.xyz_m[plan])
    else:
        z = level[plan, 0] + 1j * level[plan, 1]
        Z = datum.xyz_m[plan, 0] + 1j * datum.xyz_m[plan, 1]
        dz, dZ = z - z.mean(), Z - Z.mean()
        a = (dZ * dz.conj()).sum() / (abs(dz) ** 2).sum()
        scale, cos, sin = abs(a), a.real / abs(a), a.imag / abs(a)
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        shift = Z.mean() - a * z.mean()
    height = float(np.mean(datum.xyz_m[heights, 2] - scale * level[heights, 2]))
    return Similarity(np.array([shift.real, shift.imag, height]), float(scale), turn @ rotation)


def _by_two_points(level: Float, xyz_m: Float) -> tuple[Float, float, complex]:
    """Rotation about Z, scale and shift in plan from a levelled component to the ground, by its two farthest points.

    By way of tp, which is the levelled component: the ground goes to tp, and back.
    """
    first = int(np.argmax(np.linalg.norm((xyz_m - xyz_m.mean(axis=0))[:, :2], axis=1)))
    second = int(np.argmax(np.linalg.norm((xyz_m - xyz_m[first])[:, :2], axis=1)))
    ends = [first, second]
    north_east = np.column_stack([xyz_m[ends, 1], xyz_m[ends, 0], np.zeros(2)])
    tp = two_point_frame(level[ends] * np.array([1.0, 1.0, 0.0]), north_east)
    corner = tp.to_ground(np.array([[0.0, 0, 0], [1.0, 0, 0]]))[:, [1, 0]]  # east, north of the origin and of X
    along = corner[1] - corner[0]
    scale = float(np.hypot(*along))
    cos, sin = along / scale
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return turn, scale, complex(*corner[0])


def _adjust(
    datum: Datum, start: Similarity, use: Bool, limit: float, what: str
) -> tuple[TiedResult[Similarities], Float]:
    n = len(datum.x)
    centre = datum.x[use].mean(0)
    ties = similarity_ties(
        np.zeros(n, dtype=np.int32), np.arange(n), datum.x - centre, datum.covariance, names=[what], n_points=n,
        offset_m=datum.offset_m,
    )  # fmt: skip
    first = n if datum.n_control is None else datum.n_control
    kinds = {"control": np.arange(first), "position": np.arange(first, n)}
    given = [
        GivenPoints(kind, of, datum.xyz_m[of], datum.covariance_m2[of], datum.given[of])
        for kind, of in kinds.items()
        if len(of)
    ]
    begin = similarities_of([compose(start, Similarity(centre, 1.0, np.eye(3)))])
    active = np.concatenate([np.ones(n, dtype=bool), use])
    what = f"absolute orientation of {what}"
    return adjust_tied(ties, given, begin, Snooping(limit), what=what, active=active), centre


def _counts(datum: Datum, use: Bool) -> str:
    given = datum.given[use]
    full = int(given.all(1).sum())
    plan = int((given[:, :2].all(1) & ~given[:, 2]).sum())
    height = int((given[:, 2] & ~given[:, :2].any(1)).sum())
    return f"{full} known in X, Y and Z, {plan} in plan only, {height} in height only"


def _undetermined(datum: Datum, use: Bool, analysis: DatumAnalysis, what: str) -> str:
    if not datum.given.any():
        return f"{what}: not determined, it holds no control point and no observed position"
    out = [name for name, used, given in zip(datum.name, use, np.asarray(datum.given.any(1))) if given and not used]
    rejected = f"; rejected: {shown(out)}" if out else ""
    open_ = ", ".join(analysis.open) or f"{analysis.defect} of the seven parameters"
    return f"{what}: not determined: {open_} (control and observed positions: {_counts(datum, use)}{rejected})"


def _remedy(analysis: DatumAnalysis) -> str:
    if any("line" in text for text in analysis.open):
        return "add a point with a known height well off that line, or observed positions of images in another strip"
    return "at least two points known in plan and three in height, not on a line, or as many observed positions"
