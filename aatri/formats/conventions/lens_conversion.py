"""A camera in another program's distortion: exactly where its terms are there, else by the best fit, with its misfit.

Exact is a change of names and units within a family, where all terms that are not zero exist on the other side; an
affinity b1 is the same as two focal lengths. Otherwise the parameters, focal lengths and principal point of the target
are estimated from a grid of image points: their rays, by the stated camera, are projected by the other. The rotation
of the image is not touched. The largest distance over the grid is the misfit; beyond `MISFIT_PX` it is refused, for a
twentieth of a pixel is what good targets are measured with.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.camera.models.calibration import INTERIOR
from aatri.errors import InputError
from aatri.formats.conventions.lens import FORMS, Lens, correction
from aatri.formats.limits import MISFIT_PX, OPENINGS
from aatri.progress import SILENT, Reporter

GRID = 25
"""Points along each side of the format: more than the highest power of any radial term in use, on both sides."""

WITHOUT_DISTORTION_READ = "or export image points and camera of undistorted images from the other program"
WITHOUT_DISTORTION_WRITTEN = "or `aatri export` a run without `--measured`: image points and camera without distortion"

OURS = ("none", "bal", "opencv", "fisheye", "brown")
"""Models of aatri, the simpler first."""

GENERAL = ("opencv", "fisheye", "brown", "polynomial")
"""Of these those with the most terms in their family."""


class ConvertedLens(NamedTuple):
    """A camera in another form; `misfit_px` is 0 where the conversion is exact."""

    lens: Lens
    misfit_px: float


def as_our_camera(lens: Lens, reporter: Reporter = SILENT, *, allowed_px: float = MISFIT_PX) -> Lens:
    """A camera in one of aatri's models: the simplest that has all terms of its form, else what represents it best.

    Raises
    ------
    InputError
        If none represents it within `allowed_px`.
    """
    exact = _first_exact(lens, [*(name for name in OURS if _has_place_for(lens, name)), *GENERAL])
    if exact is not None:
        return exact
    fits = [_fitted(lens, name) for name in GENERAL if (name == "fisheye") == (FORMS[lens.form].family == "fisheye")]
    best = min(fits, key=lambda fit: fit.misfit_px)
    tell_misfit(lens, best, reporter, allowed_px, WITHOUT_DISTORTION_READ)
    return best.lens


def as_program_states(
    lens: Lens, forms: Sequence[str], reporter: Reporter = SILENT, *, allowed_px: float = MISFIT_PX
) -> Lens:
    """A camera in a program's form: the first of its forms that has all terms, else the last of the family, fitted.

    Raises
    ------
    InputError
        If that does not represent it within `allowed_px`.
    """
    exact = _first_exact(lens, forms)
    if exact is not None:
        return exact
    fisheye = FORMS[lens.form].family == "fisheye"
    alike = [form for form in forms if (FORMS[form].family == "fisheye") == fisheye]
    fit = _fitted(lens, (alike or list(forms))[-1])
    tell_misfit(lens, fit, reporter, allowed_px, WITHOUT_DISTORTION_WRITTEN)
    return fit.lens


def _first_exact(lens: Lens, forms: Sequence[str]) -> Lens | None:
    return next((exact for form in forms if (exact := _exactly(lens, form)) is not None), None)


def tell_misfit(lens: Lens, fit: ConvertedLens, reporter: Reporter, allowed_px: float, without: str) -> None:
    """Say how well a distortion was fitted; `without` is the way that needs no fit.

    Raises
    ------
    InputError
        If worse than allowed.
    """
    if fit.misfit_px == 0.0:
        return
    what = f"camera {lens.id}: its distortion ({lens.form}) has no exact like; {fit.lens.form} differs by up to"
    text = f"{what} {fit.misfit_px:.3g} px"
    if not fit.misfit_px <= allowed_px:
        allowed = math.ceil(100 * fit.misfit_px) / 100
        remedy = f"`--lens-misfit {allowed:g}` (in a pipeline `lens_misfit_px: {allowed:g}` beside the path) takes it; "
        raise InputError(f"{text}, more than {allowed_px:g} px", where=lens.where, remedy=remedy + without)
    reporter.log(text)


def camera_columns(
    lenses: Sequence[Lens],
    *,
    calibrate: bool = False,
    allowed_px: float = MISFIT_PX,
    reporter: Reporter = SILENT,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Columns of cameras and camera_parameters of a Block, of cameras as programs state them.

    A pixel is as high as two focal lengths say. Image coordinates are from the upper left corner, y down, unless the
    reader says else. Where the cameras are to be calibrated, free are the interior orientation and the parameters that
    the program's form has; without an exact like, all of the fitted model.

    Raises
    ------
    InputError
        If a distortion is none of aatri's within `allowed_px`, or a focal length none of an image of that size.
    """
    for lens in lenses:
        _check_opening(lens)
    ours = [as_our_camera(lens, reporter, allowed_px=allowed_px) for lens in lenses]
    focal = np.array([lens.focal_px for lens in ours])
    width_mm = np.array([lens.pixel_mm for lens in ours])
    pixel_mm = width_mm[:, None] * np.stack([np.ones(len(ours)), focal[:, 0] / focal[:, 1]], axis=1)
    rows = [row for pair in zip(lenses, ours) for row in _parameter_rows(*pair)]
    of_camera, name, value, free = zip(*rows)
    is_free = np.array(free) & calibrate
    cameras = {
        "id": [lens.id for lens in ours],
        "pixel_size_mm": pixel_mm,
        "pixel_origin": "top-left-corner",
        "pixel_y": "down",
        "format": np.array([lens.size_px for lens in ours], dtype=np.float64),
        "principal_distance_mm": focal[:, 0] * width_mm,
        "principal_point_mm": np.array([lens.principal_point_px for lens in ours]) * pixel_mm * [1.0, -1.0],
        "distortion": [lens.form for lens in ours],
    }
    sigma = np.where(is_free, np.nan, 0.0)
    return cameras, {"camera": of_camera, "name": name, "value": value, "free": is_free, "sigma": sigma}


def camera_parts(
    lenses: Sequence[Lens], reporter: Reporter = SILENT, *, allowed_px: float = MISFIT_PX
) -> dict[str, Any]:
    """The same for the parts of a Block: distortion parameters that each program knows, neither held nor free.

    Raises
    ------
    InputError
        If a distortion is none of aatri's within `allowed_px`.
    """
    if not lenses:
        return {}
    cameras, every = camera_columns(lenses, calibrate=True, allowed_px=allowed_px, reporter=reporter)
    rows = zip(every["camera"], every["name"], every["value"], every["free"])
    kept = [row[:3] for row in rows if row[3] and row[1] not in INTERIOR]
    parameters = dict(zip(("camera", "name", "value"), zip(*kept))) if kept else {}
    return {"cameras": cameras, "camera_parameters": parameters}


def _check_opening(lens: Lens) -> None:
    least, most = (share * max(lens.size_px) for share in OPENINGS)
    if not least <= lens.focal_px[0] <= most:
        what = f"camera {lens.id}: a focal length of {lens.focal_px[0]:g} px for an image {max(lens.size_px):g} px long"
        raise InputError(what, where=lens.where, remedy="give both in px: is it in mm, or divided by the image's size?")


def _parameter_rows(stated: Lens, ours: Lens) -> list[tuple[str, str, float, bool]]:
    """Camera, name, value, and whether the program knows it, for each parameter of our model."""
    terms = FORMS[ours.form].terms
    fitted = not _has_place_for(stated, ours.form)
    estimated_names = _names(terms.values()) if fitted else _names(FORMS[stated.form].terms.values())
    rows = [
        (ours.id, name, ours.parameters.get(name, 0.0), term.name in estimated_names) for name, term in terms.items()
    ]
    off_centre = FORMS[stated.form].principal_point
    return rows + [(ours.id, name, np.nan, off_centre or name == INTERIOR[0]) for name in INTERIOR]


def _has_place_for(lens: Lens, form: str) -> bool:
    """Whether a form has all terms of the program's form, zero or not: then they can be calibrated in it."""
    source, target = FORMS[lens.form], FORMS[form]
    return source.family == target.family and _names(source.terms.values()) - {"b1"} <= _names(target.terms.values())


def _names(terms: Iterable[Any]) -> set[str]:
    return {term.name for term in terms}


def _exactly(lens: Lens, form: str) -> Lens | None:
    """The camera in another form without any loss, or None."""
    source, target = FORMS[lens.form], FORMS[form]
    terms = lens.terms()
    (fx, fy), centred = lens.focal_px, not any(lens.centre_px)
    simple = all(value == 0 for name, value in terms.items() if name not in ("b1", "b2"))
    if source.family != target.family and not (
        simple and not terms.get("b2") and {source.family, target.family} == {"polynomial", "correction"}
    ):
        return None
    if source.family == "polynomial" and "b1" in terms:  # an affinity after the distortion is a focal length
        fx, b1 = fx * (1 + terms["b1"]), terms.pop("b1")
        terms["b2"] = terms.get("b2", 0.0) / (1 + b1)
    if target.focal_lengths == 1 and fx != fy:
        if target.family != "polynomial" or "b1" not in _names(target.terms.values()):
            return None
        terms["b1"], terms["b2"], fx = fx / fy - 1, terms.get("b2", 0.0) * fx / fy, fy
    absent = {name for name, value in terms.items() if value} - _names(target.terms.values())
    if (
        absent
        or not (centred or target.own_centre or simple)
        or (any(lens.principal_point_px) and not target.principal_point)
    ):
        return None
    return _with_terms(replace(lens, form=form, focal_px=(fx, fy)), terms)


def _with_terms(lens: Lens, terms: Mapping[str, float]) -> Lens:
    """A camera with its parameters from the terms of its family."""
    f = lens.unit_per_focal()
    parameters = {name: t.sign * terms.get(t.name, 0.0) / f**t.power for name, t in FORMS[lens.form].terms.items()}
    return replace(lens, parameters=parameters)


def _fitted(lens: Lens, form: str) -> ConvertedLens:
    """The camera of another form that projects the rays of an image grid best."""
    from scipy.optimize import least_squares  # its import takes a quarter of a second

    target = FORMS[form]
    half = np.array(lens.size_px) / 2
    across, down = (np.linspace(-h, h, GRID) for h in half)
    xy_px = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    uv = lens.ideal(xy_px)
    stated = lens.terms()
    start = [
        stated.get(t.name, 0.0) if FORMS[lens.form].family == target.family else 0.0 for t in target.terms.values()
    ]
    interior = [*lens.focal_px[: target.focal_lengths], *(lens.principal_point_px if target.principal_point else ())]
    scale = max(interior[: target.focal_lengths])

    def lens_of(x: Float) -> Lens:
        k = len(interior)
        focal, point = x[: target.focal_lengths] * scale, x[target.focal_lengths : k] * scale
        terms = {t.name: value for t, value in zip(target.terms.values(), x[k:].tolist())}
        at = replace(
            lens,
            form=form,
            centre_px=(0.0, 0.0),
            parameters={},
            focal_px=(float(focal[0]), float(focal[-1])),
            principal_point_px=(float(point[0]), float(point[1])) if target.principal_point else (0.0, 0.0),
        )
        return _with_terms(at, terms)

    def misfit(x: Float) -> Float:
        other = lens_of(x)
        if target.family == "correction":  # compared where it is linear in its parameters, in px of the ideal image
            distorted = (xy_px - other.principal_point_px) / other.focal_px
            return np.asarray(((distorted + correction(distorted, other.terms()) - uv) * other.focal_px).ravel())
        return np.asarray((other.projected(uv) - xy_px).ravel())

    solved = least_squares(
        misfit,
        np.array([*np.array(interior) / scale, *start]),
        method="lm",
        x_scale="jac",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=200 * (len(start) + len(interior)),
    )
    fit = lens_of(solved.x)
    return ConvertedLens(fit, float(np.linalg.norm(fit.projected(uv) - xy_px, axis=1).max()))
