"""The key of a result: a digest of all that the result depends on, and of nothing else.

It holds the method with its version; options with defaults; the content of the artifacts at the ports it uses and of
the files that options name; the code it reaches; the schema versions of its artifacts; the seed, where it draws random
numbers. It does not hold where things lie, the time, the machine, or versions of packages: these are in the record.
"""

import copy
import hashlib
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from aatri.pipeline.plan.graph import StageNode

KEY_SCHEMA = 3
"""Grows with what a key is made of, and with the form of the files: results of another form are made again."""

ABSENT = "absent"
"""Stands for the content of a file that is not there: the stage will say so."""

NO_FILE = "no file"
"""Stands for that of a link to nothing, a pipe or a device in a folder."""


def key_parts(node: StageNode, inputs: Mapping[str, str | None], files: Mapping[str, str], seed: int) -> dict[str, Any]:
    """All that the result of a stage depends on.

    Parameters
    ----------
    inputs : mapping
        Content digest of the artifact at each port; None where it is not known yet.
    files : mapping
        Content digest of each file that an option names.
    seed : int
        Counts only where the stage asks for random numbers.
    """
    method = node.method
    schemas = {port.kind: port.schema for port in method.ports if port.name in node.inputs}
    return {
        "key_schema": KEY_SCHEMA,
        "stage": node.name,
        "plugin": method.name,
        "version": method.version,
        "options": _without_paths(node),
        "files": dict(files),
        "inputs": dict(inputs),
        "code": node.code.digest,
        "modules": dict(node.code.modules),
        "schemas": {**schemas, method.kind: method.schema},
        "seed": seed if method.wants_rng else None,
    }


def key_of(parts: Mapping[str, Any]) -> str:
    """First 12 hex digits of the SHA-256 of the parts; the whole parts are compared before a result is taken."""
    canonical = json.dumps(parts, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(canonical.encode()).hexdigest()[:12]


def file_digests(option: str, path: Path, of_one: Callable[[Path], str]) -> dict[str, str]:
    """Digest of the content of each file that an option names, or that is in the folder it names, by option and name.

    A link to nothing or a pipe in the folder is opened by no plan, but it counts: the stage that reads it refuses it.

    Parameters
    ----------
    of_one : callable
        Digest of the content of one file.
    """
    try:
        files = [path] if path.is_file() else sorted(_files_in(path), key=lambda p: os.fsencode(p.relative_to(path)))
        if not path.exists():
            return {option: ABSENT}
        base = path.parent if path.is_file() else path
        return {f"{option}/{_named(p.relative_to(base))}": of_one(p) if p.is_file() else NO_FILE for p in files}
    except OSError:
        return {option: ABSENT}


def _named(path: Path) -> str:
    """The path as text that JSON takes, also where its bytes are no text."""
    return os.fsencode(path).decode("utf-8", errors="backslashreplace")


def _files_in(folder: Path) -> list[Path]:
    return [p for p in folder.rglob("*") if not p.is_dir() and not p.name.startswith((".", "~$"))]


def _without_paths(node: StageNode) -> dict[str, Any]:
    """The options, with the paths of input files left out: their content counts, not where they lie."""
    options = copy.deepcopy(dict(node.options))
    for dotted in node.files:
        *parents, last = dotted.split(".")
        inner: Any = options
        for key in parents:
            inner = inner[int(key)] if isinstance(inner, list) else inner[key]
        inner[int(last) if isinstance(inner, list) else last] = None
    return options
