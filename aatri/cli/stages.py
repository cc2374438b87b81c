"""`aatri stages`: roles, variants, and all about one variant."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aatri.cli.arguments.completion import complete_role_or_variant
from aatri.cli.arguments.options import AsJson, LocalPlugins, local_stages
from aatri.cli.terminal.console import reports_errors, say, say_json, say_table
from aatri.errors import PluginError

if TYPE_CHECKING:
    from aatri.pipeline.methods.registry import Registry
    from aatri.plugin import StageCard


@reports_errors
def stages(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[ROLE[/VARIANT]]", autocompletion=complete_role_or_variant, help="A role or a variant."
        ),
    ] = None,
    json: AsJson = False,
    local_plugins: LocalPlugins = False,
) -> None:
    """List roles and their variants, or describe one variant: method, ports, options, where it comes from."""
    from aatri.pipeline.methods.registry import find_stages

    registry = find_stages(local_stages(local_plugins))
    if name and "/" in name:
        described = _described(registry.card(name)) | {"origin": _origin(registry, name)}
        if json:
            say_json(described)
        else:
            _say_variant(described)
        return
    listed = _listed(registry, name)
    if json:
        say_json(listed)
    else:
        _say_roles(listed)


def _listed(registry: Registry, only: str | None) -> dict[str, Any]:
    """Per role its ports, kind and variants; a role that cannot be loaded says so, if others are listed too."""
    listed: dict[str, Any] = {}
    for role in [only] if only else registry.roles:
        try:
            declared = registry.role(role)
        except PluginError as error:
            if only:
                raise
            listed[role] = {"broken": str(error), "variants": {}}
            continue
        listed[role] = {
            "ports": {port: kind.kind for port, kind in declared.ports.items()},
            "kind": declared.kind.kind,
            "variants": {name: _about(registry, name) for name in registry.variants_of(role)},
        }
    return listed


def _about(registry: Registry, name: str) -> dict[str, Any]:
    from aatri.pipeline.methods.registry import first_line

    return {"about": first_line(registry, name), **_origin(registry, name)}


def _origin(registry: Registry, name: str) -> dict[str, str]:
    origin = registry.origins.get(name)
    return {"source": origin.source, "place": origin.where} if origin else {"source": "", "place": ""}


def _say_roles(listed: dict[str, Any]) -> None:
    for role, about in listed.items():
        if "broken" in about:
            say(f"{role}: (broken) {about['broken']}")
            continue
        say(f"{role}: {', '.join(about['ports']) or 'nothing'} -> {about['kind']}")
        rows = [(f"  {name}", _line(variant)) for name, variant in about["variants"].items()] or [("  (none)", "")]
        width = max(len(name) for name, _ in rows)
        for name, line in rows:
            say(f"{name.ljust(width)}  {line}".rstrip())


def _line(variant: dict[str, Any]) -> str:
    """First line of the documentation; before it where the variant comes from, if it is not built in."""
    return (
        str(variant["about"]) if variant["source"] in ("", "built-in") else f"[{variant['place']}] {variant['about']}"
    )


def _described(card: StageCard) -> dict[str, Any]:
    schema = card.options.model_json_schema() if card.options else {}
    ports = {port.name: {"kind": port.kind.kind, "optional": port.optional} for port in card.ports}
    return {
        "name": card.name,
        "version": card.version,
        "kind": card.kind.kind,
        "ports": ports,
        "uses": _used(card),
        "random": card.wants_rng,
        "method": card.doc,
        "options": schema,
    }


def _used(card: StageCard) -> list[str] | None:
    """What it uses with the defaults of its options; None where it does not say or has no defaults."""
    from pydantic import ValidationError

    try:
        uses = card.used_with(card.options() if card.options else None)
    except ValidationError:
        return None
    return None if uses is None else list(uses)


def _say_variant(described: dict[str, Any]) -> None:
    say(f"{described['name']}  version {described['version']}")
    if described["origin"]["source"]:
        say(f"{described['origin']['source']}: {described['origin']['place']}")
    say()
    say(described["method"])
    say()
    ports = [f"{name}: {p['kind']}{' (optional)' if p['optional'] else ''}" for name, p in described["ports"].items()]
    say(f"ports    {', '.join(ports) or 'none'}")
    uses = described["uses"]
    text = "not stated" if uses is None else _by_table(uses) or "nothing of what its ports offer"
    say(f"uses     {text}")
    say(f"returns  {described['kind']}")
    say()
    rows = _option_rows(described["options"], described["options"].get("$defs", {}), "", [])
    if rows:
        say_table(("option", "default", "allowed", "description"), rows)
    else:
        say("no options")


def _by_table(uses: Iterable[str]) -> str:
    """What is used, a line a table; of parameters of cameras the models, whose names `--json` lists."""
    of_table: dict[str, dict[str, None]] = {}
    for name in uses:
        table, _, part = re.sub(r"^(\w+)[.:]", r"\1 ", name).partition(" ")
        of_table.setdefault(table, {})[part.partition(".")[0] if table == "camera_parameters" else part] = None
    lines = [f"{table}: {', '.join(parts)}" if any(parts) else table for table, parts in of_table.items()]
    return "\n         ".join(lines)


def _option_rows(schema: dict[str, Any], defs: dict[str, Any], prefix: str, rows: list[list[str]]) -> list[list[str]]:
    required = schema.get("required", [])
    for name, about in schema.get("properties", {}).items():
        inner = _inner(about, defs)
        default = "required" if name in required else _yaml(about.get("default"))
        default = "" if inner is not None and default.startswith("{") else default  # its options follow
        rows.append([prefix + name, default, _allowed(about, defs), about.get("description", "")])
        if inner is not None:
            _option_rows(inner, defs, f"{prefix}{name}.", rows)
    return rows


def _inner(about: dict[str, Any], defs: dict[str, Any]) -> dict[str, Any] | None:
    """The schema of nested options, if there are any."""
    for choice in (about, *about.get("anyOf", ())):
        target = defs.get(choice.get("$ref", "").rpartition("/")[2], {})
        if "properties" in target:
            return dict(target)
    return None


def _allowed(about: dict[str, Any], defs: dict[str, Any]) -> str:
    if "anyOf" in about:
        return " or ".join(_allowed(choice, defs) for choice in about["anyOf"])
    if "$ref" in about:
        return _allowed(defs.get(about["$ref"].rpartition("/")[2], {}), defs)
    if "enum" in about:
        return ", ".join(_yaml(value) for value in about["enum"])
    if "const" in about:
        return _yaml(about["const"])
    if about.get("type") == "array":
        return f"list of {_allowed(about.get('items', _common(about.get('prefixItems', ()))), defs)}".removesuffix(
            " of "
        )
    signs = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}
    limits = [f"{sign} {about[key]}" for key, sign in signs.items() if key in about]
    kind = {"object": "options", "null": "empty"}.get(about.get("type", ""), about.get("type", ""))
    return " ".join([kind, *limits]).strip()


def _common(items: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The schema of the entries of a tuple, if they share one."""
    return items[0] if items and all(item == items[0] for item in items) else {}


def _yaml(value: Any) -> str:
    import json

    return value if isinstance(value, str) and value else json.dumps(value, ensure_ascii=False)
