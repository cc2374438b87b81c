"""Ids are text. They are stored once per table, sorted by their UTF-8 bytes, and referred to by int32 rows."""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Collection, Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING, Any

from aatri.errors import InputError

if TYPE_CHECKING:  # numpy is imported where rows are made, so that the command line starts without it
    import numpy.typing as npt

    from aatri.arrays import Bool, Int, Text

MAX_BYTES = 255
"""Longest id, in UTF-8 bytes."""
OF_IDS = "at most 255 bytes, no control characters, no outer blanks"
"""What an id is, for messages."""
MAX_COMPARED_LENGTH, MOST_LOOKED_AT, MOST_COMPARED = 80, 5000, 100
"""Bounds of the search for the nearest name."""
SHORTEST_WORD = 3
"""Letters of a word that is taken for the beginning of a name; one or two begin too many."""


def canonical(ids: Iterable[str]) -> list[str]:
    """The distinct ids in canonical order: by their UTF-8 bytes, so that the order of input never matters.

    Examples
    --------
    >>> canonical(["12", "7", "12"])
    ['12', '7']
    """
    return sorted(set(ids), key=lambda text: text.encode("utf-8"))


def rows_of(ids: Sequence[str] | npt.NDArray[Any], table: Sequence[str] | npt.NDArray[Any]) -> Int:
    """Row of each id in a table of ids; -1 where it is not there.

    Parameters
    ----------
    ids : (n,) str
    table : (m,) str, distinct

    Returns
    -------
    (n,) int32
    """
    import numpy as np

    if not len(ids):  # tables may be long, and most blocks have no such observations
        return np.zeros(0, dtype=np.int32)
    texts, of_table = (one.tolist() if isinstance(one, np.ndarray) else map(str, one) for one in (ids, table))
    row = dict(zip(of_table, itertools.count()))
    return np.array([row.get(text, -1) for text in texts], dtype=np.int32)


def matching(kind: str, ids: Text, patterns: Iterable[str], where: str = "") -> Bool:
    """Whether each id is like one of the patterns (`*`, `?`, `[abc]`).

    Parameters
    ----------
    kind : str
        What has the ids, for messages.
    ids : (n,) str
    where : str
        The option with the patterns, for messages.

    Returns
    -------
    (n,) bool

    Raises
    ------
    InputError
        If no id is like one of the patterns.
    """
    import numpy as np

    texts, like_any = ids.tolist(), np.zeros(len(ids), dtype=bool)
    for pattern in patterns:
        like = np.array([fnmatchcase(text, pattern) for text in texts], dtype=bool)
        if not like.any():
            first = ", ".join(map(printable, texts[:5]))
            remedy = f"the block has {several(len(texts), kind)}: {first} ..."
            raise InputError(f"no {kind} has an id like {printable(pattern)}", where=where, remedy=remedy)
        like_any |= like
    return like_any


def natural_order(texts: Sequence[str] | npt.NDArray[Any]) -> Int:
    """Rows of texts in the order in which one counts: strip 2 before strip 10.

    Returns
    -------
    (n,) int64

    Examples
    --------
    >>> natural_order(["strip 10", "strip 2"]).tolist()
    [1, 0]
    """
    import re

    import numpy as np

    parts = [re.split(r"(\d+)", str(text)) for text in texts]  # text and numbers by turns, text first
    keys = [[int(part) if k % 2 else part for k, part in enumerate(one)] for one in parts]
    return np.array(sorted(range(len(keys)), key=lambda k: keys[k]), dtype=np.int64)


def is_valid(text: str) -> bool:
    """Whether the text may serve as an id: not empty, at most 255 bytes, no control characters, no outer blanks."""
    return bool(text) and text == text.strip() and len(text.encode("utf-8")) <= MAX_BYTES and text.isprintable()


def invalid(texts: Collection[str]) -> list[str]:
    """Those of the texts that may not serve as ids; quick where there are none."""
    listed = list(texts)
    together = "\n".join(listed)
    plain = together.replace("\n", "").isprintable() and together.count("\n") == max(len(listed) - 1, 0)
    inner = not any(blank in f"\n{together}\n" for blank in ("\n ", " \n", "\n\n"))
    if not listed or (plain and inner and 4 * max(map(len, listed)) <= MAX_BYTES):
        return []
    return [text for text in listed if not is_valid(text)]


def shown(texts: Iterable[str], most: int = 20) -> str:
    """A list of ids for a message: the first ones and how many more there are.

    Examples
    --------
    >>> shown(["a", "b", "c"], most=2)
    'a, b and 1 more'
    """
    listed = [printable(text) for text in texts]
    more = f" and {len(listed) - most} more" if len(listed) > most else ""
    return ", ".join(listed[:most]) + more


def amounts(counts: Mapping[str, Any]) -> str:
    """Counts by plural names, without those that are 0: `15 images, 1 check point`."""
    return ", ".join(several(n, name.replace("_", " ").removesuffix("s")) for name, n in counts.items() if n)


def several(n: int, noun: str, one: str = "", more: str = "") -> str:
    """`1 point` or `3 points`; with a verb that stands beside them, `1 point lies`, `3 points lie`.

    Examples
    --------
    >>> several(1, "point"), several(3, "point")
    ('1 point', '3 points')
    """
    words = f"{n} {noun}" if n == 1 else f"{n} {noun}s"
    return f"{words} {one if n == 1 else more}".rstrip()


def printable(text: str) -> str:
    """The text with control characters escaped, so that an id cannot drive the terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def utf8(text: str) -> str:
    """The text with what UTF-8 does not have escaped: bytes of file names in other encodings."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def clipped(text: str, most: int = 100) -> str:
    """The text for a message, control characters escaped, cut to its first characters."""
    shown = printable(text[: most + 1])
    return shown if len(text) <= most else f"{shown[:most]}... ({len(text)} characters)"


def did_you_mean(text: str, names: Iterable[str]) -> str:
    """` - did you mean 'x'?`, or nothing if no known name is near.

    Only names of about the same length with a like beginning or end are compared, and at most `MOST_COMPARED` of them:
    comparing a thousand unknown ids with a thousand known ones would take minutes. A word cut short is near what it
    begins (`max_iter`); a number is not, point 101 is no part of point 101001.

    Examples
    --------
    >>> did_you_mean("pricipal_point", ["principal_point", "format"])
    " - did you mean 'principal_point'?"
    """
    if not 0 < len(text) <= MAX_COMPARED_LENGTH:
        return ""
    head, tail, reach = text[:1].casefold(), text[-1:].casefold(), max(2, len(text) // 2)
    candidates = list(itertools.islice(names, MOST_LOOKED_AT))
    alike = [
        name
        for name in candidates
        if abs(len(name) - len(text)) <= reach and (name[:1].casefold() == head or name[-1:].casefold() == tail)
    ]
    other_case = [name for name in alike if name.casefold() == text.casefold()]
    near = other_case[:1] or difflib.get_close_matches(text, alike[:MOST_COMPARED], n=1, cutoff=0.6)
    if not near and len(text) >= SHORTEST_WORD and text.replace("_", "").isalpha():  # ids count on: P1, P10, P101
        near = [name for name in candidates if name.casefold().startswith(text.casefold())][:1]
    return f" - did you mean {near[0]!r}?" if near else ""
