"""Options of a stage: validated by its pydantic model, every error at its line.

Validation is strict, so that a text is never taken for a number; lists serve as tuples and texts as paths.
"""

import json
import typing
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from aatri.errors import Faults, SpecError
from aatri.ids import did_you_mean
from aatri.pipeline.spec.pipeline_file import Spec, StageSpec
from aatri.plugin import InputFile, Options, StageCard


def validated(
    spec: Spec, stage: StageSpec, card: StageCard, errors: Faults, *, runs_code: bool = False
) -> Options | None:
    """The options of a stage with defaults filled in; None if it takes none or they are wrong (see `errors`).

    `runs_code` says that options may name Python to be executed.
    """
    if card.options is None:
        for option in stage.options:
            errors.add(
                f"unknown option {option!r}; {card.name} takes no options", spec.where_key(stage.name, "with", option)
            )
        return None
    try:
        text = json.dumps(dict(stage.options))
        return card.options.model_validate_json(text, strict=True, context={"base": spec.base, "runs_code": runs_code})
    except ValidationError as failure:
        for fault in failure.errors(include_url=False):
            errors.append(_located(spec, stage, card, dict(fault)))
        return None


def input_files(options: Options) -> dict[str, Path]:
    """The paths given to options of type `InputPath`, by dotted name; also those in nested options and lists."""
    paths: dict[str, Path] = {}
    for name, about in type(options).model_fields.items():
        _collect(getattr(options, name), about.annotation, about.metadata, name, paths)
    return paths


def _collect(value: Any, annotation: Any, marks: Iterable[Any], name: str, paths: dict[str, Path]) -> None:
    if isinstance(value, Path) and any(isinstance(mark, InputFile) for mark in marks):
        paths[name] = value
    elif isinstance(value, BaseModel):
        for inner, about in type(value).model_fields.items():
            _collect(getattr(value, inner), about.annotation, about.metadata, f"{name}.{inner}", paths)
    elif typing.get_origin(annotation) is typing.Annotated:
        inner_type, *inner_marks = typing.get_args(annotation)
        _collect(value, inner_type, inner_marks, name, paths)
    elif isinstance(value, list | tuple):
        for k, item in enumerate(value):
            for choice in typing.get_args(annotation):
                _collect(item, choice, (), f"{name}.{k}", paths)
    elif value is not None:
        for choice in typing.get_args(annotation):
            _collect(value, choice, (), name, paths)


def option_names(card: StageCard) -> frozenset[str]:
    """Names of the options at the top level."""
    return frozenset(card.options.model_fields) if card.options else frozenset()


def _located(spec: Spec, stage: StageSpec, card: StageCard, fault: dict[str, Any]) -> SpecError:
    keys = tuple(fault["loc"])
    dotted = ".".join(str(key) for key in keys)
    if fault["type"] == "extra_forbidden":
        names = _field_names(card.options, keys[:-1])
        hint = did_you_mean(str(keys[-1]), names) or f"; known are {', '.join(names) or 'none'}"
        return SpecError(
            f"unknown option {dotted!r}{hint}",
            where=spec.where_key(stage.name, "with", *keys),
            remedy=f"see `aatri stages {card.name}`",
        )
    where = spec.where(stage.name, "with", *keys)
    if fault["type"] == "missing":
        return SpecError(f"option {dotted!r} of {card.name} is missing", where=where, remedy=_about(card, keys))
    message = str(fault["msg"]).removeprefix("Value error, ")
    value = "" if isinstance(fault["input"], dict) else f" is {fault['input']!r}"
    name = f"option {dotted}" if keys else f"options of {stage.name}"
    return SpecError(f"{name}{value}: {message}", where=where, remedy=_about(card, keys))


def _about(card: StageCard, keys: tuple[Any, ...]) -> str:
    fields = card.options.model_fields if card.options else {}
    described = fields[str(keys[0])].description if keys and str(keys[0]) in fields else None
    return f"{keys[0]}: {described}" if described else f"see `aatri stages {card.name}`"


def _field_names(model: type[BaseModel] | None, keys: Iterable[Any]) -> list[str]:
    """Field names of the model that a path of keys leads to."""
    for key in keys:
        fields = model.model_fields if model else {}
        model = _model_in(fields[key].annotation) if key in fields else model
    return list(model.model_fields) if model else []


def _model_in(annotation: Any) -> type[BaseModel] | None:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_model_in, typing.get_args(annotation))), None)
