"""Reading of a source: its format is recognised or named, and what was said of it is applied."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aatri.codes import APPROXIMATE_VALUE, OBSERVED_VALUE
from aatri.errors import AatriError, InputError, raise_all
from aatri.formats.parts.block_parts import LOCAL, PLANE, BlockParts, check_parts
from aatri.formats.parts.format import FileView, Reading
from aatri.formats.parts.geoid import with_ellipsoidal_heights
from aatri.formats.parts.not_stated import stated_frame
from aatri.formats.registry.recognised import format_named, recognised_file
from aatri.formats.registry.settings import FRAME, Setting, SourceWithSettings, sources_of
from aatri.formats.registry.variants import fuller_ones
from aatri.formats.text.number_text import is_number
from aatri.formats.text.text_file import missing
from aatri.frames.conversion import Frame
from aatri.ids import shown
from aatri.progress import Reporter

TABLES = {
    "cameras": ("cameras", "camera_parameters"),
    "image points": ("image_points",),
    "ground points": ("ground_points",),
    "positions": ("exterior",),
    "attitudes": ("exterior",),
}
"""What may be taken of a source, and the tables it is in; the images themselves are always."""

OF_POSITIONS = ("position_m", "sigma_m", "position_covariance_m2", "position_use", "refers_to", "drift_group")
OF_ATTITUDES = ("angles_rad", "ground_from_image", "angle_sigma_rad", "angle_use")


def read_source(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    """What a file or folder gives; of a format that is named, else a list where columns are, else recognised.

    Raises
    ------
    InputError
        If the format is not known or the source not of its form.
    """
    if not path.exists():
        raise missing(path)
    name = reading.format or ("table" if reading.columns is not None else None)
    if name is None:
        recognised = recognised_file(path)
        declared = recognised.format
        reporter.log(f"{path}: {declared.title} ({recognised.seen})")
    else:
        declared = format_named(name)
    if declared.read is None:
        what = f"{declared.title} is read by {declared.stage or 'nothing'} alone, not beside other sources"
        raise InputError(what, where=str(path), remedy=f"see {declared.page}")
    parts = declared.read(path, reading, reporter)
    parts = _as_said(parts, reading)
    check_parts(parts)
    return parts if reading.geoid is None else with_ellipsoidal_heights(parts, reading.geoid)


def read_all(
    paths: Sequence[Path], settings: Sequence[Setting], reporter: Reporter, *, without: Sequence[str] = ()
) -> tuple[list[SourceWithSettings], list[BlockParts]]:
    """The sources of some files and folders, and what they give.

    The first one says which images there are (`parts.joined`), so those with most images that have image points come
    first.

    Parameters
    ----------
    settings : sequence of Setting
        Of a single source, or of every one; those of the block are no concern of this.
    without : sequence of str
        Files and folders that are left out, by the ends of their paths.

    Raises
    ------
    InputError
        If a path is of no known format, or a source not of its form.
    SpecError
        If a setting or `without` is of no source, or of none alone.
    """
    sources, unread = sources_of(paths, settings, without)
    for source in sources:
        reporter.log(f"{source.path}: {source.format.title} ({source.seen})")
    if len(sources) == 1 and sources[0].format.read is None:
        _say_unread(unread, reporter)
        return sources, []
    files: set[Path] = set()
    try:
        sources, parts = _read_each(sources, paths, reporter)
        files = {file for of_source in parts for file in of_source.files}
    finally:
        _say_unread([path for path in unread if path not in files], reporter)
    named = [*paths, *(s.path for s in sources if any(setting.source for setting in s.settings))]
    taken = fuller_ones(sources, parts, named, reporter)
    sources, parts = _with_companions([sources[k] for k in taken], [parts[k] for k in taken], reporter)
    images = [len({*p.image_points.get("image", ()), *p.images.get("id", ())}) if p.image_points else 0 for p in parts]
    order = sorted(range(len(sources)), key=lambda k: -images[k])
    return [sources[k] for k in order], [parts[k] for k in order]


def _say_unread(unread: Sequence[Path], reporter: Reporter) -> None:
    """Tell the files and folders that are none of a source, and how they may be."""
    if files := [str(path) for path in unread if not path.is_dir()]:
        reporter.log(f"of no known format, not read: {shown(files)}")
    if deep := [str(path) for path in unread if path.is_dir()]:
        reporter.log(f"folders too deep, not looked into: {shown(deep)}; what belongs to the block: --from {deep[0]}")
    if lists := [path.name for path in unread if _is_of_numbers(path)]:
        what = f"lists without a header are read by their columns: {shown(lists)}"
        reporter.log(f'{what}; for example --set "{lists[0]}:columns=point X Y Z"')


def _is_of_numbers(path: Path) -> bool:
    """Whether a file may be a list without a header: its first line has three numbers and more, and few other words."""
    words = re.split(r"[\s,;]+", next(iter(FileView(path).lines), "").strip())
    return sum(map(is_number, words)) >= max(3, len(words) / 2)


def _read_each(
    sources: Sequence[SourceWithSettings], paths: Sequence[Path], reporter: Reporter
) -> tuple[list[SourceWithSettings], list[BlockParts]]:
    """The sources with what each gives; those of a folder that cannot be read are told at once, and may be left out."""
    read, problems = list[tuple[SourceWithSettings, BlockParts]](), list[AatriError]()
    for source in sources:
        try:
            read.append(_read(source, reporter))
        except InputError as error:
            of_folder = len(sources) > 1 and source.path not in paths
            remedy = error.remedy + (f"; or leave it out: --without {source.path.name}" if of_folder else "")
            problems.append(InputError(error.what, where=error.where, remedy=remedy))
    raise_all(problems)
    return [source for source, _ in read], [parts for _, parts in read]


def _with_companions(
    sources: list[SourceWithSettings], parts: list[BlockParts], reporter: Reporter
) -> tuple[list[SourceWithSettings], list[BlockParts]]:
    """A source that takes a file beside it as an option, read with that file, which is no source then."""
    for k, source in enumerate(sources):
        beside = [(m, s) for m, s in enumerate(sources) if s.format.name in dict(source.format.beside)]
        if len(beside) == 1:
            m, companion = beside[0]
            option = Setting(source.path.name, dict(source.format.beside)[companion.format.name], str(companion.path))
            combined = replace(source, settings=(*source.settings, option))
            reporter.log(f"{companion.path}: {option.key} of {source.path.name}")
            pairs = zip(
                [*sources[:k], combined, *sources[k + 1 :]], [*parts[:k], _read(combined, reporter)[1], *parts[k + 1 :]]
            )
            kept = [pair for n, pair in enumerate(pairs) if n != m]
            return [s for s, _ in kept], [p for _, p in kept]
    return sources, parts


def _read(source: SourceWithSettings, reporter: Reporter) -> tuple[SourceWithSettings, BlockParts]:
    """A source with what is said of it; a coordinate system of every source holds where its files name none."""
    own, general = source.reading(without=FRAME), source.reading()
    if own == general:
        return source, read_source(source.path, own, reporter)
    try:
        parts = read_source(source.path, own, reporter)
        has_coordinates = bool(parts.ground_points or parts.exterior)  # in metres; a free model has none
        unnamed = has_coordinates and (
            parts.frame is None
            or replace(parts.frame, vertical="") == replace(PLANE, name=parts.frame.name)
            or (parts.frame == LOCAL and "geodetic" in parts.others)  # a network is in metres
        )
    except InputError:  # it cannot do without a coordinate system, or it is damaged
        return source, read_source(source.path, general, reporter)
    if unnamed:
        return source, replace(parts, frame=_frame(parts, general))
    return replace(source, settings=tuple(s for s in source.settings if s.source or s.key not in FRAME)), parts


def _as_said(parts: BlockParts, reading: Reading) -> BlockParts:
    """The parts in the frame that was said, and with what was said to be observed or not."""
    if reading.crs or reading.vertical:
        parts = replace(parts, frame=_frame(parts, reading))
    exterior = dict(parts.exterior)
    if reading.use is not None and exterior:
        code = OBSERVED_VALUE if reading.use == "observed" else APPROXIMATE_VALUE
        exterior |= {"position_use": code, "angle_use": code}
    takes = reading.take
    if takes:
        for what, tables in TABLES.items():
            if what not in takes and "exterior" not in tables:
                left_out: dict[str, Any] = {name: {} for name in tables}
                parts = replace(parts, **left_out)
        if "positions" not in takes:
            exterior = {name: v for name, v in exterior.items() if name not in OF_POSITIONS}
        if "attitudes" not in takes:
            exterior = {name: v for name, v in exterior.items() if name not in OF_ATTITUDES}
        if not {*exterior} & {"position_m", "angles_rad", "ground_from_image"}:
            exterior = {}
    if exterior and "position_m" not in exterior:
        exterior["position_m"] = np.full((len(exterior["image"]), 3), np.nan)
    return replace(parts, exterior=exterior)


def _frame(parts: BlockParts, reading: Reading) -> Frame | None:
    own = parts.frame
    if reading.crs is None and own is not None and own.crs != "local":
        stated_frame(own.crs, reading.vertical, str(parts.files[0]))
        return replace(own, vertical=reading.vertical or own.vertical)
    return stated_frame(reading.crs, reading.vertical, str(parts.files[0]))
