"""Strict YAML: the 1.2 core schema without surprises, and the place of every value.

Differences from the core schema: a number with a leading zero (`0123`, also `0x1F`) stays text, and the keys of
mappings are text as written, so that ids survive (`1:` is "1", `007:` is "007"). `{block}` gives {"block": None}.
Duplicate keys, anchors, aliases, tags, several documents, more than 1 MiB and more than 32 levels are refused.

The parser's events are put together here without recursion, so that no input can exhaust the stack.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import yaml

from aatri.errors import AatriError, ResourceError, SpecError
from aatri.ids import clipped, did_you_mean
from aatri.regular_file import is_of_the_machine, leads_nowhere, open_regular
from aatri.units import beyond_range

MAX_BYTES = 1 << 20
MAX_DEPTH = 32
MAX_DIGITS = 300

_PARSER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_NULL = re.compile(r"null|Null|NULL|~|")
_BOOL = re.compile(r"(true|True|TRUE)|false|False|FALSE")
_INT = re.compile(r"[-+]?(0|[1-9][0-9]*)", re.ASCII)
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|(0|[1-9][0-9]*)(\.[0-9]*)?)([eE][-+]?[0-9]+)?", re.ASCII)
_INF = re.compile(r"([-+]?)(\.inf|\.Inf|\.INF)")
_NAN = re.compile(r"\.nan|\.NaN|\.NAN")


@dataclass(frozen=True)
class Document:
    """A YAML document: `value` is plain data; `where` and `text` tell of the node at a path of keys."""

    name: str
    value: Any
    _root: _Node = field(repr=False)
    _error: type[AatriError] = field(repr=False)

    def where(self, *keys: str | int) -> str:
        """`file:line:column` of the value at these keys; of the last one on the way that exists."""
        node = self._root
        for key in keys:
            child = _child(node, key)
            if child is None:
                break
            node = child
        return _place(self.name, node.line, node.column)

    def where_key(self, *keys: str | int) -> str:
        """`file:line:column` of the key itself, for messages about its name."""
        parent = self._root
        for key in keys[:-1]:
            parent = _child(parent, key) or parent
        place = parent.key_places.get(str(keys[-1])) if keys else None
        return _place(self.name, *place) if place else self.where(*keys)

    def text(self, *keys: str | int) -> str:
        """The scalar at these keys as written: `[A, 0012, 12]` has the texts A, 0012 and 12.

        Raises
        ------
        AatriError
            Of the class given to `load`, if there is no scalar at these keys.
        """
        node: _Node | None = self._root
        for key in keys:
            node = _child(node, key) if node else None
        if node is None or node.text is None:
            path = ".".join(str(key) for key in keys)
            raise self._error(f"{path or 'the document'} is not a single value", where=self.where(*keys))
        return node.text


def load(path: Path, error: type[AatriError] = SpecError) -> Document:
    """Read a file.

    Parameters
    ----------
    error : type of AatriError
        Class of every error raised; its exit code is that of the file's role.
    """
    name = str(path)
    try:
        if path.is_dir():
            raise error("is a folder, not a file", where=name)
        with open_regular(path) as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError as missing:
        if target := leads_nowhere(path):
            raise error(f"is a link to {target}, which is not there", where=name, remedy="mend the link") from missing
        raise error("no such file", where=name, remedy=_nearest(path)) from missing
    except (OSError, ValueError) as failure:
        if isinstance(failure, OSError) and is_of_the_machine(failure):
            raise ResourceError(f"cannot be read: {failure.strerror}", where=name, remedy="check the disk") from failure
        raise error(f"cannot be read: {getattr(failure, 'strerror', None) or failure}", where=name) from failure
    if len(data) > MAX_BYTES:
        raise error(f"larger than {MAX_BYTES} bytes", where=name, remedy="put large data into tables")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as failure:
        line = data.count(b"\n", 0, failure.start) + 1
        raise error("not UTF-8 text", where=f"{name}:{line}:1", remedy="save the file as UTF-8") from failure
    return loads(text, name, error)


def loads(text: str, name: str = "<text>", error: type[AatriError] = SpecError) -> Document:
    """Read a text; `name` stands for the file in messages."""
    if len(text) > MAX_BYTES:
        raise error(f"larger than {MAX_BYTES} bytes", where=name, remedy="put large data into tables")
    try:
        root = _compose(yaml.parse(text, Loader=_PARSER), _Source(name, error))
    except yaml.MarkedYAMLError as failure:
        _raise_readable(failure, text, name, error)
    except (yaml.YAMLError, UnicodeError) as failure:
        position = getattr(failure, "position", None) or 0
        line = text.count("\n", 0, position) + 1
        raise error("a character that YAML does not allow", where=f"{name}:{line}:1") from failure
    return Document(name, _value(root, _Source(name, error)), root, error)


@dataclass(slots=True)
class _Node:
    """Scalar (`text`), mapping or list (`items`), with its place (from 1)."""

    line: int
    column: int
    text: str | None = None
    plain: bool = False
    items: dict[str, _Node] | list[_Node] | None = None
    key_places: dict[str, tuple[int, int]] = field(default_factory=dict)


@dataclass(frozen=True)
class _Source:
    name: str
    error: type[AatriError]

    def fail(self, what: str, line: int, column: int, remedy: str = "") -> NoReturn:
        raise self.error(what, where=_place(self.name, line, column), remedy=remedy)


def _compose(events: Iterator[Any], source: _Source) -> _Node:
    root: _Node | None = None
    open_nodes: list[_Node] = []
    open_keys: list[str | None] = []  # per open mapping: the key that waits for its value
    for event in events:
        line, column = event.start_mark.line + 1, event.start_mark.column + 1
        if isinstance(event, yaml.CollectionEndEvent):
            open_nodes.pop()
            open_keys.pop()
            continue
        if isinstance(event, yaml.DocumentStartEvent) and root is not None:
            source.fail("a second document", line, column, remedy="remove the line `---`")
        if not isinstance(event, yaml.NodeEvent):
            continue
        _refuse_extras(event, source, line, column)
        parent = open_nodes[-1] if open_nodes else None
        if parent is not None and isinstance(parent.items, dict) and open_keys[-1] is None:
            open_keys[-1] = _new_key(event, parent, source, line, column)
            continue
        node = _node(event, line, column)
        if parent is None:
            root = node
        elif isinstance(parent.items, list):
            parent.items.append(node)
        elif isinstance(parent.items, dict):
            parent.items[str(open_keys[-1])] = node
            open_keys[-1] = None
        if node.items is not None:
            if len(open_nodes) == MAX_DEPTH:
                source.fail(f"nested deeper than {MAX_DEPTH} levels", line, column)
            open_nodes.append(node)
            open_keys.append(None)
    return root or _Node(1, 1, text="", plain=True)


def _node(event: Any, line: int, column: int) -> _Node:
    if isinstance(event, yaml.ScalarEvent):
        return _Node(line, column, text=event.value, plain=event.implicit[0])
    return _Node(line, column, items={} if isinstance(event, yaml.MappingStartEvent) else [])


def _refuse_extras(event: Any, source: _Source, line: int, column: int) -> None:
    if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
        sign = "*" if isinstance(event, yaml.AliasEvent) else "&"
        source.fail(
            f"{sign}{clipped(event.anchor)}: anchors and aliases are not allowed",
            line,
            column,
            remedy="write the value out, or put a text that begins with & or * in quotes",
        )
    if event.tag is not None:
        source.fail(
            f"{clipped(event.tag)}: tags are not allowed",
            line,
            column,
            remedy="remove it, or put a text that begins with ! in quotes",
        )


def _new_key(event: Any, parent: _Node, source: _Source, line: int, column: int) -> str:
    if not isinstance(event, yaml.ScalarEvent) or not event.value:
        source.fail("a key must be a single name", line, column, remedy="write `name: value`")
    key: str = event.value
    if key in parent.key_places:
        source.fail(
            f"key {clipped(key)!r} given twice, first in line {parent.key_places[key][0]}",
            line,
            column,
            remedy="remove one of them",
        )
    parent.key_places[key] = (line, column)
    return key


def _value(node: _Node, source: _Source) -> Any:
    if isinstance(node.items, dict):
        return {key: _value(child, source) for key, child in node.items.items()}
    if isinstance(node.items, list):
        return [_value(child, source) for child in node.items]
    return _scalar(node, source)


def _scalar(node: _Node, source: _Source) -> Any:
    text = node.text or ""
    if not node.plain:
        return text
    if _NULL.fullmatch(text):
        return None
    if match := _BOOL.fullmatch(text):
        return match.group(1) is not None
    if _NAN.fullmatch(text):
        return float("nan")
    if match := _INF.fullmatch(text):
        return float(f"{match.group(1)}inf")
    if not _FLOAT.fullmatch(text):
        return text
    if len(text) > MAX_DIGITS:
        source.fail(f"a number of {len(text)} digits", node.line, node.column, remedy="put a text in quotes")
    number = int(text) if _INT.fullmatch(text) else float(text)
    if beyond := beyond_range(text, number):
        source.fail(f"{clipped(text)} is {beyond}", node.line, node.column, remedy="put a text in quotes")
    return number


def _child(node: _Node, key: str | int) -> _Node | None:
    if isinstance(node.items, dict):
        return node.items.get(str(key))
    if isinstance(node.items, list) and isinstance(key, int) and 0 <= key < len(node.items):
        return node.items[key]
    return None


def _place(name: str, line: int, column: int) -> str:
    return f"{name}:{line}:{column}"


def _raise_readable(failure: yaml.MarkedYAMLError, text: str, name: str, error: type[AatriError]) -> NoReturn:
    mark = failure.problem_mark or failure.context_mark
    line, column = (mark.line + 1, mark.column + 1) if mark else (1, 1)
    lines = text.splitlines()
    rest = lines[line - 1][column - 1 :] if line <= len(lines) else ""
    if rest.startswith("\t"):
        what, remedy = "a tab", "indent with spaces"
    elif "maximum nesting depth" in str(failure.problem or failure.context):  # of PyYAML itself, since 6.0.4
        what, remedy = f"nested deeper than {MAX_DEPTH} levels", ""
    elif rest[:1] in ("%", "@", "`"):
        what, remedy = f"a value may not begin with {rest[0]!r}", "put it in quotes"
    else:
        context = f" {failure.context}" if failure.context else ""
        what, remedy = f"not YAML:{context} {failure.problem or ''}".rstrip(), "check brackets, quotes and indentation"
    raise error(clipped(what, 500), where=_place(name, line, column), remedy=remedy) from failure


def _nearest(path: Path) -> str:
    try:
        siblings = sorted(entry.name for entry in path.parent.iterdir())
    except (OSError, ValueError):
        return f"there is no folder {path.parent}"
    near = did_you_mean(path.name, siblings).removeprefix(" - ")
    return near or "check the path"
