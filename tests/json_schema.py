"""The part of JSON Schema 2020-12 that aatri exports, as a validator; a keyword it does not know is an error."""

from __future__ import annotations

import re
from typing import Any

TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None)}
ANNOTATIONS = {"title", "description", "default", "$defs", "$schema", "format", "then", "examples"}


def faults(value: Any, schema: Any, root: Any, at: str = "") -> list[str]:
    """What is wrong with a value, with its place."""
    if isinstance(schema, bool):
        return [] if schema else [f"{at}: not allowed"]
    found: list[str] = []
    for keyword, told in schema.items():
        if keyword in ANNOTATIONS or keyword.startswith("x-"):
            continue
        found += _check(keyword, told, value, schema, root, at)
    return found


def _is(value: Any, name: str) -> bool:
    if name in ("number", "integer"):
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        return is_number and (name == "number" or float(value).is_integer())
    return isinstance(value, TYPES[name])


def _check(keyword: str, told: Any, value: Any, schema: Any, root: Any, at: str) -> list[str]:
    number, text = _is(value, "number"), isinstance(value, str)
    mapping, listed = isinstance(value, dict), isinstance(value, list)

    def inner(part: Any, sub: Any, name: str = "") -> list[str]:
        return faults(part, sub, root, f"{at}/{name}" if name else at)

    def plain(good: bool) -> list[str]:
        return [] if good else [f"{at}: {keyword}"]

    match keyword:
        case "$ref":
            target = root
            for part in told.removeprefix("#/").split("/"):
                target = target[part]
            return inner(value, target)
        case "type":
            return plain(any(_is(value, name) for name in ([told] if isinstance(told, str) else told)))
        case "const":
            return plain(value == told)
        case "enum":
            return plain(value in told)
        case "required":
            return [f"{at}: required {name}" for name in told if mapping and name not in value]
        case "properties":
            return [f for name, sub in told.items() if mapping and name in value for f in inner(value[name], sub, name)]
        case "additionalProperties":
            others = [name for name in value if name not in schema.get("properties", {})] if mapping else []
            return [f for name in others for f in inner(value[name], told, name)]
        case "propertyNames":
            return [f for name in value for f in inner(name, told, name)] if mapping else []
        case "minProperties" | "maxProperties":
            return plain(not mapping or (len(value) >= told if keyword[1] == "i" else len(value) <= told))
        case "items":
            rest = value[len(schema.get("prefixItems", ())) :] if listed else []
            return [f for k, part in enumerate(rest) for f in inner(part, told, str(k))]
        case "prefixItems":
            return [f for part, sub in zip(value, told) for f in inner(part, sub)] if listed else []
        case "minItems" | "maxItems":
            return plain(not listed or (len(value) >= told if keyword[1] == "i" else len(value) <= told))
        case "minLength" | "pattern":
            return plain(not text or (len(value) >= told if keyword[0] == "m" else bool(re.search(told, value))))
        case "minimum" | "maximum" | "exclusiveMinimum" | "exclusiveMaximum":
            sign = {"minimum": "__ge__", "maximum": "__le__", "exclusiveMinimum": "__gt__"}.get(keyword, "__lt__")
            return plain(not number or getattr(float(value), sign)(float(told)))
        case "allOf":
            return [f for sub in told for f in inner(value, sub)]
        case "anyOf" | "oneOf":
            good = sum(not inner(value, sub) for sub in told)
            return plain(good >= 1 if keyword == "anyOf" else good == 1)
        case "if":
            return inner(value, schema["then"]) if not inner(value, told) else []
    raise NotImplementedError(keyword)
