"""`aatri schema`: JSON Schema of pipeline.yaml, for editors, and of all kinds of artifact."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aatri.cli.arguments.completion import complete_path
from aatri.cli.arguments.options import LocalPlugins, local_stages
from aatri.cli.terminal.console import reports_errors, say, say_json
from aatri.errors import ResourceError, SpecError

if TYPE_CHECKING:
    from aatri.pipeline.methods.registry import Registry
    from aatri.plugin import StageCard
    from aatri.tables.checked_column import Column
    from aatri.tables.schema import Artifact, Table

DIALECT = "https://json-schema.org/draft/2020-12/schema"
NAME = "^[a-z][a-z0-9_]*$"


@reports_errors
def schema(
    pipeline: Annotated[
        bool, typer.Option("--pipeline", help="Of pipeline.yaml, with the options of every stage (default).")
    ] = False,
    artifacts: Annotated[bool, typer.Option("--artifacts", help="Of all kinds of artifact.")] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", autocompletion=complete_path, help="Write to a file.")
    ] = None,
    local_plugins: LocalPlugins = False,
) -> None:
    """Export JSON Schema of pipeline.yaml or of the artifacts."""
    from aatri.pipeline.methods.registry import find_stages

    if pipeline and artifacts:
        raise SpecError("--pipeline and --artifacts together", remedy="export them one after the other")
    registry = find_stages(local_stages(local_plugins))
    exported = artifacts_schema(registry) if artifacts else pipeline_schema(registry)
    if out is None:
        say_json(exported)
        return
    try:
        out.write_text(json.dumps(exported, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise ResourceError(f"cannot write: {error.strerror}", where=str(out)) from error
    say(str(out))


_GATES = {
    "type": ["object", "null"],
    "description": "stage: metric: bounds that its figure is to keep, or off",
    "additionalProperties": {
        "type": "object",
        "minProperties": 1,
        "additionalProperties": {
            "oneOf": [
                {"const": "off"},
                {
                    "type": "object",
                    "minProperties": 1,
                    "additionalProperties": False,
                    "properties": {"min": {"type": "number"}, "max": {"type": "number"}},
                },
            ]
        },
    },
}


def pipeline_schema(registry: Registry) -> dict[str, Any]:
    """JSON Schema of a pipeline file: each stage's `from` and `with` as its `use` says."""
    cards = [registry.card(name) for name in sorted(registry.variants)]
    names = {"propertyNames": {"pattern": NAME}, "type": "object"}
    return {
        "$schema": DIALECT,
        "title": "aatri pipeline",
        "type": "object",
        "required": ["run", "stages"],
        "additionalProperties": False,
        "properties": {
            "run": {"type": "string", "minLength": 1, "description": "where results go; relative to this file"},
            "seed": {"type": "integer", "minimum": 0, "default": 1, "description": "of all random numbers"},
            "ignore": {
                "type": ["array", "null"],
                "items": {"type": "string"},
                "description": "what a block offers and no stage uses, knowingly: a warning instead of an error",
            },
            "stages": {**names, "minProperties": 1, "additionalProperties": {"$ref": "#/$defs/stage"}},
            "gates": {"$ref": "#/$defs/gates"},
            "variants": {
                "type": ["object", "null"],
                "description": "named patches of stages and gates",
                "additionalProperties": {
                    "type": ["object", "null"],
                    "properties": {"gates": {"$ref": "#/$defs/gates"}},
                    "additionalProperties": {"$ref": "#/$defs/patch"},
                },
            },
        },
        "$defs": {
            "gates": _GATES,
            "stage": {
                "type": "object",
                "$ref": "#/$defs/patch",
                "required": ["use"],
                "allOf": [{"if": _uses(card), "then": _needs(card)} for card in cards if _needs(card)],
            },
            "patch": {
                "type": ["object", "null"],
                "additionalProperties": False,
                "properties": {
                    "use": {"enum": [card.name for card in cards], "description": "the method: ROLE/VARIANT"},
                    "from": {"type": ["object", "null"], "description": "port: stage"},
                    "with": {"type": ["object", "null"], "description": "options"},
                },
                "allOf": [{"if": _uses(card), "then": _allows(card, registry)} for card in cards],
            },
            **{_key(card): _options_schema(card) for card in cards if card.options is not None},
        },
    }


def _uses(card: StageCard) -> dict[str, Any]:
    return {"properties": {"use": {"const": card.name}}, "required": ["use"]}


def _key(card: StageCard) -> str:
    return card.name.replace("/", ".")  # a slash would have to be escaped in references


def _allows(card: StageCard, registry: Registry) -> dict[str, Any]:
    """Ports of the role, also those that the variant leaves alone, and its options."""
    ports = {
        port: {"type": ["string", "null"], "description": f"stage that gives {kind.kind}"}
        for port, kind in registry.role(card.role).ports.items()
    }
    options = {"$ref": f"#/$defs/{_key(card)}"} if card.options else {"maxProperties": 0}
    return {
        "properties": {
            "use": {"description": card.doc.partition("\n")[0]},
            "from": {"properties": ports, "additionalProperties": False},
            "with": {"if": {"type": "object"}, "then": options},
        }
    }


def _needs(card: StageCard) -> dict[str, Any]:
    """What a stage cannot do without: ports and options that have no default."""
    ports = [port.name for port in card.ports if not port.optional]
    options = [n for n, field in card.options.model_fields.items() if field.is_required()] if card.options else []
    needs = {key: {"type": "object", "required": names} for key, names in (("from", ports), ("with", options)) if names}
    return {"required": list(needs), "properties": needs} if needs else {}


def _options_schema(card: StageCard) -> dict[str, Any]:
    assert card.options is not None
    made = card.options.model_json_schema(ref_template=f"#/$defs/{_key(card)}/$defs/{{model}}")
    made.pop("required", None)  # a patch need not repeat them; a stage does, see _needs
    return made


def artifacts_schema(registry: Registry) -> dict[str, Any]:
    """JSON Schema of all kinds of artifact that any role gives, from their declarations.

    A table is an object of columns, a column the list of its rows. In the HDF5 file a table is a group, a column a
    dataset; NaN and a row number -1, *not given*, are null here only for floats.
    """
    kinds = {role.kind for role in map(registry.role, registry.roles)}  # what a role takes, another gives
    return {
        "$schema": DIALECT,
        "title": "aatri artifacts",
        "oneOf": [{"$ref": f"#/$defs/{name}"} for name in sorted(kind.kind for kind in kinds)],
        "$defs": {kind.kind: _artifact_schema(kind) for kind in sorted(kinds, key=lambda kind: kind.kind)},
    }


def _artifact_schema(kind: type[Artifact]) -> dict[str, Any]:
    from typing import get_type_hints

    from aatri.tables.schema import attributes_of, may_be_absent, tables_of

    types = {str: "string", int: "integer", float: ["number", "null"], bool: "boolean"}
    hints, tables = get_type_hints(kind), tables_of(kind)
    attributes = {
        name: {"type": types[hints[name]], "description": about.doc} | ({"x-unit": about.unit} if about.unit else {})
        for name, about in attributes_of(kind).items()
    }
    head = {"kind": {"const": kind.kind}, "schema_version": {"const": kind.schema_version}}
    return {
        "type": "object",
        "description": _first_line(kind),
        "additionalProperties": False,
        "properties": {**head, **attributes, **{name: _table_schema(table) for name, table in tables.items()}},
        "required": [*head, *attributes, *(name for name in tables if not may_be_absent(kind, name))],
    }


def _table_schema(table: type[Table]) -> dict[str, Any]:
    from aatri.tables.schema import columns_of

    columns = columns_of(table)
    return {
        "type": "object",
        "description": _first_line(table),
        "additionalProperties": False,
        "properties": {name: _column_schema(column) for name, column in columns.items()},
        "required": list(columns),
    }


def _column_schema(column: Column) -> dict[str, Any]:
    kind = {"f": "number", "i": "integer", "b": "boolean", "s": "string"}[column.dtype[0]]
    nullable = column.optional and kind == "number"
    item: dict[str, Any] = {"type": [kind, "null"] if nullable else kind}
    if column.refers:
        item["minimum"] = -1 if column.optional else 0
    for length in reversed(column.shape):
        item = {"type": "array", "items": item, "minItems": length, "maxItems": length}
    about = {"x-unit": column.unit, "x-refers": column.refers}
    return {
        "type": "array",
        "items": item,
        "description": column.doc,
        "x-dtype": column.dtype,
        **{key: text for key, text in about.items() if text},
        **({} if column.digest else {"x-provenance": True}),
    }


def _first_line(cls: type) -> str:
    return (cls.__doc__ or "").strip().partition("\n")[0]
