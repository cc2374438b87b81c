"""The reference pages say what the program has: every column of every artifact, every option of every stage.

APPROVE=1 pytest tests/acceptance/test_reference_pages.py     writes them anew; read the difference before committing

A column that changes its type, unit or meaning needs another `schema_version`; an option or default that changes what a
stage gives needs another `version` and a line in the CHANGELOG.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import pytest

from aatri.artifacts.kinds import KINDS
from aatri.pipeline.methods.registry import Registry, find_stages
from aatri.plugin import StageCard
from aatri.tables.checked_column import Column
from aatri.tables.schema import Artifact, attributes_of, columns_of, may_be_absent, tables_of

PAGES = Path(__file__).parents[2] / "docs" / "reference"
WRITTEN = "<!-- written by APPROVE=1 pytest tests/acceptance/test_reference_pages.py -->"

ARTIFACTS = (
    "Every table and column of every kind of artifact, as `aatri show FILE` lists them and `aatri schema --artifacts`",
    "exports them. `?`: may be missing (NaN, or -1 in a row number). Every table names its class, imported from the",
    "module of its kind unless another is given; columns are arrays, rows of another table are numbers from 0.",
)
STAGES = (
    "Every variant with its ports, what it uses of a block, and its options, as `aatri stages ROLE/VARIANT` prints",
    "them.",
)


def artifacts_page() -> str:
    """Tables and columns of all kinds."""
    lines = ["# Artifacts", "", WRITTEN, "", *ARTIFACTS, ""]
    for kind in sorted(KINDS.values(), key=lambda k: k.kind):
        lines += [f"## {kind.kind}", "", f"Schema {kind.schema_version}. {_first(kind)}", ""]
        lines += [f"`from {kind.__module__} import {kind.__name__}`", "", *_attributes(kind)]
        for name, table in tables_of(kind).items():
            may = ", optional" if may_be_absent(kind, name) else ""
            lines += [
                f"### `{name}`{may}",
                "",
                _class(table, kind),
                "",
                "| column | type | unit | |",
                "|---|---|---|---|",
            ]
            lines += [_column(n, c) for n, c in columns_of(table).items()] + [""]
    return "\n".join(lines)


def stages_page(registry: Registry) -> str:
    """Ports, uses and options of all variants."""
    lines = ["# Stages", "", WRITTEN, "", *STAGES, ""]
    for name in sorted(registry.variants):
        card = registry.card(name)
        ports = [f"{p.name}: {p.kind.kind}{' (optional)' if p.optional else ''}" for p in card.ports]
        lines += [f"## `{name}`", "", f"{card.doc.partition(chr(10))[0]} Version {card.version}.", ""]
        lines += [f"({', '.join(ports) or 'nothing'}) → {card.kind.kind}", "", *_uses(card), *_options(card)]
    return "\n".join(lines)


def _class(table: type, kind: type[Artifact]) -> str:
    place = f" (`{table.__module__}`)" if table.__module__ != kind.__module__ else ""
    return f"`{table.__name__}`{place}: {_first(table)}"


def _first(documented: type) -> str:
    return (documented.__doc__ or "").strip().partition("\n")[0]


def _attributes(kind: type[Artifact]) -> list[str]:
    hints = get_type_hints(kind)
    rows = [f"| `{n}` | {hints[n].__name__} | {a.unit} | {a.doc} |" for n, a in attributes_of(kind).items()]
    return ["| attribute | type | unit | |", "|---|---|---|---|", *rows, ""] if rows else []


def _column(name: str, c: Column) -> str:
    shape = "".join(f"[{n}]" for n in c.shape)
    more = [f"row in {c.refers}"] if c.refers and f"row in {c.refers}" not in c.doc else []
    more += [] if c.digest else ["enters no digest"]
    return f"| `{name}` | `{c.dtype}{shape}{'?' if c.optional else ''}` | {c.unit} | {'; '.join([c.doc, *more])} |"


def _uses(card: StageCard) -> list[str]:
    required = card.options and any(f.is_required() for f in card.options.model_fields.values())
    uses = None if required else card.used_with(card.options() if card.options else None)
    together: dict[str, list[str]] = {}
    for one in uses or ():  # those of one camera model in one
        model, dot, parameter = one.partition(".")
        several = one.startswith("camera_parameters:")
        together.setdefault(f"{model}{dot}" if several else one, []).extend([parameter] if several else [])
    listed = [f"`{name}{{{', '.join(parts)}}}`" if parts else f"`{name}`" for name, parts in together.items()]
    return [f"Uses: {', '.join(listed)}.", ""] if listed else []


def _options(card: StageCard) -> list[str]:
    if card.options is None:
        return []
    schema = card.options.model_json_schema()
    rows = [f"| `{name}` | {default} | {allowed} | {doc} |" for name, default, allowed, doc in _rows(schema, schema)]
    return ["| option | default | allowed | |", "|---|---|---|---|", *rows, ""]


def _rows(schema: dict[str, Any], root: dict[str, Any], before: str = "") -> Iterator[tuple[str, str, str, str]]:
    """Option, default, what is allowed, meaning; nested ones by dotted names."""
    for name, told in schema.get("properties", {}).items():
        nested = [part for part in _parts(told, root) if "properties" in part]
        default = "required" if name in schema.get("required", ()) else f"`{told.get('default')!r}`"
        allowed = " or ".join(dict.fromkeys(_allowed(part) for part in _parts(told, root) if "properties" not in part))
        yield before + name, default if not nested else "", allowed, told.get("description", "").replace("|", "\\|")
        for part in nested:
            yield from _rows(part, root, f"{before}{name}.")


def _parts(told: dict[str, Any], root: dict[str, Any]) -> list[dict[str, Any]]:
    """What a property may be, references followed."""
    if "$ref" in told:
        return _parts(root["$defs"][told["$ref"].rpartition("/")[2]], root)
    for key in ("anyOf", "oneOf", "allOf"):
        if key in told:
            return [part for one in told[key] for part in _parts(one, root)]
    return [told]


def _allowed(part: dict[str, Any]) -> str:
    if "enum" in part or "const" in part:
        return ", ".join(str(v) for v in part.get("enum", [part.get("const")]))
    signs = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}
    signs |= {"minItems": "at least", "maxItems": "at most", "minLength": "length >=", "pattern": "like"}
    bounds = [f"{sign} {part[key]}" for key, sign in signs.items() if key in part]
    return " ".join([str(part.get("type", "anything")), *bounds])


@pytest.mark.parametrize("name", ["artifacts", "stages"])
def test_the_reference_page_is_what_the_program_has(name: str) -> None:
    found = artifacts_page() if name == "artifacts" else stages_page(find_stages(None))
    page = PAGES / f"{name}.md"
    if os.environ.get("APPROVE"):
        page.write_text(found, encoding="utf-8")
    assert page.read_text(encoding="utf-8") == found
