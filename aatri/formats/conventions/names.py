"""Names of images and points in one file, matched with those of another: by a stated rule, step by step.

The steps, each for the names that the steps before have left over:

    1  the same name
    2  without the folder            d:\\flight 1\\IMG_1.JPG  =  IMG_1.JPG
    3  without the extension         IMG_1.JPG  =  IMG_1.tif  =  IMG_1        (known extensions of images only)
    4  whatever the case             img_1  =  IMG_1

Points take steps 1 and 4 alone: their ids have no folder and no extension. A step matches a name only if it leaves no
choice: where two names of a file become equal, neither is matched by that step, and the conflict is told with both.
"""

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass

from aatri.ids import shown

EXTENSIONS = {
    "jpg", "jpeg", "tif", "tiff", "png", "bmp", "jp2", "j2k", "ecw", "img", "dng", "nef", "cr2", "cr3", "arw", "raw",
    "iiq", "ppm", "pgm", "webp", "heic", "pix", "ntf", "nitf", "sid", "cub",
}  # fmt: skip
"""Of images, in small letters."""


def without_folder(name: str) -> str:
    """The last part of a path, of Windows or of any other system."""
    return re.split(r"[/\\]", name)[-1] or name


def without_extension(name: str) -> str:
    """A file name without the extension of an image; any other ending is part of the name."""
    stem, dot, extension = name.rpartition(".")
    return stem if dot and stem and extension.casefold() in EXTENSIONS else name


def _as_it_is(name: str) -> str:
    return name


Step = tuple[str, Callable[[str], str]]

OF_IMAGES: tuple[Step, ...] = (
    ("the same name", _as_it_is),
    ("without folder", without_folder),
    ("without folder and extension", lambda name: without_extension(without_folder(name))),
    ("without folder and extension, whatever the case", lambda n: without_extension(without_folder(n)).casefold()),
)
OF_POINTS: tuple[Step, ...] = (("the same name", _as_it_is), ("whatever the case", str.casefold))


@dataclass(frozen=True)
class Matching:
    """Names of a file and what they are called elsewhere."""

    name: Mapping[str, str]
    """Of matched names: the other name."""
    by_step: Mapping[str, int]
    """How many were matched by which step."""
    unmatched: tuple[str, ...]
    """Names that nothing matches."""
    conflicts: tuple[tuple[str, tuple[str, ...]], ...]
    """Of unmatched names that could be several others, or of several that could be one: the step, and the names."""

    def in_words(self, what: str) -> list[str]:
        """Sentences for the log: how many names were matched how, which were not, and each conflict."""
        steps = [f"{count} {what} matched by {step}" for step, count in self.by_step.items() if step != "the same name"]
        conflicts = [f"{what} that could be the same {step}: {shown(names)}" for step, names in self.conflicts]
        return [*steps, *conflicts]


def matched(names: Iterable[str], targets: Collection[str], steps: tuple[Step, ...] = OF_IMAGES) -> Matching:
    """Match names with others.

    Parameters
    ----------
    targets : collection of str
        What the names may be called.
    steps : sequence of (str, callable)
        `OF_IMAGES` or `OF_POINTS`.
    """
    open_names, free = dict.fromkeys(names), dict.fromkeys(targets)
    named: dict[str, str] = {}
    by_step: dict[str, int] = {}
    conflicts: dict[tuple[str, ...], str] = {}
    for step, key in steps:
        left, right = _by_key(open_names, key), _by_key(free, key)
        for text in left.keys() & right.keys():
            own, theirs = left[text], right[text]
            if len(own) == len(theirs) == 1:
                named[own[0]] = theirs[0]
                by_step[step] = by_step.get(step, 0) + 1
            else:
                conflicts.setdefault((*sorted(own), *sorted(set(theirs) - set(own))), step)
        for name in [name for name in open_names if name in named]:
            del open_names[name]
            free.pop(named[name], None)
    ambiguous = tuple(sorted((step, names) for names, step in conflicts.items() if not all(n in named for n in names)))
    return Matching(named, by_step, tuple(open_names), ambiguous)


def _by_key(names: Iterable[str], key: Callable[[str], str]) -> dict[str, list[str]]:
    grouped: dict[str, list[str]] = {}
    for name in names:
        grouped.setdefault(key(name), []).append(name)
    return grouped
