"""Film images after their interior orientation by fiducial marks.

Seen: images that could not be used, marks that do not fit, a transformation that is too simple for the film, film that
is deformed by more than film is, scans that are turned against the others, marks that
fit in no image and in all in the same way.
Test: sigma0 of all images pooled, by chi-square, and of single images at the level 0.05 / count; the rest by limits. An
image that cannot be used is left out by name; where more than half cannot, the marks as such are wrong.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from aatri.adapters.interior.film_marks import FilmMarks, misfits
from aatri.adjustment.statistics.global_test import global_test, pooled_test, sigma0_note
from aatri.arrays import Bool, Float
from aatri.artifacts.block import Block
from aatri.checks.finding import Finding, Level
from aatri.checks.limits import FEWEST_ALIKE, LARGEST_SHEAR, TOO_SIMPLE
from aatri.errors import GeometryError
from aatri.ids import several, shown
from aatri.orientation.interior.fiducial_fit import FiducialFit, fewest_marks, fit_fiducials, snooped_fiducials
from aatri.orientation.interior.film_deformation import scales_and_shear, shear_or_stretch, turn_rad


def film(block: Block, marks: FilmMarks, fit: FiducialFit, unusable: Mapping[int, str]) -> list[Finding]:
    """What the marks of the film images show; an error alone where more images are not used than used.

    Parameters
    ----------
    unusable : mapping of int to str
        Rows of the marks, and why their images have no interior orientation.
    """
    reasons = tuple(f"{block.images.id[marks.image[k]]} ({reason})" for k, reason in unusable.items())
    if 2 * len(reasons) > len(marks.image):
        return [_too_many(block, marks, fit, reasons)]
    usable = ~np.isin(np.arange(len(marks.image)), list(unusable))
    return list(_findings(block, marks, fit, usable, reasons))


def _finding(level: Level, text: str, ids: tuple[str, ...] = ()) -> Finding:
    return Finding("film", level, text, ids=ids)


def _too_many(block: Block, marks: FilmMarks, fit: FiducialFit, reasons: tuple[str, ...]) -> Finding:
    fewest = fewest_marks(fit.model)
    text = f"{len(reasons)} of {len(marks.image)} film images have no interior orientation: {shown(reasons)}"
    remedy = (
        f"a transformation that is {fit.model} needs at least {fewest} fiducial marks in every film image, "
        f"{fewest + 1} to check them, well spread; or take a variant of interior_orientation with fewer parameters"
    )
    simple = [finding.sentence for finding in _too_simple(marks)] if fit.model == "similarity" else []
    simple = simple or [finding.sentence for finding in _wrong_calibration(block, marks, fit, fit.determined).values()]
    return Finding("film", "error", text, simple[0] if simple else remedy, error=GeometryError)


def _findings(
    block: Block, marks: FilmMarks, fit: FiducialFit, usable: Bool, reasons: tuple[str, ...]
) -> Iterator[Finding]:
    ids = block.images.id[marks.image]
    if reasons:
        text = f"{several(len(reasons), 'film image', 'is', 'are')} not used, without interior orientation"
        yield _finding("warning", text, reasons)
    if usable.any():
        pooled = pooled_test(fit.sigma0[usable], fit.redundancy[usable])
        note = sigma0_note(pooled, f"of {int(usable.sum())} film images")
        yield _finding(note.level, note.text)
    exact = usable & (fit.redundancy == 0)
    if exact.any():
        count = ("no", "one", "two", "three", "four")[fewest_marks(fit.model)]
        text = f"only {count} fiducial marks, no check of their measurement"
        yield _finding("warning", text, tuple(ids[exact].tolist()))
    # film that shrinks alike in all images does not fit a similarity alike in all: neither marks nor camera are wrong
    simple = list(_too_simple(marks)) if fit.model == "similarity" else []
    calibration = {} if simple else _wrong_calibration(block, marks, fit, usable)
    yield from (*simple, *calibration.values())
    high = misfits(fit, usable) & (not simple) & ~np.isin(block.images.camera[marks.image], list(calibration))
    if high.any():
        named = tuple(f"{i} ({s:.1f})" for i, s in zip(ids[high], fit.sigma0[high]))
        yield _finding("warning", "sigma0 of single images is too large, a mark may be wrong", named)
    rejected = usable[:, None] & marks.present & ~fit.used
    if rejected.any():
        names = block.fiducials.id[block.fiducial_points.fiducial[marks.row[rejected]]]
        named = tuple(f"{i}/{m}" for i, m in zip(ids[np.nonzero(rejected)[0]], names))
        yield _finding("warning", f"{several(len(named), 'fiducial mark', 'is', 'are')} rejected", named)
    linear = fit.photo_from_nominal
    if usable.any():
        yield _deformation(linear[usable])
    skewed = usable & (shear_or_stretch(linear) > LARGEST_SHEAR)
    if skewed.any():
        text = "film deformed by more than 1e-3 (shear or unequal scales)"
        yield _finding("warning", text, tuple(ids[skewed].tolist()))
    yield from _turned_scans(block, marks, linear, usable)


def _too_simple(marks: FilmMarks) -> Iterator[Finding]:
    """Where an affine transformation fits the same marks and a similarity does not, the marks are not to blame."""
    data, size = (marks.measured, marks.calibrated_mm, marks.sigma_mm), np.einsum("nii->ni", marks.nominal)
    affine = snooped_fiducials("affine", *data, marks.present, size)
    simple = fit_fiducials("similarity", *data, affine.used, size)
    of_affine, of_simple = (pooled_test(fit.sigma0, fit.redundancy) for fit in (affine, simple))
    if of_simple.sigma0 > of_simple.high and of_simple.sigma0 > TOO_SIMPLE * of_affine.sigma0:
        text = f"a similarity is too simple for this film: sigma0 {of_simple.sigma0:.2f}, an affine transformation of "
        text += f"the same marks has {of_affine.sigma0:.2f}; not the marks are wrong: use interior_orientation/affine"
        yield _finding("warning", text)


def _wrong_calibration(block: Block, marks: FilmMarks, fit: FiducialFit, usable: Bool) -> dict[int, Finding]:
    """Cameras whose marks have the same residuals in all images: these are not errors of measuring."""
    camera, findings = block.images.camera[marks.image], dict[int, Finding]()
    for one in np.unique(camera[usable & (fit.redundancy > 0)]):
        rows = np.flatnonzero(usable & (fit.redundancy > 0) & (camera == one))
        used = fit.used[rows]
        mark = block.fiducial_points.fiducial[marks.row[rows]][used]
        v = fit.residual_mm[rows][used] / marks.sigma_mm[rows][used]
        names, place, count = np.unique(mark, return_inverse=True, return_counts=True)
        common = np.stack([np.bincount(place, v[:, axis]) for axis in (0, 1)], axis=1) / count[:, None]
        redundancy = int(fit.redundancy[rows].sum())
        left = redundancy - int(fit.redundancy[rows].max())
        if len(rows) < FEWEST_ALIKE or left <= 0:
            continue
        of_all = global_test(float(np.sqrt((v**2).sum() / redundancy)), redundancy)
        without = float(np.sqrt(((v - common[place]) ** 2).sum() / left))
        if of_all.sigma0 > of_all.high and of_all.sigma0 > TOO_SIMPLE * without:
            largest = int(np.argmax((common**2).sum(axis=1)))
            um = 1e3 * fit.residual_mm[rows][used][place == largest].mean(axis=0)
            of_mark = f"mark {block.fiducials.id[names[largest]]} by {um[0]:.0f}, {um[1]:.0f} um"
            text = (
                f"the marks of camera {block.cameras.id[one]} do not fit in the same way in all {len(rows)} images, "
                f"{of_mark}: their calibrated coordinates are wrong or another camera's, not the measured ones "
                f"(sigma0 {of_all.sigma0:.1f}, without what is common {without:.1f}); compare `fiducials` with the "
                "certificate"
            )
            findings[int(one)] = _finding("warning", text)
    return findings


def _deformation(linear: Float) -> Finding:
    scale, shear = scales_and_shear(linear)
    (x0, y0), (x1, y1) = scale.min(axis=0), scale.max(axis=0)
    seconds = np.rad2deg(np.abs(shear).max()) * 3600
    text = f"film: scale in x {x0:.6f} to {x1:.6f}, in y {y0:.6f} to {y1:.6f}, shear up to {seconds:.1f} seconds of arc"
    return _finding("note", text)


def _turned_scans(block: Block, marks: FilmMarks, linear: Float, usable: Bool) -> Iterator[Finding]:
    """A few scans turned by a right angle against the rest may be marks numbered from another corner."""
    angle = turn_rad(linear)
    quarter = np.rint(np.where(usable, angle, 0.0) / (np.pi / 2)).astype(np.int64) % 4
    camera = block.images.camera[marks.image]
    for one in np.unique(camera[usable]):
        of_camera = usable & (camera == one)
        usual = int(np.bincount(quarter[of_camera], minlength=4).argmax())
        turned = of_camera & (quarter != usual)
        if turned.any():
            text = (
                f"turned by right angles against the other images of camera {block.cameras.id[one]}, check that "
                "the fiducial marks are numbered from the same corner"
            )
            yield _finding("warning", text, tuple(block.images.id[marks.image[turned]].tolist()))
