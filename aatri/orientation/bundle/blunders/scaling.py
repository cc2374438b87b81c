"""Standard deviations that fit the residuals, class by class, before anything is rejected.

A class is a kind of observation, its plan and height where they are measured apart, the image points of each camera,
the groups that the tables name, and an image or a strip whose points err by more than others' (`noisy_images`). Its
scale is estimated robustly (`adjustment.statistics.class_scales`). Where it contradicts the standard deviations given,
these times the scale are those of the search and of the result: its weights, covariances, tests and sigma0. All others
stay as given.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aatri.adjusting.adjusted_observations import classes_of
from aatri.adjustment.covariance.score import score
from aatri.adjustment.statistics.class_scales import ClassScales, class_scales, may_differ, small_class_scale
from aatri.adjustment.statistics.limits import ESTIMABLE_REDUNDANCY, MATTERS, SILENT_REDUNDANCY
from aatri.adjustment.statistics.long_tails import Tail, tail_of
from aatri.arrays import Bool, Float, Int
from aatri.notes import Note
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.observed import Observed, full_whitener
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput, ImageGroups
from aatri.orientation.bundle.blunders.limits import APART, FINEST_RAD, MOST_TOGETHER, NO_ERRORS, NOISY, NOISY_STRIP
from aatri.orientation.bundle.blunders.noisy_images import ASKED, is_of_images
from aatri.orientation.bundle.blunders.tested_block import (
    is_prior,
    largest_gain_beside,
    residuals_and_redundancy,
    residuals_beside,
)
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.variance_groups import with_factor

SETTLED = 1.1
"""A scale in use that changes by less than this factor stays."""


@dataclass(frozen=True)
class Classes:
    """Classes of observations."""

    names: tuple[str, ...]
    kind: Int
    """(g,) int64. Number of the kind that each class belongs to."""
    number: tuple[Int, ...]
    """Tuple of (n, m) int32. Class of every component of each of the observations; -1 none."""
    images: tuple[tuple[int, ...], ...] = ()
    """Sets of images, of a strip say, that have classes of their own."""
    part_of: tuple[int, ...] = ()
    """Of the last classes, which are those of images, the class of other images' points."""
    least: tuple[float, ...] = ()
    """How much larger than theirs its standard deviations are at least."""
    no_errors: tuple[float, ...] = ()
    """Of all but the last classes, the scale below which it is one without errors."""

    @classmethod
    def of(cls, block: BundleInput) -> Classes:
        """The classes of a block."""
        names, kinds, number, no_errors = list[str](), list[int](), list[Int](), list[float]()
        numbers: dict[tuple[str, int], int] = {}  # a set of correlated ones is a kind of its own
        finest = FINEST_RAD / block.rays.sigma_rad if block.rays is not None and block.rays.sigma_rad else NO_ERRORS
        for place, o in enumerate(block.observed):
            if not (o.is_measured and len(o)):
                number.append(np.broadcast_to(np.int32(-1), (len(o), o.records.rows)))
                continue
            classes, of_components = classes_of(o, *_labels(o, block.images))
            number.append((len(names) + of_components).astype(np.int32))
            names += classes
            no_errors += [min(NO_ERRORS, finest) if o.kind == IMAGE_POINT else NO_ERRORS] * len(classes)
            kinds += [numbers.setdefault((o.kind, -1 if o.set_rows is None else place), len(numbers))] * len(classes)
        return cls(tuple(names), np.array(kinds, dtype=np.int64), tuple(number), no_errors=tuple(no_errors))

    @property
    def base(self) -> Int:
        """Class of which each is a part, (g,): itself but for those of images."""
        return np.array([*range(len(self.names) - len(self.part_of)), *self.part_of], dtype=np.int64)

    @property
    def at_least(self) -> Float:
        """How much larger than those of its base the standard deviations of each class are at least, (g,)."""
        return np.array([*np.ones(len(self.names) - len(self.part_of)), *self.least])

    @property
    def of_image(self) -> Bool:
        """Classes of images, (g,)."""
        return np.arange(len(self.names)) >= len(self.names) - len(self.part_of)

    def with_images(self, observed: tuple[Observed, ...], images: Int, name: str) -> Classes:
        """With classes of their own for some images."""
        names, kind, number, part_of = list(self.names), self.kind, list(self.number), list(self.part_of)
        least = NOISY if len(images) == 1 else NOISY_STRIP
        for i, o in enumerate(observed):
            rows = np.isin(dict(o.records.touches)[POSE], images) if is_of_images(o) else np.zeros(len(o), dtype=bool)
            for k in np.unique(number[i][rows]).tolist():
                number[i] = np.where(rows[:, None] & (number[i] == k), np.int32(len(names)), number[i])
                kind, part_of = np.append(kind, kind[k]), [*part_of, k]
                names.append(f"{names[k]} of {name}")
        all_images = (*self.images, tuple(images.tolist()))
        least_of = (*self.least, *[least] * (len(part_of) - len(self.part_of)))
        return Classes(tuple(names), kind, tuple(number), all_images, tuple(part_of), least_of, self.no_errors)

    def scales(self, result: BundleResult, least_squares: BundleResult | None = None) -> ClassScales:
        """Scales of all classes from the residuals of what is used.

        Parameters
        ----------
        least_squares : BundleResult, optional
            The adjustment whose covariances are known, where `result` has none.
        """
        v, r, group = self.residuals(result, least_squares)
        return self._pooled_by_kind(class_scales(v, r, group, len(self.names)), v, r, group)

    def in_small_kinds(self, scales: ClassScales) -> Bool:
        """Classes of kinds of too little redundancy, (g,)."""
        return np.asarray(np.bincount(self.kind, scales.redundancy)[self.kind] < ESTIMABLE_REDUNDANCY)

    def of_small_kinds(self, scales: ClassScales, result: BundleResult, of: int | None = None) -> ClassScales:
        """Scales with those of kinds of too little redundancy, or of one, which residuals tell by their cofactors."""
        scale, redundancy, estimable = scales.scale.copy(), scales.redundancy.copy(), scales.estimable.copy()
        for kind in np.unique(self.kind[self.in_small_kinds(scales)]) if result.adjusted.has_factor else ():
            if of not in (None, kind):
                continue
            kind_classes = np.flatnonzero(self.kind == kind)
            parts = [(i, number) for i, number in enumerate(self.number) if np.isin(number, kind_classes).any()]
            if len(parts) == 1 and np.isfinite(result.observations[parts[0][0]].covariance).any():
                s, r = _scale_together(result, *parts[0])
                scale[kind_classes], redundancy[kind_classes], estimable[kind_classes] = s, r, s != 1.0
        return ClassScales(scale, redundancy, estimable, estimable & ~scales.estimable)

    def tails(self, result: BundleResult, limit: float) -> tuple[Tail, ...]:
        """Tails of the errors of all classes, from the residuals of what is used or predicted."""
        v, r, group = self.residuals(result, None, predicted=True)
        controlled = r > SILENT_REDUNDANCY
        return tuple(
            tail_of(np.abs(v[in_class]) / np.sqrt(r[in_class]), limit)
            for in_class in (controlled & (group == g) for g in range(len(self.names)))
        )

    def residuals(
        self, result: BundleResult, least_squares: BundleResult | None, *, predicted: bool = False
    ) -> tuple[Float, Float, Int]:
        """Whitened residuals, redundancy numbers and classes of all components in use, and of predicted ones."""
        measured = [(i, o) for i, o in enumerate(result.observations) if o.observed.is_measured]
        rows = [o.rows if predicted else np.flatnonzero(o.used) for _, o in measured]
        last = np.cumsum([0, *(len(k) * o.observed.records.rows for k, (_, o) in zip(rows, measured))])
        v, r, group = np.empty(last[-1]), np.empty(last[-1]), np.empty(last[-1], dtype=np.int32)
        for (i, _), chosen, here in zip(measured, rows, map(slice, last[:-1], last[1:])):
            if len(chosen):
                v[here], r[here] = (values.ravel() for values in residuals_beside(result, least_squares, i, chosen))
                group[here] = np.where(r[here] > 0, self.number[i][chosen].ravel(), -1)
        return v, r, group

    def _pooled_by_kind(self, scales: ClassScales, v: Float, r: Float, group: Int) -> ClassScales:
        """Parts, cameras and groups of little redundancy have the scale of their kind."""
        scale, redundancy, estimable = scales.scale.copy(), scales.redundancy.copy(), scales.estimable.copy()
        for kind in np.unique(self.kind[~scales.estimable]):
            kind_classes = np.flatnonzero(self.kind == kind)
            if len(kind_classes) < 2 or scales.redundancy[kind_classes].sum() < ESTIMABLE_REDUNDANCY:
                continue
            pooled = class_scales(v, r, np.where(np.isin(group, kind_classes), 0, -1), 1)
            small = kind_classes[~scales.estimable[kind_classes] & ~self.of_image[kind_classes]]
            scale[small], redundancy[small], estimable[small] = pooled.scale, pooled.redundancy, pooled.estimable
        return ClassScales(scale, redundancy, estimable)

    def with_factors(self, observed: tuple[Observed, ...], factor: Float) -> tuple[Observed, ...]:
        """Observations with standard deviations times the factor of their class, (g,).

        What is known of film, cameras and mounts beforehand keeps its own; weights of additional parameters are none.
        """
        return tuple(o if is_prior(o) else with_factor(o, number, factor) for o, number in zip(observed, self.number))


def _scale_together(result: BundleResult, place: int, number: Int) -> tuple[float, float]:
    """Scale of a kind, and its redundancy with it, from the cofactors of all of its residuals."""
    observations = result.observations[place]
    records, rows = observations.observed.records, np.flatnonzero(observations.used)
    used = (records.observed_components()[rows] & (number[rows] >= 0)).ravel()
    if not 1 < used.sum() <= MOST_TOGETHER:
        return 1.0, 0.0
    record = np.repeat(np.arange(len(rows)), records.rows)[used]
    v, _ = residuals_and_redundancy(observations, result.adjusted.state, rows)
    r = 1.0 - np.einsum("nii->ni", observations.covariance[rows])
    r = np.maximum(r, np.finfo(float).eps)  # however little controls them; below it is rounding
    of_others = largest_gain_beside(result, place)
    if not may_differ(v.ravel()[used], r.ravel()[used], record, of_others):
        return 1.0, 0.0  # not even one by one: another factor of the normal equations is saved
    inverse = np.linalg.pinv(full_whitener(records.whitener[rows]))
    H = np.zeros((len(rows), records.rows, used.size))
    for k, block in enumerate(inverse):
        H[k, :, k * records.rows : (k + 1) * records.rows] = block
    R = score(result.adjusted, records, rows, H[:, :, used]).information[0]
    return small_class_scale(v.ravel()[used], R, record, of_others)


def _labels(o: Observed, images: ImageGroups | None) -> tuple[list[str], Int]:
    """What tells the observations of one kind apart, and which each has: camera and group."""
    labels, label = [""], np.zeros(len(o), dtype=np.int64)
    touched = dict(o.records.touches)
    if images is not None and POSE in touched and POINT in touched and len(images.cameras) > 1:
        # a camera of one image fits the more, the more exact its points are taken to be: such cameras are one class
        number = np.where(np.bincount(images.camera)[images.camera] > 1, images.camera, len(images.cameras))
        used, label = np.unique(number[touched[POSE]], return_inverse=True)
        cameras = [*images.cameras.tolist(), "of cameras of one image" if len(used) > 1 else ""]
        labels = [cameras[k] for k in used]
    if o.group is not None:
        names, group = np.unique(o.group, return_inverse=True)
        labels = [f"{a} {b}".strip() for a in labels for b in names.tolist()]
        label = label * len(names) + group
    return labels, label


@dataclass(frozen=True)
class Scaling:
    """Standard deviations in use by a search: factors on those given, class by class."""

    classes: Classes
    factor: Float
    """(g,)."""
    last: ClassScales | None = None
    """What the last adjustment asks for beyond them."""
    without_errors: Bool | bool = False
    """(g,). Classes without errors, which keep the standard deviations given."""

    @classmethod
    def of(cls, block: BundleInput) -> Scaling:
        """Standard deviations as given."""
        classes = Classes.of(block)
        return cls(classes, np.ones(len(classes.names)))

    def with_images(self, observed: tuple[Observed, ...], images: Int, name: str) -> tuple[Scaling, Float]:
        """With classes of their own for some images, of much larger standard deviations; by what this changes them."""
        classes = self.classes.with_images(observed, images, name)
        of_image = self.factor[list(classes.part_of[len(self.classes.part_of) :])]
        larger = np.append(np.ones(len(self.factor)), np.full(len(of_image), APART))
        return Scaling(classes, np.append(self.factor, of_image) * larger), larger

    def after(self, scales: ClassScales) -> tuple[Scaling, Float]:
        """With what an adjustment asks for, and the factors that this changes by."""
        changed_class = self.changed & scales.estimable & (np.abs(np.log(scales.scale)) > np.log(SETTLED))
        factor = np.where(changed_class, scales.scale, scales.differing)
        # after others have been set right
        near_a_priori = changed_class & (np.abs(np.log(self.factor * factor)) < np.log(MATTERS))
        after = np.where(near_a_priori, 1.0, self.factor * factor)
        base, like_others = self.classes.base, self.classes.of_image & ~scales.estimable
        like_others |= self.classes.of_image & (after < self.classes.at_least * after[base])
        after = np.where(like_others, after[base], after)
        error_free = (after < np.array(self.classes.no_errors or [NO_ERRORS] * len(base))[base]) | self.without_errors
        after = np.where(error_free, 1.0, after)
        factor = after / self.factor
        remaining = replace(scales, scale=np.where(error_free, 1.0, scales.scale / factor))
        return Scaling(self.classes, after, remaining, error_free), factor

    @property
    def changed(self) -> Bool:
        """Classes whose standard deviations are not those given."""
        return np.asarray(self.factor != 1.0)

    @property
    def noisy(self) -> bool:
        """Whether the points of an image have larger standard deviations than others of their class."""
        return bool((self.factor != self.factor[self.classes.base]).any())

    @property
    def main_factor(self) -> float:
        """Factor of the class with the most redundancy; times sigma0 it is the ratio to those given."""
        return 1.0 if self.last is None else float(self.factor[self.last.main])

    def notes(self, *, of_result: bool) -> list[Note]:
        """Standard deviations that do not fit; `of_result`: the result follows, not the tests alone."""
        if not self.changed.any():
            return []
        beside, n = self.factor / self.factor[self.classes.base], int((~self.classes.of_image).sum())
        of_images = [(name, f) for name, f in zip(self.classes.names[n:], beside[n:].tolist()) if f != 1.0]
        factors = list(zip(self.classes.names[:n], self.factor.tolist()))
        changed_classes = tuple(f"{name} {f:.3g}" for name, f in factors if f != 1.0)
        if not of_result:
            text = "tests of gross errors are made with standard deviations that fit the residuals, times those given"
            return [Note("note", text, (*changed_classes, *(f"{name} {f:.3g}" for name, f in of_images)))]
        text = "{}: its errors are {:.3g} times those of others, and it is weighted so; {}"
        noisy = zip(self.classes.names[n:], beside[n:].tolist(), self.classes.least)
        notes = [Note("warning", text.format(name, f, ASKED[least])) for name, f, least in noisy if f != 1.0]
        if not changed_classes:
            return notes
        unchanged_classes = list(dict.fromkeys(name for name, f in factors if f == 1.0))
        text = (
            "standard deviations do not fit the residuals; weights and standard deviations of the result follow what "
            f"fits, times those given ({', '.join(unchanged_classes) + ' as given' if unchanged_classes else 'all'}; "
            "`blunders: {sigmas: given}` keeps them)"
        )
        return [Note("warning", text, changed_classes), *notes]
