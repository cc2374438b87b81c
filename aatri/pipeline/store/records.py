"""What the JSON files of a run must hold: records, the overview, failures; anything else is damage.

A file that parses may still be no record: of another shape, with numbers that JSON does not have (NaN, 1e999), with
halves of characters, nested without end, or with names that lead elsewhere. All of it is told as one error,
ArtifactError, so that readers of records need not ask again.
"""

import datetime
import hashlib
import json
import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from aatri.errors import ArtifactError
from aatri.pipeline.store import inside

SCHEMA = 2
ARTIFACT = "artifact.h5"

Check = Callable[[Any], bool]

_STAGE = re.compile(r"[a-z][a-z0-9_]*")
_KEY = re.compile(r"[A-Za-z0-9]{1,64}")
_LARGEST = 1e300
_REMEDY = "aatri run writes it again"


def is_stage_name(value: Any) -> bool:
    """Whether it is a name that a stage can have."""
    return isinstance(value, str) and len(value) <= MAX_NAME and _STAGE.fullmatch(value) is not None


MAX_NAME = 100
"""Longest name of a stage or variant: names of files are made of it."""


def read_json(run: Path, *names: str) -> dict[str, Any] | None:
    """A JSON file of a run; None if there is none.

    Raises
    ------
    ArtifactError
        If it is damaged.
    """
    try:
        data = inside.read(run, *names)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        if isinstance(error, ArtifactError):
            raise
        raise ArtifactError(
            f"not readable: {error.strerror}", where=str(inside.path_of(run, *names)), remedy=_REMEDY
        ) from error
    where = str(inside.path_of(run, *names))
    try:
        value = strict_json(data)
    except (ValueError, RecursionError) as error:
        raise ArtifactError(f"not readable: {error}", where=where, remedy=_REMEDY) from error
    if not isinstance(value, dict):
        raise ArtifactError("not a record", where=where, remedy=_REMEDY)
    return value


def strict_json(data: bytes) -> Any:
    """The value of a JSON text, which can be written as JSON again.

    Raises
    ------
    ValueError, RecursionError
        If it is none, or holds what UTF-8 or JSON do not have.
    """
    value = json.loads(data.decode("utf-8"), parse_constant=_refuse, parse_float=_finite)
    json.dumps(value, ensure_ascii=False, allow_nan=False).encode("utf-8")
    return value


def read_record(run: Path, *names: str) -> dict[str, Any] | None:
    """A record; None if there is none.

    Raises
    ------
    ArtifactError
        If it is damaged, was altered, or is of another version of aatri.
    """
    record = read_json(run, *names)
    if record is None:
        return None
    where, remedy = str(inside.path_of(run, *names)), "aatri run makes the result again"
    if record.get("schema") != SCHEMA:
        raise ArtifactError(
            f"a record of form {str(record.get('schema'))[:20]}; this aatri reads form {SCHEMA}",
            where=where,
            remedy=remedy,
        )
    if record.get("seal") != seal(record):
        raise ArtifactError("the record was altered", where=where, remedy=remedy)
    _check(record, _RECORD, where, remedy)
    return record


def read_overview(run: Path) -> dict[str, Any] | None:
    """What run.json says of a run; None if there is none.

    Raises
    ------
    ArtifactError
        If it is damaged.
    """
    overview = read_json(run, "run.json")
    if overview is not None:
        _check(overview, _OVERVIEW, str(run / "run.json"), "aatri run PIPELINE writes it again")
    return overview


def read_failure(run: Path, stage: str) -> dict[str, Any] | None:
    """Why a stage failed; None if it did not.

    Raises
    ------
    ArtifactError
        If it is damaged.
    """
    failure = read_json(run, "failed", stage, "error.json")
    if failure is not None:
        _check(failure, _FAILURE, str(inside.path_of(run, "failed", stage, "error.json")), _REMEDY)
    return failure


def seal(record: Mapping[str, Any]) -> str:
    """SHA-256 of the content of a record."""
    content = {name: value for name, value in record.items() if name != "seal"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _check(value: Mapping[str, Any], shape: Mapping[str, Check], where: str, remedy: str) -> None:
    for name, is_right in shape.items():
        if not is_right(value.get(name)):
            raise ArtifactError(f"damaged: its {name!r} is missing or wrong", where=where, remedy=remedy)


def _refuse(text: str) -> float:
    raise ValueError(f"{text} is no number of JSON")


def _finite(text: str) -> float:
    if not math.isfinite(value := float(text)):
        raise ValueError(f"{text[:20]} is too large for a number")
    return value


def _text(value: Any) -> bool:
    return isinstance(value, str)


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and abs(value) < _LARGEST


def _time(value: Any) -> bool:
    try:
        return datetime.datetime.fromisoformat(value).tzinfo is not None
    except (TypeError, ValueError):
        return False


def _optional(check: Check) -> Check:
    return lambda value: value is None or check(value)


def _list_of(check: Check) -> Check:
    return lambda value: isinstance(value, list) and all(map(check, value))


def _by_name(check: Check) -> Check:
    return lambda value: isinstance(value, dict) and all(map(check, value.values()))


def _with(**shape: Check) -> Check:
    return lambda value: isinstance(value, dict) and all(is_right(value.get(k)) for k, is_right in shape.items())


def _key(value: Any) -> bool:
    return isinstance(value, str) and _KEY.fullmatch(value) is not None


_ANY = _by_name(lambda _: True)
_PARTS = _with(
    plugin=_text,
    version=_number,
    options=_ANY,
    files=_by_name(_text),
    inputs=_by_name(_text),
    code=_text,
    schemas=_ANY,
    seed=_optional(_number),
    modules=_optional(_by_name(_text)),
)
_RECORD: dict[str, Check] = {
    "stage": is_stage_name,
    "key": _key,
    "plugin": _text,
    "version": _number,
    "options": _ANY,
    "inputs": _by_name(_with(stage=is_stage_name, key=_key, content_digest=_text)),
    "parts": _PARTS,
    "metrics": _by_name(_optional(_number)),
    "warnings": _list_of(_text),
    "started": _time,
    "ended": _time,
    "seconds": _number,
    "environment": _by_name(_text),
    "offers": _optional(_list_of(_with(name=_text, nature=_text, what=_text, where=_text, bears_on=_text))),
    "output": _with(
        kind=_text,
        file=lambda name: name == ARTIFACT,
        sha256=_text,
        size=_number,
        content_digest=_text,
        rows=_optional(_by_name(_number)),
    ),
}
_REQUEST = _with(pipeline=_text, into=_text, variant=_text, set_=_list_of(_text), use=_list_of(_text))
_GATE = _with(
    stage=is_stage_name,
    metric=_text,
    min=_optional(_number),
    max=_optional(_number),
    value=_optional(_number),
    passed=lambda value: isinstance(value, bool),
)
_OVERVIEW: dict[str, Check] = {
    "stages": _list_of(_with(stage=is_stage_name, use=_text, kind=_text, **{"from": _by_name(is_stage_name)})),
    "request": _optional(lambda value: value == {} or _REQUEST(value)),
    "status": _text,
    "pipeline": _text,
    "started": _optional(_text),
    "warnings": _optional(_list_of(_with(stage=_text, message=_text))),
    "gates": _optional(_list_of(lambda gate: _GATE(gate) and (gate["min"], gate["max"]) != (None, None))),
}
_FAILURE: dict[str, Check] = {
    "what": _text,
    "where": _text,
    "remedy": _text,
    "exit_code": _number,
    "ended": _text,
    "key": _optional(_text),
    "plugin": _optional(_text),
    "options": _optional(_ANY),
}
