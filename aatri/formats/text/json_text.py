"""A JSON document and the line of every value.

Strict: UTF-8, no key twice in an object, no NaN or Infinity, numbers within what a quantity can be. The value is read
at once; the places of its parts are looked up only when they are asked for, by skipping over what lies before them.
"""

import json
from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property
from json.decoder import WHITESPACE, scanstring  # type: ignore[attr-defined]
from pathlib import Path
from typing import Any, NoReturn, cast

from aatri.errors import InputError
from aatri.formats.text.text_file import read_bytes
from aatri.ids import clipped
from aatri.units import beyond_range

Key = str | int

OF_KIND = {dict: "an object {...}", list: "a list [...]", str: "a text", int: "a number", float: "a number"}


class JsonText:
    """A JSON document.

    Parameters
    ----------
    expected : str
        What is to be given instead where it is no JSON.

    Raises
    ------
    InputError
        If it is no strict JSON; the message names line and character.
    """

    def __init__(self, path: Path, expected: str) -> None:
        self.path, self._expected = path, expected
        data = read_bytes(path)
        try:
            self.text = data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = 1 + data.count(b"\n", 0, error.start)
            raise InputError("not UTF-8", where=f"{path}:{line}", remedy="save the file as UTF-8") from error
        try:
            self.value: Any = json.loads(
                self.text,
                object_pairs_hook=self._object,
                parse_constant=self._constant,
                parse_float=self._float,
                parse_int=self._whole,
            )
        except InputError:
            raise
        except json.JSONDecodeError as error:
            where = f"{path}:{error.lineno}:{error.colno}"
            raise InputError(f"no JSON: {error.msg}", where=where, remedy=f"give {expected}") from error
        except (RecursionError, ValueError) as error:
            raise InputError(f"no JSON: {clipped(str(error))}", where=str(path), remedy=f"give {expected}") from error

    def _object(self, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        made = dict(pairs)
        if len(made) < len(pairs):
            seen: set[str] = set()
            twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
            quoted = json.dumps(twice)
            line = 1 + self.text.count("\n", 0, self.text.rfind(quoted if quoted in self.text else twice))
            what = f"{clipped(twice)!r} stands twice in one object"
            raise InputError(what, where=f"{self.path}:{line}", remedy="remove one, or give it another name")
        return made

    def _constant(self, text: str) -> NoReturn:
        line = 1 + self.text.count("\n", 0, max(self.text.find(text), 0))
        raise InputError(f"{text} is no number", where=f"{self.path}:{line}", remedy="leave out what is not known")

    def _float(self, text: str) -> float:
        value = float(text)
        if beyond := beyond_range(text, value):
            line = 1 + self.text.count("\n", 0, max(self.text.find(text), 0))
            raise InputError(f"{clipped(text)} is {beyond}", where=f"{self.path}:{line}", remedy="mend the number")
        return value

    def _whole(self, text: str) -> int:
        self._float(text)
        return int(text)

    @cached_property
    def _line_ends(self) -> list[int]:
        ends, at = [], self.text.find("\n")
        while at >= 0:
            ends.append(at)
            at = self.text.find("\n", at + 1)
        return ends

    def line(self, *keys: Key) -> int:
        """The line of the value at these keys; of the last one on the way that exists."""
        at = 0
        for key in keys:
            place = self._children(at).get(key)
            if place is None:
                break
            at = place
        return self._line_at(at)

    def lines(self, *keys: Key) -> dict[Key, int]:
        """The line of every part of the object or list at these keys."""
        at = 0
        for key in keys:
            at = self._children(at)[key]
        return {key: self._line_at(place) for key, place in self._children(at).items()}

    def where(self, *keys: Key) -> str:
        """`file:line` of the value at these keys."""
        return f"{self.path}:{self.line(*keys)}"

    def fault(self, keys: Sequence[Key], what: str, remedy: str) -> InputError:
        """An error at the value of these keys."""
        return InputError(what, where=self.where(*keys), remedy=remedy)

    def get(self, kind: type, *keys: Key, default: Any = ...) -> Any:
        """The value at these keys, which must be of a kind: dict, list, str, int, float (whole numbers too).

        Raises
        ------
        InputError
            If it is not there and has no default, or is of another kind.
        """
        value = self.value
        for depth, key in enumerate(keys):
            inside = value.get(key) if isinstance(value, dict) else None
            if isinstance(value, list) and isinstance(key, int) and key < len(value):
                inside = value[key]
            if inside is None:
                if default is not ... and depth == len(keys) - 1:
                    return default
                raise self.fault(keys[:depth], f"{clipped(str(key))!r} is missing", f"give {self._expected}, whole")
            value = inside
        allowed = (int, float) if kind is float else kind
        if not isinstance(value, allowed) or isinstance(value, bool):
            what = f"{clipped(str(keys[-1])) if keys else 'the document'!r} is not {OF_KIND[kind]}"
            raise self.fault(keys, what, f"give {self._expected}")
        return float(cast(float, value)) if kind is float else value

    def numbers(self, *keys: Key, count: int) -> list[float]:
        """The list of so many numbers at these keys."""
        values = self.get(list, *keys)
        if len(values) != count or any(isinstance(v, bool) or not isinstance(v, int | float) for v in values):
            raise self.fault(keys, f"{clipped(str(keys[-1]))!r} is not a list of {count} numbers", "export it again")
        return [float(v) for v in values]

    def _line_at(self, offset: int) -> int:
        return 1 + bisect_right(self._line_ends, offset)

    def _children(self, at: int) -> dict[Key, int]:
        """Where the parts of the object or list at a place begin."""
        text, places = self.text, dict[Key, int]()
        decode = json.JSONDecoder().raw_decode
        at = _next(text, at)
        if text[at] not in "[{":
            return places
        is_object, at = text[at] == "{", _next(text, at + 1)
        while text[at] not in "]}":
            key: Key = len(places)
            if is_object:
                key, at = scanstring(text, at + 1, True)
                at = _next(text, _next(text, at) + 1)
            places[key] = at
            _, at = decode(text, at)
            at = _next(text, at)
            at = _next(text, at + 1) if text[at] == "," else at
        return places


def _next(text: str, at: int) -> int:
    """The place of the next sign that is no blank."""
    blank = WHITESPACE.match(text, at)
    return blank.end() if blank else at
