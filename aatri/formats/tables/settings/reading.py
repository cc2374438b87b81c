"""Reading of block.yaml: all faults together, each with its place in the file."""

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from aatri.errors import Faults, InputError, raise_all
from aatri.formats.tables.settings.block import DefaultSigmas, FrameSettings, Settings, Units
from aatri.formats.tables.settings.camera import PARAMETERS, CameraSettings, Pixel, RigMemberSettings, RigMemberSigmas
from aatri.ids import clipped, did_you_mean, is_valid
from aatri.strict_yaml import Document, load


def read_settings(path: Path) -> tuple[Settings, Document]:
    """Read block.yaml.

    Raises
    ------
    InputError
        If the file is missing, no YAML, or breaks the contract; all faults at once.
    """
    document = load(path, InputError)
    if not isinstance(document.value, dict):
        raise InputError("is no mapping of keys to values", where=document.where(), remedy="begin with aatri_block: 1")
    try:
        settings = Settings.model_validate(document.value)
    except ValidationError as error:
        faults = [_fault(document, dict(item)) for item in error.errors(include_url=False)]
        raise_all(list({str(fault): fault for fault in faults}.values()))
        raise
    problems = Faults()
    named = [("frames", name) for name in settings.frames] + [("cameras", name) for name in settings.cameras]
    named += [("rigs", name) for name in settings.rigs]
    for keys in [*named, *(("rigs", rig, member) for rig, members in settings.rigs.items() for member in members)]:
        if not is_valid(keys[-1]):
            problems.add(f"{clipped(keys[-1])!r} is no id", document.where_key(*keys))
    raise_all(problems)
    return settings, document


def _fault(document: Document, item: dict[str, Any]) -> InputError:
    """One finding of the validation as an error with place, value and remedy."""
    keys = _keys(document.value, item["loc"])
    keys += getattr(item.get("ctx", {}).get("error"), "keys", ())
    path = ".".join(str(key) for key in keys) or "block.yaml"
    if item["type"] == "extra_forbidden":
        expected = _known_keys(keys[:-1])
        what = f"unknown key {clipped(str(keys[-1]))!r} in {'.'.join(map(str, keys[:-1])) or 'block.yaml'}"
        remedy = f"keys are {', '.join(expected)}; your own start with x_" if expected else "remove it"
        return InputError(what + did_you_mean(str(keys[-1]), expected), where=document.where_key(*keys), remedy=remedy)
    if item["type"] == "missing":
        return InputError(f"{path} is missing", where=document.where(*keys), remedy=f"add `{keys[-1]}:`")
    message, value = item["msg"].removeprefix("Value error, "), item["input"]
    if item["type"] == "value_error":
        return InputError(f"{path}: {message}", where=document.where(*keys), remedy="see docs/formats.md")
    if not message.startswith("Input should be "):
        return InputError(f"{path}: {message}", where=document.where(*keys), remedy="write as many values as it takes")
    message = message.removeprefix("Input should be ")
    shown = clipped(repr(value)) if not isinstance(value, dict | list) else "a list or mapping"
    near = did_you_mean(value, message.replace("'", " ").split()) if isinstance(value, str) else ""
    return InputError(f"{path} is {shown}{near}", where=document.where(*keys), remedy=f"it must be {message}")


def _keys(value: Any, location: tuple[str | int, ...]) -> list[str | int]:
    """The keys of the file in a location of pydantic, which also names the members of unions."""
    keys: list[str | int] = []
    for n, step in enumerate(location):
        if step == "parameters" and not (isinstance(value, dict) and "parameters" in value):
            continue
        # Too short a list is told of as a whole: a number is always that of an item.
        if (isinstance(value, dict) and step in value) or (isinstance(value, list) and isinstance(step, int)):
            keys.append(step)
            value = value[int(step)] if isinstance(value, list) else value[step]
        elif n == len(location) - 1 and isinstance(value, dict):
            keys.append(step)
    return keys


def _known_keys(keys: list[str | int]) -> list[str]:
    """The keys allowed in a section of the file."""
    names = [str(key) for key in keys]
    if not names:
        return list(Settings.model_fields)
    if names[0] == "frames":
        return list(FrameSettings.model_fields)
    if names[0] in ("units", "sigma"):
        return list((Units if names[0] == "units" else DefaultSigmas).model_fields)
    if names[0] == "cameras" and len(names) == 2:
        return list(CameraSettings.model_fields)
    if names[0] == "rigs" and len(names) >= 3:
        return list((RigMemberSigmas if names[-1] == "sigmas" else RigMemberSettings).model_fields)
    if names[-1] == "pixel":
        return list(Pixel.model_fields)
    return ["model", "radius", "correction", *PARAMETERS["polynomial"], "b1", "as"] if names[-1] == "distortion" else []
