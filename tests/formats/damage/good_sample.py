"""A small good file of a format, and the twelve ways in which it is damaged."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from aatri.formats.parts.format import Reading

PAGE = "<!DOCTYPE html>\n<html><head><title>404 Not Found</title></head></html>\n"
ENTITIES = '<?xml version="1.0"?>\n<!DOCTYPE a [<!ENTITY x "yyyyyyyyyy"><!ENTITY z "&x;&x;&x;&x;">]>\n'

Change = tuple[str, str]
"""What is replaced, once, and by what; an empty first text: the whole file."""


@dataclass(frozen=True)
class GoodSample:
    """A file or folder of a format, and where it is damaged.

    Attributes
    ----------
    files : mapping of str to str or bytes
        Of the folder.
    file : str
        The one that is damaged.
    number : str
        A number with a point between brackets and what stands about it: `<K1>[0.1]`. There the file is cut off, and
        the number becomes `nan` and gets a decimal comma.
    name : str
        An id: it gets a letter of another encoding.
    version, section, twice, unit : Change
        Another version or layout, something missing, an id twice, another unit. A text alone is the reason why this
        cannot be seen in the file.
    outside : Change, optional
        A file that is named outside of the folder; without, the format names no files, and the file is a link that
        leads nowhere.
    path : str
        What is read; "": the folder.
    packed : bool
        The file is a zip archive of its one member `doc.xml`.
    """

    files: Mapping[str, str]
    file: str
    number: str
    name: str
    version: Change
    section: Change
    twice: Change | str
    unit: Change | str
    outside: Change | None = None
    path: str | None = None
    reading: Reading = Reading()
    packed: bool = False

    @property
    def text(self) -> str:
        """The text of the damaged file."""
        return self.files[self.file]

    def write(self, folder: Path, change: Callable[[str], str | bytes] = lambda text: text) -> Path:
        """Write the files, one of them changed; what is to be read."""
        for name, text in self.files.items():
            made = change(text) if name == self.file else text
            data = made if isinstance(made, bytes) else made.encode()
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(zip_of("doc.xml", data) if self.packed and name == self.file else data)
        return folder / (self.file if self.path is None else self.path)


def zip_of(name: str, data: bytes) -> bytes:
    """A zip archive of one member."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, data)
    return file.getvalue()


def replaced(text: str, change: Change) -> str:
    """A text in which something is replaced once, which must be there."""
    old, new = change
    assert old in text, f"{old!r} is not in the sample"
    return text.replace(old, new, 1) if old else new


def _of_number(new: Callable[[str], str], *, cut: bool = False) -> Callable[[GoodSample], str]:
    def damaged(sample: GoodSample) -> str:
        bare = re.sub(r"[\[\]]", "", sample.number)
        number = sample.number[sample.number.index("[") + 1 : sample.number.index("]")]
        assert sample.text.count(bare), f"{bare!r} is not in the sample"
        start = sample.text.index(bare) + sample.number.index("[")
        return sample.text[:start] + ("" if cut else new(number) + sample.text[start + len(number) :])

    return damaged


def _encoded(sample: GoodSample) -> bytes:
    assert sample.name in sample.text
    return sample.text.encode().replace(sample.name.encode(), sample.name.encode() + b"\xfc", 1)


def _entities(sample: GoodSample) -> str:
    """Entities of its own before the root, one of them in place of an id; where the format is no XML, instead of it."""
    body = re.sub(r"^\s*<\?xml[^>]*\?>\s*", "", sample.text)
    return ENTITIES + (replaced(body, (sample.name, "&z;")) if body.startswith("<") else "<a>&z;</a>\n")


DAMAGES: dict[str, Callable[[GoodSample], str | bytes]] = {
    "truncated": _of_number(str, cut=True),
    "other encoding": _encoded,
    "wrong version": lambda s: replaced(s.text, s.version),
    "missing section": lambda s: replaced(s.text, s.section),
    "duplicated ids": lambda s: replaced(s.text, s.twice) if isinstance(s.twice, tuple) else s.text,
    "NaN": _of_number(lambda _: "nan"),
    "wrong unit": lambda s: replaced(s.text, s.unit) if isinstance(s.unit, tuple) else s.text,
    "decimal comma": _of_number(lambda number: number.replace(".", ",")),
    "web page": lambda _: PAGE,
    "XML entities": _entities,
    "zip bomb": lambda s: bytes(40 << 20) if s.packed else zip_of("data", bytes(40 << 20)),
    "path outside": lambda s: replaced(s.text, s.outside) if s.outside else s.text,
}
"""The twelve damages."""

WITHOUT_LINE = ("missing section", "web page", "zip bomb", "path outside")
"""Damages of a whole file, which no line may have."""
