"""Two calibrations of the same cameras compared: which parameters have changed, by their covariances.

    d = p2 - p1,    C(d) = C1 + C2

Parameters of a camera correlate, c with the heights and x0 with p1, so that a difference of each over its own standard
deviation says little: `congruence` asks of each parameter whether it alone explains the differences of all. Of two that
correlate nearly to 1 one is named, the other one as what explains them as well. Parameters of a set are corrections of
nominal values and of the known distortion, which must be the same in both.
"""

from collections.abc import Sequence

import numpy as np

from aatri.arrays import Bool, Float
from aatri.artifacts.evaluation import Differences, Evaluation, Figures, ParameterChanges
from aatri.artifacts.solution import CalibratedSets, Solution
from aatri.camera.limits import SAME_NOMINAL_MM
from aatri.errors import InputError
from aatri.evaluation.congruence import Congruence, congruence, explain_as_well
from aatri.ids import printable


def compared_calibrations(earlier: Solution, later: Solution, *, level: float) -> Evaluation:
    """Which parameters of cameras have changed.

    Parameters
    ----------
    earlier, later : Solution
        With parameters of cameras or sets, and their covariances.
    level : float
        Probability of a false alarm anywhere.

    Raises
    ------
    InputError
        If they have no determined parameter in common, or correct other nominal values.
    """
    _check_nominal(earlier, later)
    names_1, values_1, C_1 = _determined(earlier)
    names_2, values_2, C_2 = _determined(later)
    common = [name for name in names_1 if name in set(names_2)]
    if not common:
        raise InputError(
            "the calibrations have no determined parameter in common",
            where="ports earlier and solution",
            remedy=f"adjust both with the same set; earlier: {_named(names_1)}; later: {_named(names_2)}",
        )
    at_1, at_2 = [names_1.index(name) for name in common], [names_2.index(name) for name in common]
    d = values_2[at_2] - values_1[at_1]
    C = C_1[np.ix_(at_1, at_1)] + C_2[np.ix_(at_2, at_2)]
    result = congruence(d, C, np.arange(len(d)), level=level)
    sigma = np.array([float(np.sqrt(own[0, 0])) for own in result.covariance])
    table = ParameterChanges(
        object=np.array([name[1] for name in common]),
        name=np.array([name[2] for name in common]),
        moved=result.moved,
        change=result.displacement,
        sigma=sigma,
        difference=d,
        statistic=result.statistics,
        limit=result.limits,
        probability=result.probabilities,
        detectable=result.detectable,
    )
    figures = {
        "compared_parameters": float(len(d)),
        "changed_parameters": float(result.moved.sum()),
        "congruence_statistic": result.statistic,
        "congruence_degrees": float(result.degrees),
        "congruence_probability": result.probability,
    }
    return Evaluation(
        verdict=_verdict(table, result, explain_as_well(d, C, np.arange(len(d)), result.moved, level=level)),
        figures=Figures(name=np.array(list(figures)), value=np.array(list(figures.values()))),
        differences=Differences.empty(),
        parameter_changes=table,
    )


def _determined(solution: Solution) -> tuple[list[tuple[str, str, str]], Float, Float]:
    """Names (group, object, name), values and covariance matrix of the parameters that have covariances."""
    p, c = solution.parameters, solution.parameter_covariances
    if c is None or not len(c):
        return [], np.zeros(0), np.zeros((0, 0))
    rows = np.flatnonzero(np.isfinite(p.sigma) & (p.sigma > 0) & np.isin(np.arange(len(p)), c.first))
    place = np.full(len(p), -1)
    place[rows] = np.arange(len(rows))
    C = np.zeros((len(rows), len(rows)))
    a, b = place[c.first], place[c.second]
    kept = (a >= 0) & (b >= 0)
    C[a[kept], b[kept]] = C[b[kept], a[kept]] = c.covariance[kept]
    return [(str(p.group[k]), str(p.object[k]), str(p.name[k])) for k in rows.tolist()], p.value[rows], C


def _check_nominal(earlier: Solution, later: Solution) -> None:
    """Parameters of the same camera, session or image correct the same nominal values."""
    before, after = (_nominal_mm(solution.calibrated_sets) for solution in (earlier, later))
    for name in before.keys() & after.keys():
        if not np.allclose(before[name], after[name], rtol=0.0, atol=SAME_NOMINAL_MM):
            raise InputError(
                f"{printable(name)} has other nominal values than in the earlier calibration: c, x0, y0, half format "
                f"{_numbers(after[name])} mm, earlier {_numbers(before[name])} mm",
                where="ports earlier and solution",
                remedy="additional parameters correct the nominal camera: give both blocks the same one",
            )
    first, second = (_distortions(solution.calibrated_sets) for solution in (earlier, later))
    for name in sorted(first.keys() & second.keys()):
        if first[name] != second[name]:
            raise InputError(
                f"{printable(name)} has another known distortion than in the earlier calibration: {second[name]}, "
                f"earlier {first[name]}",
                where="ports earlier and solution",
                remedy="additional parameters come on top of it: give both blocks the same distortion, or none",
            )


def _distortions(sets: CalibratedSets | None) -> dict[str, str]:
    """The known distortion of what has a set of its own; nothing of solutions that do not say it."""
    if sets is None or sets.distortion is None:
        return {}
    return dict(zip(sets.object.tolist(), sets.distortion.tolist()))


def _nominal_mm(sets: CalibratedSets | None) -> dict[str, Float]:
    """c, x0, y0 and half format of what has a set of its own."""
    if sets is None:
        return {}
    values = np.column_stack([sets.principal_distance_mm, sets.principal_point_mm, sets.half_format_mm])
    return dict(zip(sets.object.tolist(), values))


def _numbers(values: Float) -> str:
    return ", ".join(f"{v:.6g}" for v in values)


def _verdict(table: ParameterChanges, result: Congruence, as_well: Bool) -> str:
    changed = np.flatnonzero(table.moved)
    if not len(changed):
        rest = f"chi2 {result.statistic:.1f} of {result.degrees} degrees of freedom"
        return f"no parameter of {len(table)} has changed ({rest})"
    order = changed[np.argsort(-table.statistic[changed], kind="stable")]
    named = ", ".join(
        f"{printable(str(table.object[k]))} {table.name[k]} by {table.change[k]:.4g} ({table.sigma[k]:.2g})"
        + "".join(f" or {table.name[other]} instead" for other in np.flatnonzero(as_well[k])[:3])
        for k in order[:5]
    )
    verb = "has" if len(changed) == 1 else "have"
    return f"{len(changed)} of {len(table)} parameters {verb} changed: {named}"


def _named(names: Sequence[tuple[str, str, str]]) -> str:
    return ", ".join(f"{printable(owner)} {name}" for _, owner, name in names[:6]) or "none"
