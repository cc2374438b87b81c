"""Points of two epochs with their covariances, compared: what `congruence` needs, and what it says.

Two datums may differ by a movement. Along the columns of H, about the centre of the points and scaled by their extent,

    shift      dX = t
    rigid      dX = t + r x (X - X0)
    similarity dX = t + r x (X - X0) + m (X - X0)

such movements are left out of the comparison: only what changes between the points is seen. A large one is not linear:
the later epoch is laid on the earlier by the closed form over the points that have not moved, and what the columns take
up after that is small.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from aatri.adjustment.statistics.limits import ALARM
from aatri.adjustment.threads import one_blas_thread
from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.evaluation import Differences, Displacements, Evaluation, Figures
from aatri.errors import InputError
from aatri.evaluation.congruence import Congruence, congruence
from aatri.evaluation.limits import LEAST_FOR_ALIGNMENT, SAME_EPOCH
from aatri.geometry.similarity import closed_form, motions
from aatri.ids import printable, shown
from aatri.units import together

DatumMovement = Literal["none", "shift", "rigid", "similarity"]


@dataclass(frozen=True)
class EpochPoints:
    """Points at one epoch."""

    id: Text
    """(n,) str."""
    xyz_m: Float
    """(n, 3), m. NaN where a coordinate is not known."""
    covariance_m2: Float
    """(n, 3, n, 3), m^2."""

    def take(self, rows: Int) -> EpochPoints:
        """The chosen points."""
        return EpochPoints(self.id[rows], self.xyz_m[rows], self.covariance_m2[rows][:, :, rows])


def compared(
    earlier: EpochPoints,
    later: EpochPoints,
    datum: DatumMovement,
    *,
    level: float,
    sigma0: float = 1.0,
    sigma0_degrees: float = np.inf,
    between_m2: Float | None = None,
) -> tuple[Evaluation, tuple[str, ...]]:
    """Which of the common points have moved.

    Parameters
    ----------
    datum : {'none', 'shift', 'rigid', 'similarity'}
        How the datum of one may have moved against that of the other.
    level : float
        Probability of a false alarm anywhere.
    sigma0, sigma0_degrees : float
        See `congruence`.
    between_m2 : (n, 3, n, 3) float64, m^2, optional
        Covariance of earlier by later coordinates where both were adjusted together, of the points as given.

    Returns
    -------
    evaluation : Evaluation
    warnings : tuple of str

    Raises
    ------
    InputError
        If the epochs have no points in common, or lie in different frames.
    GeometryError
        If the common points do not determine the movement of the datum.
    """
    common, of_earlier, of_later = np.intersect1d(earlier.id, later.id, return_indices=True)
    if not len(common):
        raise InputError(
            "the epochs have no point in common",
            where="epochs",
            remedy=f"give points the same ids; the earlier epoch has {shown(earlier.id.tolist(), 5)}, "
            f"the later {shown(later.id.tolist(), 5)}",
        )
    a, b = earlier.take(of_earlier), later.take(of_later)
    cross = None if between_m2 is None else between_m2[of_earlier][:, :, of_later]
    stable = np.ones(len(common), dtype=bool)
    with one_blas_thread():  # the same bits whatever the threads
        for _ in range(MOST_ALIGNMENTS):
            aligned, turned = _laid_on(a, b, cross, stable, datum)
            table, result, exact = _tested(a, aligned, turned, datum, (level, sigma0, sigma0_degrees))
            before, stable = stable, ~np.isin(common, table.point[table.moved])
            if datum in ("none", "shift") or (stable == before).all():
                break
    return _evaluation(table, result, datum), _warnings(result, exact, table, datum)


MOST_ALIGNMENTS = 5
"""Times the epochs are laid on each other by the points that had not moved; two or three are enough."""


def _laid_on(
    a: EpochPoints, b: EpochPoints, cross_m2: Float | None, stable: Bool, datum: DatumMovement
) -> tuple[EpochPoints, Float | None]:
    """The later epoch in the datum of the earlier, and the covariance between both."""
    both = stable & np.isfinite(a.xyz_m).all(axis=1) & np.isfinite(b.xyz_m).all(axis=1)
    if datum in ("none", "shift") or both.sum() < LEAST_FOR_ALIGNMENT:
        _check_frames(a, b)
        return b, cross_m2
    fit = closed_form(b.xyz_m[both], a.xyz_m[both])
    scale = fit.scale if datum == "similarity" else 1.0
    shift = a.xyz_m[both].mean(axis=0) - scale * fit.rotation @ b.xyz_m[both].mean(axis=0)
    M = scale * fit.rotation
    covariance = np.einsum("ij,njml,kl->nimk", M, b.covariance_m2, M)
    laid = EpochPoints(b.id, b.xyz_m @ M.T + shift, covariance)
    _check_frames(a, laid)
    return laid, None if cross_m2 is None else np.einsum("nimk,lk->niml", cross_m2, M)


def _tested(
    a: EpochPoints, b: EpochPoints, cross_m2: Float | None, datum: DatumMovement, test: tuple[float, float, float]
) -> tuple[Displacements, Congruence, Text]:
    """The points of both epochs tested, and the ids of those that are exact at both."""
    d, C = (b.xyz_m - a.xyz_m).ravel(), a.covariance_m2 + b.covariance_m2
    if cross_m2 is not None:
        C = C - cross_m2 - cross_m2.transpose(2, 3, 0, 1)
    C = C.reshape(len(d), len(d))
    tested = np.isfinite(d) & np.isfinite(np.diag(C))
    exact = tested & (np.diag(C) <= 0.0)
    used = np.flatnonzero(tested & ~exact)
    if not len(used):
        raise InputError(
            "the common points have no coordinate with a standard deviation at both epochs",
            where="epochs",
            remedy="give standard deviations, or let the adjustments compute them",
        )
    points, object_of = np.unique(used // 3, return_inverse=True)
    H, (level, sigma0, degrees) = datum_directions(a.xyz_m, datum)[used], test
    C = C[np.ix_(used, used)]
    result = congruence(d[used], C, object_of, H, level=level, sigma0=sigma0, sigma0_degrees=degrees)
    table = _table(a.id[points], a.xyz_m[points], used, points, result)
    return table, result, a.id[np.unique(np.flatnonzero(exact) // 3)]


def datum_directions(xyz_m: Float, datum: DatumMovement) -> Float:
    """H, (3 n, f): movements of the datum about the centre, all of the size of the extent."""
    X = np.where(np.isfinite(xyz_m), xyz_m, np.nanmean(xyz_m, axis=0))
    x = X - X.mean(axis=0)
    x = x / max(float(np.abs(x).max()), 1e-300)
    columns = {"shift": 3, "rigid": 6, "similarity": 7, "none": 0}[datum]
    return motions(x)[:, :, :columns].reshape(3 * len(x), columns)


def _check_frames(a: EpochPoints, b: EpochPoints) -> None:
    d = np.abs(b.xyz_m - a.xyz_m)
    extent = float(np.nanmax(np.ptp(a.xyz_m, axis=0))) if len(d) > 1 else np.inf
    medians = [float(np.median(column[np.isfinite(column)])) if np.isfinite(column).any() else 0.0 for column in d.T]
    axis, typical = int(np.argmax(medians)), max(medians)
    if typical > extent:
        worst = int(np.argmax(np.nan_to_num(d[:, axis])))
        raise InputError(
            f"the epochs lie in different frames: half of the points differ in {'XYZ'[axis]} by {typical:.6g} m or "
            f"more, the points extend over {extent:.6g} m",
            where=f"epochs: point {printable(str(a.id[worst]))}",
            remedy="bring both into one frame, or let one datum move: `datum: similarity`",
        )


def _table(ids: Text, xyz_m: Float, used: Int, object_ids: Int, result: Congruence) -> Displacements:
    n = len(ids)
    displacement, covariance = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    row, axis = np.searchsorted(object_ids, used // 3), used % 3
    displacement[row, axis] = result.displacement
    for k, own in enumerate(result.covariance):
        covariance[k][np.ix_(axis[row == k], axis[row == k])] = own
    return Displacements(
        point=ids,
        xyz_m=xyz_m,
        moved=result.moved,
        displacement_m=displacement,
        covariance_m2=covariance,
        statistic=result.statistics,
        limit=result.limits,
        probability=result.probabilities,
        detectable_m=result.detectable,
    )


def _evaluation(table: Displacements, result: Congruence, datum: str) -> Evaluation:
    moved = np.flatnonzero(table.moved)
    figures = {
        "compared_points": float(len(table)),
        "moved_points": float(len(moved)),
        "congruence_statistic": result.statistic,
        "congruence_degrees": float(result.degrees),
        "congruence_probability": result.probability,
        "stable_statistic": result.stable_statistic,
        "stable_degrees": float(result.stable_degrees),
    }
    length = np.sqrt(np.nansum(table.displacement_m**2, axis=1))
    if len(moved):
        figures["largest_displacement_m"] = float(length[moved].max())
    detectable = table.detectable_m[np.isfinite(table.detectable_m)]
    if len(detectable):
        figures |= {"detectable_median_m": float(np.median(detectable)), "detectable_max_m": float(detectable.max())}
    names = list(figures)
    return Evaluation(
        verdict=_verdict(table, result, datum, length),
        figures=Figures(name=np.array(names), value=np.array([figures[name] for name in names])),
        differences=Differences.empty(),
        displacements=table,
    )


def _verdict(table: Displacements, result: Congruence, datum: str, length_m: Float) -> str:
    laid = "" if datum == "none" else f", one epoch laid on the other by a {datum}"
    rest = f"chi2 {result.stable_statistic:.1f} of {result.stable_degrees} degrees of freedom"
    moved = np.flatnonzero(table.moved)
    if not len(moved):
        return f"none of {len(table)} points has moved ({rest}{laid})"
    first = moved[np.argsort(-table.statistic[moved] / table.limit[moved], kind="stable")][:3]
    named = ", ".join(f"{printable(str(table.point[k]))} by {together([length_m[k]])}" for k in first)
    more = "" if len(moved) <= len(first) else " ..."
    verb = "has" if len(moved) == 1 else "have"
    others = "" if result.stable_degrees == 0 else f"; the others are congruent ({rest}{laid})"
    return f"{len(moved)} of {len(table)} points {verb} moved: {named}{more}{others}"


def _warnings(result: Congruence, exact: Text, table: Displacements, datum: str) -> tuple[str, ...]:
    from scipy.special import chdtrc

    warnings = []
    if len(exact):
        names = shown(exact.tolist(), 5)
        warnings.append(f"points with exact coordinates at both epochs say nothing of movements: left out {names}")
    if not result.tested.all():
        names = shown(table.point[~result.tested].tolist(), 5)
        warnings.append(f"points that the others do not check, as they are needed to lay the epochs together: {names}")
    if datum == "none" and 2 * table.moved.sum() > len(table):
        warnings.append(
            "more than half of the points have moved: the object as a whole, or one epoch stands in another frame or "
            "on other control; `datum: rigid` shows what has moved within it"
        )
    if result.tested.any() and np.nanmax(np.abs(table.displacement_m)) < SAME_EPOCH * np.nanmin(table.detectable_m):
        warnings.append("both epochs have the same coordinates: is it one epoch given twice?")
    if result.stable_degrees > 0 and chdtrc(result.stable_degrees, result.stable_statistic) < ALARM:
        warnings.append(
            f"the points that have not moved differ by more than their standard deviations say: chi2 "
            f"{result.stable_statistic:.1f} of {result.stable_degrees}; all may have moved a little, or standard "
            "deviations are too small: compare sigma0 of both epochs"
        )
    return tuple(warnings)
