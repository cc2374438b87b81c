"""Absolute orientation of the strips of a block: joined to components, and each of these by what is observed of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.threads import one_blas_thread
from aatri.errors import ConvergenceError, GeometryError
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bodies.absolute import OrientationSettings, Start
from aatri.orientation.bodies.absolute_datum import (
    Failed,
    OrientedPart,
    StripsOfBlock,
    begun_part,
    error_of_all,
    oriented_part,
    part_notes,
    parts_together,
    pooled,
    strip_points_of,
    usable_ties,
)
from aatri.orientation.bodies.by_attitudes import images_by_attitudes
from aatri.orientation.bodies.components import FreeBlock, join_strips, strip_names
from aatri.orientation.bodies.datum_analysis import OpenDatumError
from aatri.orientation.bodies.ground_fit import distant_start, fit_notes, height_notes, misfitting_strips
from aatri.orientation.bodies.limits import MOST_CANDIDATE_STRIPS, ONE_MISFIT_IN
from aatri.orientation.bodies.wrong_tables import ONE_ROW, one_row_off


@dataclass(frozen=True)
class Joining:
    """How strips are joined and oriented."""

    tie_limit: float
    control_limit: float
    """Test statistics of wrong ties, and of what is wrong on the ground."""
    start: Start
    """How each component starts; see `OrientationSettings`."""
    every_component: bool
    """A component without a datum is an error; else it is left out with a warning."""
    apart: tuple[int, ...] = ()
    """Strips that are taken by themselves."""
    left_out: tuple[int, ...] = ()
    """Strips that are left out."""
    level: bool = False
    """What is open of a component by its turn about a line alone, or hardly determined, may begin a bundle."""


@dataclass(frozen=True)
class OrientedStrips:
    """Components on the ground, reduced to the origin, and what there is to say of them."""

    block_strips: StripsOfBlock
    parts: tuple[OrientedPart, ...]
    notes: tuple[Note, ...]

    @property
    def strips(self) -> int:
        """How many they are."""
        return sum(len(part.component.strips) for part in self.parts)

    def with_notes(self, notes: Sequence[Note]) -> OrientedStrips:
        """The same with more to say."""
        return replace(self, notes=(*self.notes, *notes))


def orient_strips(block_strips: StripsOfBlock, joining: Joining, *, max_sigma0: float | None) -> OrientedStrips:
    """Join strips to components and orient each.

    A strip that fits neither control nor the other strips is taken by itself, or left out: the stages that follow
    orient its images by what else is known of them. Where `max_sigma0` is given it holds for every strip.

    Raises
    ------
    GeometryError
        If a component is not determined, or none is.
    ConvergenceError
        If an adjustment does not converge, or its result does not fit.
    """
    try:
        oriented = _oriented(block_strips, joining)
    except GeometryError:
        if (level := _levelled(block_strips, joining)) is None:
            raise
        return level
    try:
        fitting = oriented.with_notes(fit_notes(block_strips.strips, oriented.parts, max_sigma0))
    except ConvergenceError as error:
        without = None if max_sigma0 is not None else _without_misfits(block_strips, joining, oriented)
        if without is None and max_sigma0 is None:
            without = _without_camera(block_strips, joining)
        if without is not None:
            return without
        block, strips = block_strips.ground.block, block_strips.strips
        try:
            warning = distant_start(block, strips, oriented.parts, error, may_begin=max_sigma0 is None)
        except ConvergenceError:
            if max_sigma0 is not None or (without := _without_positions(block_strips, joining)) is None:
                raise
            return without
        return oriented.with_notes([warning])
    if oriented.strips < len(block_strips.strips.strips) and (level := _levelled(block_strips, joining)) is not None:
        return level if level.strips > oriented.strips else fitting
    return fitting


def _levelled(block_strips: StripsOfBlock, joining: Joining) -> OrientedStrips | None:
    """The same, and components that are hardly determined, or level where a turn about a line is open; else None."""
    level = None if joining.every_component else _tried(block_strips, replace(joining, level=True))
    notes = None if level is None else _fitting(block_strips, level)
    return None if level is None or notes is None else level.with_notes(notes)


def _without_misfits(block_strips: StripsOfBlock, joining: Joining, oriented: OrientedStrips) -> OrientedStrips | None:
    """The same without strips that do not fit; None if the rest does not fit either.

    Of the strips with the largest residuals the one without which the others fit best is left out, one after the other.
    """
    names, left = block_strips.strips.strips.id, dict[int, float]()
    fitting = None
    while fitting is None:
        if len(left) >= max(1, len(names) // ONE_MISFIT_IN):
            return None
        trials = list[tuple[tuple[bool, int, float], int, float, OrientedStrips]]()
        for strip, off_m in misfitting_strips(block_strips.strips, oriented.parts)[:MOST_CANDIDATE_STRIPS]:
            if (without := _tried(block_strips, replace(joining, left_out=(*left, strip)))) is not None:
                worse = _fitting(block_strips, without) is None, -without.strips, pooled(without.parts)[1]
                trials.append((worse, strip, off_m, without))
        if not trials:
            return None
        _, strip, left_m, oriented = min(trials, key=lambda one: one[0])
        left[strip] = left_m
        fitting = _fitting(block_strips, oriented)
    texts = [f"strip {names[strip]} is {off_m:.3g} m (RMS) off all else" for strip, off_m in left.items()]
    by_themselves = _tried(block_strips, replace(joining, apart=tuple(left)))
    if (
        by_themselves is None
        or by_themselves.strips == oriented.strips
        or (alone_fitting := _fitting(block_strips, by_themselves)) is None
    ):
        reason = "left out here: its models are weak, or its points or its control are wrong"
        return oriented.with_notes([*(Note("warning", f"{text}: {reason}") for text in texts), *fitting])
    return by_themselves.with_notes(
        [*(Note("warning", f"{text}: it is taken by itself") for text in texts), *alone_fitting]
    )


def _without_camera(block_strips: StripsOfBlock, joining: Joining) -> OrientedStrips | None:
    """The same without the strips of one of several cameras, as few as can be, where the others fit."""
    table, block = block_strips.strips.strip_images, block_strips.ground.block
    camera = block.images.camera[table.image]
    fitting, cameras = list[tuple[int, int, OrientedStrips]](), np.unique(camera).tolist()
    for k in cameras if len(cameras) > 1 else ():
        without = _tried(block_strips, replace(joining, left_out=tuple(np.unique(table.strip[camera == k]).tolist())))
        if without is not None and (notes := _fitting(block_strips, without)) is not None:
            fitting.append((without.strips, k, without.with_notes(notes)))
    if not fitting:
        return None
    _, k, without = max(fitting, key=lambda one: one[0])
    names = block_strips.strips.strips.id[np.unique(table.strip[camera == k])].tolist()
    text = f"strips of different cameras contradict each other; left out are those of camera {block.cameras.id[k]}, "
    text += "whose principal distance may be wrong"
    return without.with_notes([Note("warning", text, tuple(map(str, names)))])


def _without_positions(block_strips: StripsOfBlock, joining: Joining) -> OrientedStrips | None:
    """The same by all but positions, where the others fit; positions come back as far as they fit these.

    None where fewer than half are off, or in height above all, which a principal distance or a height datum explains.
    """
    by_others = replace(block_strips, last_kind=POSITION)
    if (oriented := _tried(by_others, joining)) is None or (notes := _fitting(by_others, oriented)) is None:
        return None
    adjusted = [(part.result.places, part.result.tied.active) for part in oriented.parts]
    used = np.concatenate([active[places.row[places.kind == POSITION]] for places, active in adjusted])
    off_m = np.concatenate([(places.observed_m - places.xyz)[places.kind == POSITION] for places, _ in adjusted])[~used]
    complete_m = off_m[np.isfinite(off_m).all(axis=1)]
    if not len(complete_m) or 2 * len(complete_m) < len(used):
        return None
    median_m = np.median(np.abs(complete_m), axis=0)
    if median_m[:2].max() <= median_m[2]:
        return None
    row_shifts = filter(None, (one_row_off(places) for places, _ in adjusted))
    notes = [*(Note("warning", f"{row_shift}; {ONE_ROW}") for row_shift in row_shifts), *notes]
    text = f"observed positions: {len(off_m)} of {len(used)} contradict all else, which fits without them"
    return oriented.with_notes([Note("warning", text), *notes])


def _tried(block_strips: StripsOfBlock, joining: Joining) -> OrientedStrips | None:
    """Strips joined otherwise, begun level if nothing else orients any; None where that cannot be done, or nothing
    tells whether they fit."""
    try:
        oriented = _oriented(block_strips, joining)
    except GeometryError:
        may_begin = not (joining.level or joining.every_component)
        return _tried(block_strips, replace(joining, level=True)) if may_begin else None
    except ConvergenceError:
        return None
    return oriented if np.isfinite(pooled(oriented.parts)[1]) else None


def _fitting(block_strips: StripsOfBlock, oriented: OrientedStrips) -> list[Note] | None:
    """What there is to say of strips that fit; None if they do not."""
    try:
        return fit_notes(block_strips.strips, oriented.parts, None)
    except ConvergenceError:
        return None


def _oriented(block_strips: StripsOfBlock, joining: Joining) -> OrientedStrips:
    """Components as strips are tied firmly; weakly too, where not each has control enough of its own."""
    with one_blas_thread():  # long matrices of three columns: threads only wait
        free, parts, failed, notes = _joined_and_oriented(block_strips, joining, weakly=False)
        if any(free.weak) and failed:
            free, parts, failed, notes = _joined_and_oriented(block_strips, joining, weakly=True)
    if not free.components:
        raise GeometryError("there are no strips to orient", remedy="see the gaps of the strip formation")
    if failed and (joining.every_component or not parts):
        raise error_of_all(failed, free)
    notes += [Note("warning", f"not oriented: {error.what}") for _, _, error in failed]
    return OrientedStrips(block_strips, tuple(parts), tuple(notes))


def _joined_and_oriented(
    block_strips: StripsOfBlock, joining: Joining, *, weakly: bool
) -> tuple[FreeBlock, list[OrientedPart], list[Failed], list[Note]]:
    """Strips joined to components, each of them oriented; the errors of those that are not determined or converge.

    Strips whose common points lie nearly on a line are joined only `weakly`: rigidly joined, they would be turned
    against each other by the errors of these points, magnified, and fit no control.
    """
    strips = block_strips.strips
    names = strips.strips.id.tolist()
    settings = OrientationSettings(joining.control_limit, start=joining.start)
    free = join_strips(
        strip_points_of(strips),
        names,
        point_ids=strips.points.id,
        active=usable_ties(strips),
        limit=joining.tie_limit,
        weakly=weakly,
        apart=joining.apart + joining.left_out,
    )
    parts, failed = list[OrientedPart](), list[Failed]()
    notes = list[Note]()
    for number, component in enumerate(free.components, 1):
        if np.isin(component.strips, joining.left_out).all():
            continue
        what = f"component {number} ({strip_names(component, names)})"
        try:
            part, more = oriented_part(block_strips, component, what, settings)
        except (ConvergenceError, GeometryError) as error:
            failed.append((component, what, error))
            continue
        parts.append(part)
        notes += more

    def beside_each_other(failed: list[Failed]) -> list[Failed]:
        together = parts_together(block_strips, parts, failed, settings) if failed else {}
        if len(together) < len(failed) and any(isinstance(error, OpenDatumError) for _, _, error in failed):
            placed = [part.on_ground for part in [*parts, *(part for part, _ in together.values())]]
            turned = images_by_attitudes(block_strips.ground, block_strips.rays, placed)
            if isinstance(turned, str):
                notes.extend([Note("warning", turned)] if turned else [])
            else:
                together = parts_together(block_strips, parts, failed, settings, [turned])
                by = several(int(turned.poses.oriented.sum()), "image", "is", "are")
                text = f"{by} placed by attitudes, rays, control and positions together, and strips beside them"
                notes.extend([Note("note", text)] if together else [])
        parts.extend(part for part, _ in together.values())
        notes.extend(note for _, of_part in together.values() for note in of_part)
        return [one for k, one in enumerate(failed) if k not in together]

    may_share = weakly or not any(free.weak)
    failed = beside_each_other(failed) if may_share else failed
    left = list[Failed]()
    for component, what, failure in failed:
        may_begin = joining.level and isinstance(failure, GeometryError)
        begun = begun_part(block_strips, free, component, failure, what, settings) if may_begin else None
        if begun is None:
            left.append((component, what, failure))
            continue
        parts.append(begun[0])
        notes += begun[1]
    left = beside_each_other(left) if may_share and len(left) < len(failed) else left
    for part in parts:
        notes += [*height_notes(block_strips.ground.block, part.result, part.what), *part_notes(part)]
    # Strips tied weakly that stand on control of their own are meant to; without it they are lost.
    joined = [
        Note("note" if weak and not left else "warning", f"not joined: {text}")
        for text, weak in zip(free.unjoined, free.weak)
    ]
    return free, parts, left, [*joined, *notes]
