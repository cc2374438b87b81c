"""Why a stage has to run: typed reasons, each with what was and what is."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from aatri.ids import several


class Why(StrEnum):
    """The kinds of reasons."""

    never_run = "never_run"
    options = "options"
    input = "input"
    file = "file"
    code = "code"
    plugin = "plugin"
    plugin_version = "plugin_version"
    schema = "schema"
    seed = "seed"
    output_missing = "output_missing"
    output_altered = "output_altered"
    interrupted = "interrupted"
    failed_before = "failed_before"
    forced = "forced"
    upstream_maybe = "upstream_maybe"


MOST_MODULES = 3
"""So many changed modules are named."""

_TEXTS = {
    Why.never_run: "never run",
    Why.output_missing: "its result is gone",
    Why.output_altered: "its result was altered",
    Why.interrupted: "interrupted before",
    Why.failed_before: "failed before",
    Why.forced: "forced",
    Why.plugin_version: "version of the method",
    Why.plugin: "method",
}


@dataclass(frozen=True)
class Reason:
    """A reason; `about` names the option, port or file, `old` and `new` are shortened to be read."""

    why: Why
    about: str = ""
    old: str = ""
    new: str = ""

    def __str__(self) -> str:
        if self.why is Why.upstream_maybe:
            return f"perhaps other {self.about}"
        if self.why is Why.file:
            return f"{self.about} {'is new' if not self.old else 'is gone' if not self.new else 'changed'}"
        if self.why is Why.input and self.old and self.new:
            return f"{self.why.value} {self.about} changed"
        head = " ".join(filter(None, (_TEXTS.get(self.why, self.why.value), self.about)))
        if self.old or self.new:
            return f"{head}: {self.old or '-'} -> {self.new or '-'}"
        return head

    def plain(self) -> dict[str, str]:
        """As JSON takes it."""
        return {**asdict(self), "why": self.why.value}


def differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> tuple[Reason, ...]:
    """The reasons by which the parts of two keys differ; inputs not known yet (None) are passed over."""
    return tuple(_differences(old, new))


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Reason]:
    if old.get("key_schema") != new["key_schema"]:
        yield Reason(Why.schema, "of keys", str(old.get("key_schema")), str(new["key_schema"]))
        return
    if old["plugin"] != new["plugin"]:
        yield Reason(Why.plugin, "", old["plugin"], new["plugin"])
    elif old["version"] != new["version"]:
        yield Reason(Why.plugin_version, "", str(old["version"]), str(new["version"]))
    for name, before, after in _changed(*flat_alike((old["options"], new["options"]))):
        if before is not None or after is not None:  # of a group of options, one that neither states
            yield Reason(Why.options, name, _shown(before), _shown(after))
    inputs = {port: digest for port, digest in new["inputs"].items() if digest is not None}
    before = {port: digest for port, digest in old["inputs"].items() if port in inputs or port not in new["inputs"]}
    for port, one, other in _changed(before, inputs):
        yield Reason(Why.input, port, (one or "")[:12], (other or "")[:12])
    for name, one, other in _changed(old["files"], new["files"]):
        option, _, file = name.partition("/")
        yield Reason(Why.file, file or f"file of {option}", (one or "")[:12], (other or "")[:12])
    if old["code"] != new["code"] and old["plugin"] == new["plugin"]:
        yield from _code(old, new)
    for kind, one, other in _changed(old["schemas"], new["schemas"]):
        if one is not None and other is not None:
            yield Reason(Why.schema, kind, str(one), str(other))
    if old["seed"] != new["seed"]:
        yield Reason(Why.seed, "", _shown(old["seed"]), _shown(new["seed"]))


def _code(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[Reason]:
    """Which modules have changed; where that is not known, that the code has."""
    before, after = old.get("modules") or {}, new.get("modules") or {}
    changed = [name for name, *_ in _changed(before, after)] if before and after else []
    if not changed:
        yield Reason(Why.code, "", old["code"][:12], new["code"][:12])
        return
    more = f" and {several(len(changed) - MOST_MODULES, 'more module')}" if len(changed) > MOST_MODULES else ""
    yield Reason(Why.code, f"of {', '.join(changed[:MOST_MODULES])}{more} changed")


def _changed(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    for name in sorted({*old, *new}):
        if old.get(name) != new.get(name) or (name in old) != (name in new):
            yield name, old.get(name), new.get(name)


def flat(options: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested options by dotted name."""
    flattened: dict[str, Any] = {}
    for name, value in options.items():
        if isinstance(value, dict) and value:
            flattened |= flat(value, f"{prefix}{name}.")
        else:
            flattened[prefix + name] = value
    return flattened


def flat_alike(runs: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Options of several runs by dotted name; a group that one of them does without is one option, told as a whole.

    Such groups are looked for on the first level alone, not within other groups.
    """
    groups = {name for options in runs for name, value in options.items() if value is None}
    return [
        flat({name: value for name, value in options.items() if name not in groups})
        | {name: _stated(value) for name, value in options.items() if name in groups}
        for options in runs
    ]


def _stated(value: Any) -> Any:
    return {name: each for name, each in value.items() if each is not None} if isinstance(value, dict) else value


def _shown(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 40 else f"{text[:37]}..."
