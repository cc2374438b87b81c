"""The declaration of a format: what it is called, how it is recognised, what it carries, how it is read and written.

All readers are called alike, and so are all writers. Recognition looks at the content alone, through a `FileView`,
which reads the beginning of each file once.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, Field

from aatri.formats.limits import MISFIT_PX
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.text.archive import ZIP, only_document
from aatri.options import Options
from aatri.progress import Reporter
from aatri.regular_file import open_regular

if TYPE_CHECKING:
    from aatri.formats.results.oriented_block import OrientedBlock

HEAD_BYTES = 1 << 16
"""So much of a file is looked at to recognise it."""

MOST_NAMES = 10_000
"""So many names of a folder or an archive are looked at."""

Content = Literal[
    "cameras", "distortion", "image points", "control", "check points", "start values of points", "positions",
    "attitudes", "start orientations", "strips", "times", "frame", "standard deviations", "covariances", "rigs", "film",
    "geodetic observations",
]  # fmt: skip
"""What a format may carry of a block."""

OF_MODELS: tuple[Content, ...] = (
    "cameras", "distortion", "image points", "start orientations", "start values of points"
)  # fmt: skip
"""What models of structure from motion have: BAL, Bundler, COLMAP, NVM."""


@dataclass(frozen=True)
class FileView:
    """A file or folder as recognition sees it."""

    path: Path

    @cached_property
    def is_folder(self) -> bool:
        """Whether it is a folder."""
        return self.path.is_dir()

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the files of a folder, or of the members of a zip archive."""
        try:
            if self.is_folder:
                return tuple(sorted(p.name for p, _ in zip(self.path.iterdir(), range(MOST_NAMES))))
            if self._beginning.startswith(ZIP):
                with zipfile.ZipFile(self.path) as archive:
                    return tuple(archive.namelist()[:MOST_NAMES])
        except (OSError, zipfile.BadZipFile, NotImplementedError):
            pass
        return ()

    @cached_property
    def head(self) -> str:
        """The beginning of the text, whatever its encoding and line ends, of the one XML file where a zip archive holds
        one; empty of what cannot be read."""
        data, document = self._beginning, only_document(self.names)
        if data.startswith(ZIP) and document is not None:
            try:
                with zipfile.ZipFile(self.path) as archive, archive.open(document) as file:
                    data = file.read(HEAD_BYTES)
            except (OSError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError):
                pass  # told when it is read
        wide = data[:2] in (b"\xff\xfe", b"\xfe\xff")
        text = data.decode("utf-16" if wide else "utf-8-sig", errors="replace")
        return text.replace("\r\n", "\n").replace("\r", "\n")

    @cached_property
    def _beginning(self) -> bytes:
        try:
            with open_regular(self.path) as file:
                return file.read(HEAD_BYTES)
        except OSError:
            return b""

    @cached_property
    def lines(self) -> list[str]:
        """Whole lines of the beginning, without empty ones."""
        lines = self.head.split("\n")
        return [line for line in (lines if len(self.head) < HEAD_BYTES // 4 else lines[:-1]) if line.strip()]

    def of(self, name: str) -> FileView:
        """A file of the folder."""
        return FileView(self.path / name)


def all_files(view: FileView) -> list[Path]:
    """The files of a folder, or the one file."""
    return [view.path / name for name in view.names] if view.is_folder else [view.path]


def begins(words: str) -> Callable[[FileView], bool]:
    """Recognises files that begin with some words."""
    return lambda view: view.head.startswith(words)


TakenPart = Literal["cameras", "image points", "ground points", "positions", "attitudes"]
"""What may be taken of a source."""


def _as_tuple(values: Any) -> Any:
    """A list of pipeline.yaml as the tuple that it stands for, within a source given by its path alone too."""
    return tuple(values) if isinstance(values, list) else values


GEOID = "grid of the geoid above which its heights are, .tif or .gtx; null: as `vertical` says"
"""What the option `geoid` of a source is."""
CONTROL_FILE = "of a PhotoModeler export: file of its control points; null: no control"
"""What the option `control` of a source is."""


class Reading(Options):
    """What may be said of a source that its files do not say."""

    crs: str | None = Field(None, description="coordinate system of the source, as pyproj reads it; null: as it says")
    vertical: str | None = Field(None, description="its height system, EPSG:5773 ...; null: as it says, or ellipsoidal")
    columns: str | None = Field(
        None,
        description="of lists: a preset (docs/formats.md), or the columns in order, `image X Y Z omega phi kappa`; "
        "null: by the header",
    )
    angle: Literal["deg", "gon", "rad"] | None = Field(
        None, description="of lists: unit of angles; null: as the header says, or degrees"
    )
    rotation: Literal["omega-phi-kappa", "phi-omega-kappa", "yaw-pitch-roll"] | None = Field(
        None, description="of lists: system of the angles; null: as the preset or the names of the columns say"
    )
    maps: Literal["ground_from_image", "image_from_ground"] | None = Field(
        None, description="of PATB and Inpho: which way rotation matrices map; null: as the lines of the flight show"
    )
    take: Annotated[tuple[TakenPart, ...], BeforeValidator(_as_tuple)] = Field(
        (), description="what is taken of the source; empty: all that it has"
    )
    lens_misfit_px: float = Field(
        MISFIT_PX, ge=0, description="largest misfit that a distortion may have which is none of aatri's, px"
    )
    use: Literal["observed", "approximate"] | None = Field(
        None, description="positions and attitudes are observations, or start values; null: as the format has it"
    )

    format: str | None = Field(None, description="a name of `aatri formats`; null: recognised by the content")
    geoid: Path | None = Field(None, description=GEOID)
    control: Path | None = Field(None, description=CONTROL_FILE)


AS_IT_SAYS = Reading()


class Writing(Options):
    """What may be said of an export."""

    columns: str | None = Field(None, description="of lists: a preset, or the columns in order; null: pix4d")
    angle: Literal["deg", "gon", "rad"] | None = Field(None, description="of lists: unit of angles; null: degrees")
    rotation: Literal["omega-phi-kappa", "phi-omega-kappa", "yaw-pitch-roll"] | None = Field(
        None, description="of lists: system of the angles; null: as the preset or the names of the columns say"
    )
    lens_misfit_px: float = Field(
        MISFIT_PX, ge=0, description="largest misfit that a distortion may have which the target lacks, px"
    )


AS_USUAL = Writing()


@dataclass(frozen=True)
class Format:
    """A format."""

    name: str
    title: str
    recognise: Callable[[FileView], str | bool]
    """What was seen in a file or folder by which it is of this format, in words; true: just what was looked for;
    empty or false: it is not."""
    looked_for: str
    """What a file of this format has, in words, for messages."""
    carries: Sequence[Content]
    """What is read."""
    page: str = "docs/formats.md"
    """Page and section of the documentation."""
    read: Callable[[Path, Reading, Reporter], BlockParts] | None = None
    """None where it is not read, or where a stage of its own reads it. Raises InputError where a file is missing, is
    not of its form, or has what is not supported; the message names the place."""
    stage: str = ""
    """That stage, where it has one: `block/colmap`; else `block/combined` reads it."""
    write: Callable[[OrientedBlock, Path, Writing, Reporter], None] | None = None
    """Writes files of this form; see `results.oriented_block`. Raises InputError where a camera or distortion has no
    like in it, ResourceError where a file cannot be written."""
    written: Sequence[Content] = ()
    """What it writes; what else a block has is told by `registry.export`."""
    other_names: Sequence[str] = ()
    """What people call it besides."""
    estimates_cameras: bool = False
    """Its cameras are results of an adjustment of the image points that it has, not of a calibration."""
    files_of: Callable[[FileView], Sequence[Path]] = field(default=lambda view: [view.path])
    """Of a folder: the files that are read with it."""
    holds_several: Callable[[FileView], bool] = lambda _: False
    """Whether a folder holds several projects of this format."""
    beside: Sequence[tuple[str, str]] = ()
    """Formats of files that its stage takes, each with the option that names it: `(("dbat_control", "control"),)`."""

    @property
    def drops(self) -> tuple[Content, ...]:
        """What is neither read nor written."""
        return tuple(content for content in get_args(Content) if content not in {*self.carries, *self.written})
