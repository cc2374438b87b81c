"""Of which format a file or folder is, by its content alone.

A folder is looked at as a whole; each of its files that no format of the whole reads is looked at by itself, and those
of its folders, so that a project of several programs comes out as several sources.
"""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from aatri.errors import InputError
from aatri.formats.conventions.names import without_extension
from aatri.formats.parts.format import FileView, Format
from aatri.formats.registry.catalogue import BY_NAME, FORMATS
from aatri.formats.text.text_file import missing
from aatri.ids import clipped, did_you_mean, several

MOST_FILES = 500
"""So many files of a folder are looked at by themselves."""
MOST_LEVELS = 2
"""Folders within the folder, and within these."""
MOST_TOLD = 12
MOST_NEAR = 5
"""So many formats are named of which a file might have been."""
ARCHIVE = "PK"
"""What a zip archive begins with."""
GRAMMARS = {"<": "XML", "{": "JSON", "[": "JSON"}
"""What of `Format.looked_for` a file has whose text begins so."""


@dataclass(frozen=True)
class Recognised:
    """A file or folder of a format, and by what it was seen."""

    format: Format
    path: Path
    seen: str


OF_RESULTS = ("residuals.csv", "points.csv", "exterior.csv")
"""Files of every result that is exported as tables."""


def format_named(name: str) -> Format:
    """The format of a name.

    Raises
    ------
    InputError
        If there is none.
    """
    if name not in BY_NAME:
        what = f"no format {clipped(name)!r}{did_you_mean(name, BY_NAME)}"
        raise InputError(what, remedy=f"formats are {', '.join(f.name for f in FORMATS)}: aatri formats")
    return BY_NAME[name]


def recognised_file(path: Path) -> Recognised:
    """The format of one source.

    Raises
    ------
    InputError
        If it is missing or of no known format, with what was looked for.
    """
    if not path.exists():
        raise missing(path)
    one = _as_one(path)
    if one is None:
        raise unrecognised(path)
    return one


def recognised(path: Path, unread: list[Path] | None = None) -> list[Recognised]:
    """What a path holds: one source, or those of a folder of several.

    Parameters
    ----------
    unread : list of Path, optional
        Gets the files of a folder that are of no format, and its folders that are too deep to be looked into;
        photographs are none of them.

    Raises
    ------
    InputError
        If it is missing, or nothing in it is of a known format.
    """
    if not path.exists():
        raise missing(path)
    source_of_all = _as_source(path)
    if not path.is_dir():
        if source_of_all is None:
            raise unrecognised(path)
        return [source_of_all]
    sources = [] if source_of_all is None else [source_of_all]
    read = {file for r in sources for file in r.format.files_of(FileView(path))}
    sources += _within(path, read, MOST_LEVELS, [] if unread is None else unread)
    if not sources:
        raise unrecognised(path)
    return sources


def _as_one(path: Path) -> Recognised | None:
    view = FileView(path)
    for f in FORMATS:
        if seen := f.recognise(view):
            return Recognised(f, path, f.looked_for if seen is True else str(seen))
    return None


def _as_source(path: Path) -> Recognised | None:
    """The same, but of a folder that holds several projects of its format, which are looked at one by one."""
    one = _as_one(path)
    return None if one is not None and one.format.holds_several(FileView(path)) else one


def _within(folder: Path, read: Collection[Path], levels: int, unread: list[Path]) -> list[Recognised]:
    """Sources among the files of a folder, and folders of it."""
    sources: list[Recognised] = []
    for path in sorted(folder.iterdir())[:MOST_FILES]:
        if path.name.startswith(".") or path in read:
            continue
        one = _as_source(path)
        if one is not None:
            sources.append(one)
        elif path.is_dir():
            if levels > 1 and not path.is_symlink():
                sources += _within(path, read, levels - 1, unread)
            elif any(path.iterdir()):
                unread.append(path)
        elif path.is_file() and without_extension(path.name) == path.name:
            unread.append(path)
    return sources


def unrecognised(path: Path) -> InputError:
    """The error for what is of no known format: what the files begin with, and what the nearest formats have."""
    files = sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]
    if {*OF_RESULTS} <= {p.name for p in files}:
        remedy = "the block that was adjusted: `aatri export RUN:block tables DIR`"
        return InputError("results as `aatri export RUN tables` writes them, no block", where=str(path), remedy=remedy)
    begins = "; ".join(f"{p.name} {_beginning(p)}" for p in files[:MOST_TOLD])
    more = f" and {several(len(files) - MOST_TOLD, 'more file')}" if len(files) > MOST_TOLD else ""
    what = f"of no known format ({begins or 'no file that is one lies in it or one folder below'}{more})"
    near = dict.fromkeys(f for one in dict.fromkeys([*files[:MOST_TOLD], path]) for f in _nearest(one))
    looked = "; ".join(f"{f.name}: {f.looked_for}" for f in [*near][:MOST_NEAR])
    of_list = f'--set "{path.name}:columns=point X Y Z"' if not path.is_dir() else "`--set FILE:columns=...`"
    by_columns = f"; any list by its columns: {of_list}, in a pipeline `columns` beside its path"
    remedy = f"nearest are {looked}{by_columns if BY_NAME['table'] in near else ''}; all formats: aatri formats"
    return InputError(what, where=str(path), remedy=remedy)


def _nearest(path: Path) -> list[Format]:
    """Formats that are read from such files: whose title has the ending of its name, then those of the same grammar."""
    view = FileView(path)
    begins = "<" if view.head.startswith(ARCHIVE) else view.head.lstrip()[:1]
    grammar = "a folder" if view.is_folder else GRAMMARS.get(begins, "a header with the columns")
    ending = path.suffix.lower()
    by_ending = [f for f in FORMATS if ending and ending in f.title.lower()]
    return by_ending + [f for f in FORMATS if (f.read or f.stage) and grammar in f.looked_for]


def _beginning(path: Path) -> str:
    view = FileView(path)
    if view.head.startswith(ARCHIVE):
        return "is a zip archive without one XML file, or a broken one: unpack it"
    return f"begins with {clipped(view.lines[0].strip() if view.lines else '', 40)!r}"
