"""How errors grow along free strips: simulated strips laid on the truth by their first model alone.

    X_n - X_0 = s R x_n + e_n,      s, R from the first base and the attitude of the first image

e_n is the error at the right projection centre of the n-th model, in units of the first base; the error of the
attitude there is log(R R_n true'). Independent errors of the models add up (A601) as d1 + ... + dn in the attitude,

    sigma sqrt(n),

and twice, n d1 + (n - 1) d2 + ... + dn, in the place:

    sigma_b sqrt(n (n + 1)(2n + 1) / 6),    about sigma_b n^1.5 / sqrt(3).

sigma and sigma_b are fitted to the root mean squares of all n. An error that all models have in common (A602) adds up
to n in the attitude and n^2 in the place: not the root mean square alone but the mean shows it.

Source: lecture notes A601, A602.
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.evaluation import Differences, Evaluation, Figures, StripErrors
from aatri.artifacts.strips import Strips
from aatri.evaluation.limits import FIRST_OF_GROWTH
from aatri.geometry.rotations import log_rotation


def free_strip_errors(strips: Strips, position_m: Float, ground_from_image: Float) -> Evaluation:
    """Errors of all free strips by number of the model, beside the laws of their growth.

    Parameters
    ----------
    position_m : (n_images, 3) float64, m
        True projection centres, Cartesian.
    ground_from_image : (n_images, 3, 3) float64
        True rotations.
    """
    table = strip_errors(strips, position_m, ground_from_image)
    n, height = table.model, table.rms[:, 2]
    figures = {
        "free_strips_models": float(n[-1]),
        **{f"strip_end_rms_{a}_bases": float(table.rms[-1, i]) for i, a in enumerate("xyz")},
        **{f"strip_end_mean_{a}_bases": float(table.mean[-1, i]) for i, a in enumerate("xyz")},
    }
    words = f"free strips laid on their first model: after {n[-1]} models heights are off by {1e3 * height[-1]:.3g} "
    words += f"thousandths of a base (RMS of {table.strips[-1]})"
    long_enough = (n >= FIRST_OF_GROWTH) & (height > 0)
    if long_enough.sum() > 2:
        growth = float(np.polyfit(np.log(n[long_enough]), np.log(height[long_enough]), 1)[0])
        figures["strip_height_growth"] = growth
        words += f"; they grow as n^{growth:.2f} (errors of single models 1.5, an error common to all 2)"
    names = list(figures)
    return Evaluation(
        verdict=words,
        figures=Figures(name=np.array(names), value=np.array([figures[name] for name in names])),
        differences=Differences.empty(),
        strip_errors=table,
    )


def strip_errors(strips: Strips, position_m: Float, ground_from_image: Float) -> StripErrors:
    """The table: by number of the model, over all strips that reach so far. See `free_strip_errors`."""
    place, turned = list[Float](), list[Float]()
    for strip in range(len(strips.strips)):
        rows = np.flatnonzero(strips.strip_images.strip == strip)
        image = strips.strip_images.image[rows]
        e, w = _on_first_model(strips, rows, position_m[image], ground_from_image[image])
        place.append(e)
        turned.append(w)
    longest = max(map(len, place))
    n = np.arange(1, longest + 1)
    reach = [[k for k, e in enumerate(place) if len(e) >= m] for m in n]
    X, W = ([np.array([values[k][m - 1] for k in rows]) for m, rows in zip(n, reach)] for values in (place, turned))
    rms, turned_rad = _rms(X), _rms(W)
    return StripErrors(
        model=n.astype(np.int32),
        strips=np.array([len(rows) for rows in reach], dtype=np.int32),
        mean=np.array([x.mean(axis=0) for x in X]),
        rms=rms,
        law=_fitted(np.sqrt(n * (n + 1) * (2 * n + 1) / 6), rms),
        turned_rad=turned_rad,
        turned_law_rad=_fitted(np.sqrt(n), turned_rad),
    )


def _on_first_model(strips: Strips, rows: Int, X: Float, R: Float) -> tuple[Float, Float]:
    """Errors of place, first bases, and attitude, rad, (n, 3) of a strip's models."""
    images = strips.strip_images
    base = float(np.linalg.norm(X[1] - X[0]))
    turn = R[0] @ images.strip_from_image[rows[0]].T
    x = (images.position[rows] - images.position[rows[0]]) @ turn.T
    x /= np.linalg.norm(x[1])
    angle = log_rotation(turn @ images.strip_from_image[rows] @ R.swapaxes(1, 2))
    return np.asarray(x - (X - X[0]) / base)[1:], angle[1:]


def _rms(values: list[Float]) -> Float:
    return np.array([np.sqrt((x**2).mean(axis=0)) for x in values])


def _fitted(law: Float, values: Float) -> Float:
    """The law times the factor that fits it to the values, column by column."""
    return np.asarray(law[:, None] * (law @ values / (law @ law)))
