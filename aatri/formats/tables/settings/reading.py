"""Reading of block.yaml, all faults together, each with its place in the file; and writing of it.

Reading what was written gives the same settings to the bit. Texts and keys are in JSON form, which is YAML too; numbers
have the fewest digits that give them back. A radial correction that is 0.001 times no float has no exact form, as the
file has it in um; the nearest is written.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from aatri.artifacts.block import Block
from aatri.errors import Faults, InputError, raise_all
from aatri.formats.tables.settings.block import DefaultSigmas, FrameSettings, Settings, Units
from aatri.formats.tables.settings.camera import (
    PARAMETERS,
    VECTORS,
    CameraSettings,
    Pixel,
    RigMemberSettings,
    RigMemberSigmas,
)
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


def settings_text(block: Block) -> str:
    """The text of block.yaml, units m, mm, rad, s."""
    frames = {
        str(f): {"axes": a.split(","), "crs": str(c)} | ({"vertical": str(v)} if v else {})
        for f, a, c, v in zip(block.frames.id, block.frames.axes.tolist(), block.frames.crs, block.frames.vertical)
    }
    units = {"ground": "m", "angle": "rad", "sigma_image": "mm", "sigma_ground": "m", "sigma_angle": "rad", "time": "s"}
    lines = ["aatri_block: 1", f"name: {_yaml(block.name)}", "frames:"]
    lines += [f"  {_yaml(name)}: {_yaml(frame)}" for name, frame in frames.items()]
    lines += [f"earth_curvature: {block.earth_curvature}", f"units: {_yaml(units)}", f"rotation: {block.rotation}"]
    if block.heading != "true":
        lines.append(f"heading: {block.heading}")
    if np.isfinite(block.undulation_m):
        lines.append(f"undulation: {_yaml(float(block.undulation_m))}")
    if np.isfinite(block.terrain_height_m):
        lines.append(f"terrain_height: {_yaml(float(block.terrain_height_m))}")
    if len(block.cameras):
        lines.append("cameras:")
    for k, name in enumerate(block.cameras.id):
        lines.append(f"  {_yaml(str(name))}:")
        lines += [f"    {key}: {_yaml(value)}" for key, value in _camera(block, k).items()]
    if len(block.rig_members):
        lines.append("rigs:")
    for name in dict.fromkeys(block.rig_members.rig.tolist()):
        lines.append(f"  {_yaml(name)}: {_yaml(_rig(block, name))}")
    return "\n".join(lines) + "\n"


def _rig(block: Block, name: str) -> dict[str, Any]:
    """Members of a rig in the order of the table: the frame first."""
    rows = block.rig_members
    written: dict[str, Any] = {}
    for k in np.flatnonzero(rows.rig == name).tolist():
        position = np.where(rows.position_free[k], np.inf, rows.position_sigma_m[k]).tolist()
        angles = np.where(rows.angle_free[k], np.inf, rows.angle_sigma_rad[k]).tolist()
        written[str(rows.member[k])] = (
            {}
            if rows.is_frame[k]
            else {
                "position": rows.position_m[k].tolist(),
                "angles": rows.angles_rad[k].tolist(),
                "sigmas": {"position": position, "angles": angles},
            }
        )
    return written


def _camera(block: Block, k: int) -> dict[str, Any]:
    c = block.cameras
    written: dict[str, Any] = {"kind": str(c.kind[k]), "image_coordinates": str(c.image_coordinates[k])}
    if np.isfinite(c.pixel_size_mm[k]).all():
        pixel = {"size": c.pixel_size_mm[k].tolist()}
        if c.image_coordinates[k] == "pixel":
            pixel |= {"origin": str(c.pixel_origin[k]), "y": str(c.pixel_y[k])}
        written["pixel"] = pixel
    if np.isfinite(c.format[k]).all():
        written["format"] = c.format[k].tolist()
    written["principal_distance"] = float(c.principal_distance_mm[k])
    written["principal_point"] = c.principal_point_mm[k].tolist()
    written["symmetry_point"] = c.symmetry_point_mm[k].tolist()
    marks = block.fiducials.camera == k
    if marks.any():
        written["fiducials"] = dict(zip(block.fiducials.id[marks].tolist(), block.fiducials.xy_mm[marks].tolist()))
    written["distortion"], written["sigmas"] = _distortion(block, k), _sigmas(block, k)
    written["lever_arm"], written["boresight"] = c.lever_arm_m[k].tolist(), c.boresight_rad[k].tolist()
    if c.mount_deg[k]:
        written["mount"] = int(c.mount_deg[k])
    return written


def _distortion(block: Block, k: int) -> dict[str, Any]:
    rows, table = block.camera_parameters, block.distortion_table
    written: dict[str, Any] = {"model": str(block.cameras.distortion[k])}
    stated = (rows.camera == k) & np.isfinite(rows.value)
    written |= dict(zip(rows.name[stated].tolist(), rows.value[stated].tolist()))
    of_camera = table.camera == k
    if of_camera.any():
        written["radius"] = table.radius_mm[of_camera].tolist()
        written["correction"] = [_thousandfold(mm) for mm in table.correction_mm[of_camera].tolist()]
    return written


def _thousandfold(value: float) -> float:
    """The number that gives `value` when multiplied by 0.001, if there is one; else the nearest."""
    near = value * 1e3
    candidates = [near, math.nextafter(near, math.inf), math.nextafter(near, -math.inf)]
    return min(candidates, key=lambda v: abs(v * 1e-3 - value))


def _sigmas(block: Block, k: int) -> dict[str, Any]:
    """Standard deviations by parameter; components of a vector together."""
    rows = block.camera_parameters
    of_camera = (rows.camera == k) & (rows.free | np.isfinite(rows.sigma))
    single = {
        n: math.inf if f else s
        for n, s, f in zip(rows.name[of_camera].tolist(), rows.sigma[of_camera].tolist(), rows.free[of_camera].tolist())
    }
    written: dict[str, Any] = {}
    for name, sigma in single.items():
        vector, dot, _ = name.partition(".")
        if dot:
            written[vector] = [single.get(f"{vector}.{axis}", 0.0) for axis in VECTORS[vector]]
        else:
            written[name] = sigma
    return written


def _yaml(value: Any) -> str:
    """A value in flow style; infinity as YAML writes it."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_yaml(str(key))}: {_yaml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_yaml, value)) + "]"
    if isinstance(value, float) and math.isinf(value):
        return ".inf"
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False)
