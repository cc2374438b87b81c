"""What a command line says of sources: `--set [SOURCE:]KEY=VALUE`, KEY an option of a source or of the block.

SOURCE is the end of a path, `GCP.txt` or `flight2/GCP.txt`. Without it KEY is of every source; but what can only be of
one, its format, its columns, its geoid, what is taken of it, has to name it where there are several. A coordinate
system of every source holds for those whose files name none.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from aatri.errors import SpecError
from aatri.formats.parts.format import Reading
from aatri.formats.registry.recognised import Recognised, format_named, recognised
from aatri.ids import did_you_mean, shown
from aatri.strict_yaml import loads

OF_FILES = ("geoid", "control")
"""Options that name a file beside the source."""
OF_ONE = ("format", "columns", "take", "use", *OF_FILES)
"""Options that are not the same of several sources."""
FRAME = ("crs", "vertical")
"""Options that, said of every source, hold where its files name none."""


@dataclass(frozen=True)
class Setting:
    """An option of sources, or of the block."""

    source: str
    """End of the path of a source; empty: every one, or the block."""
    key: str
    value: Any

    @property
    def text(self) -> str:
        """As it is written on the command line."""
        return f"--set {self.source}{':' * bool(self.source)}{self.key}={self.value}"

    def is_of(self, path: Path) -> bool:
        """Whether a source is the one that is named."""
        return f"/{path.as_posix()}".endswith("/" + self.source.strip("/"))


@dataclass(frozen=True)
class SourceWithSettings(Recognised):
    """A source with what is said of it."""

    settings: tuple[Setting, ...] = ()

    def reading(self, without: Sequence[str] = ()) -> Reading:
        """How it is read; what is said of every source may be left out.

        Raises
        ------
        SpecError
            If a value is none of its option.
        """
        values: dict[str, Any] = {"format": self.format.name}
        for setting in sorted(self.settings, key=lambda s: bool(s.source)):  # what is said of it alone comes last
            if setting.source or setting.key not in without:
                try:
                    Reading.model_validate({setting.key: setting.value})
                except ValidationError as error:
                    raise SpecError(str(error.errors()[0]["msg"]), where=setting.text) from error
                values[setting.key] = setting.value
        values |= {key: _beside(self.path, Path(values[key])) for key in OF_FILES if key in values}
        return Reading.model_validate(values)


def settings_of(texts: Sequence[str]) -> list[Setting]:
    """Settings of `[SOURCE:]KEY=VALUE`, VALUE as YAML.

    Raises
    ------
    SpecError
        If a text is not of this form.
    """
    settings = []
    for text in texts:
        target, equals, value = text.partition("=")
        source, _, key = target.rpartition(":")
        if not equals or not key:
            what = "not KEY=VALUE or SOURCE:KEY=VALUE"
            raise SpecError(what, where=f"--set {text}", remedy="for example --set GCP.txt:crs=EPSG:25832")
        settings.append(Setting(source, key, loads(value, f"--set {text}").value))
    return settings


def sources_of(
    paths: Sequence[Path], settings: Sequence[Setting], without: Sequence[str] = ()
) -> tuple[list[SourceWithSettings], list[Path]]:
    """The sources of some files and folders with what is said of each, and the files that are of no format.

    Raises
    ------
    InputError
        If a path is of no known format.
    SpecError
        If a setting or `without` is of no source or of several.
    """
    unread = list[Path]()
    formats = [s for s in settings if s.key in ("format", "columns") and (s.source or len(paths) == 1)]
    named = [path for path in paths if path.is_file() and any(s.is_of(path) or not s.source for s in formats)]
    sources = [
        SourceWithSettings(r.format, r.path, r.seen)
        for path in paths
        if path not in named
        for r in recognised(path, unread)
    ]
    left_out = {end: [r.path for r in sources if Setting(end, "", "").is_of(r.path)] for end in without}
    for end, of_end in left_out.items():
        _one(end, of_end, [r.path for r in sources], f"--without {end}")
    dropped = {path for of_end in left_out.values() for path in of_end}
    sources = [r for r in sources if r.path not in dropped]
    for path in [*named, *unread]:
        own = [s for s in formats if s.is_of(path) or (path in named and not s.source)]
        if own:
            name = next((str(s.value) for s in own if s.key == "format"), "table")
            sources.append(SourceWithSettings(format_named(name), path, "as said"))
    unread = [path for path in unread if path not in {r.path for r in sources}]
    for setting in settings:
        if setting.source:
            every = [r.path for r in sources]
            _one(setting.source, [path for path in every if setting.is_of(path)], every, setting.text)
        elif setting.key in OF_ONE and len(sources) > 1:
            what = f"{setting.key} is of one source, and there are {len(sources)}"
            remedy = f"name the one that is meant: --set {sources[0].path.name}:{setting.key}=..."
            raise SpecError(what, where=setting.text, remedy=remedy)
    return [replace(r, settings=_settings_of(r, settings)) for r in sources], unread


def of_block(settings: Sequence[Setting]) -> dict[str, Any]:
    """The settings that are options of the block, not of its sources."""
    return {s.key: s.value for s in settings if not s.source and s.key not in Reading.model_fields}


def _settings_of(source: SourceWithSettings, settings: Sequence[Setting]) -> tuple[Setting, ...]:
    """Its settings; where a stage of its own reads it, those of every source are options of that stage too."""
    of_source = [s for s in settings if (s.is_of(source.path) if s.source else s.key in Reading.model_fields)]
    if source.format.read is not None and (unknown := [s for s in of_source if s.key not in Reading.model_fields]):
        what = f"no option {unknown[0].key!r} of a source{did_you_mean(unknown[0].key, Reading.model_fields)}"
        raise SpecError(what, where=unknown[0].text, remedy=f"options are {', '.join(Reading.model_fields)}")
    return tuple(of_source)


def _one(end: str, of_end: Sequence[Path], every: Sequence[Path], where: str) -> None:
    """Refuse an end of a path that is of no source, or of several."""
    if len(of_end) == 1:
        return
    if of_end:
        what, remedy = (
            f"{len(of_end)} sources end in {end}: {shown([str(p) for p in of_end], 4)}",
            "give more of the path",
        )
    else:
        names = [path.name for path in every]
        what, remedy = f"no source is {end}{did_you_mean(end, names)}", f"sources are {shown(names, 12)}"
    raise SpecError(what, where=where, remedy=remedy)


def _beside(source: Path, file: Path) -> Path:
    """A file as it is named, or of this name beside the source."""
    beside = (source if source.is_dir() else source.parent) / file
    return beside if not file.exists() and beside.exists() else file
