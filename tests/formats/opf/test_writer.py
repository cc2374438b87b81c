"""Every document of an exported project is valid by its schema of the specification."""

import json
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.formats.opf.writer import ITEMS, write_opf
from aatri.formats.results.oriented_block import OrientedBlock
from tests.formats.test_written_formats import FULL, UTM, made_block

TYPES: dict[str, Any] = {
    "object": dict,
    "array": list,
    "string": str,
    "number": (int, float),
    "boolean": bool,
    "integer": int,
}


def faults(value: Any, schema: dict[str, Any], root: dict[str, Any], folder: Path, at: str = "") -> list[str]:
    """What a value has against a JSON Schema, as far as those of the specification go."""
    if "$ref" in schema:
        name, _, within = schema["$ref"].partition("#")
        of = json.loads((folder / name).read_text()) if name else root
        for key in [key for key in within.split("/") if key]:
            schema = (of if key == within.split("/")[1] else schema)[key]
        return faults(value, schema if within else of, of, folder, at)
    kind = schema.get("type")
    if kind and (not isinstance(value, TYPES[kind]) or (kind != "boolean" and isinstance(value, bool))):
        return [f"{at}: {value!r} is no {kind}"]
    found = [f"{at}: lacks {key}" for key in schema.get("required", ()) if key not in value]
    for key in ("const", "enum"):
        allowed = [schema[key]] if key == "const" and key in schema else schema.get(key, [value])
        found += [f"{at}: {value!r} is not {allowed}"] if value not in allowed else []
    if "pattern" in schema and not re.search(schema["pattern"], value):
        found.append(f"{at}: {value!r} is not {schema['pattern']}")
    if isinstance(value, list):
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
            found.append(f"{at}: {len(value)} items")
        for k, item in enumerate(value):
            found += faults(item, schema.get("items", {}), root, folder, f"{at}[{k}]")
    if isinstance(value, (int, float)) and not value >= schema.get("minimum", value):
        found.append(f"{at}: {value} is below {schema['minimum']}")
    for key, of_key in schema.get("properties", {}).items():
        found += faults(value[key], of_key, root, folder, f"{at}.{key}") if key in value else []
    for part in schema.get("allOf", ()):
        found += faults(value, part, root, folder, at)
    for key in ("oneOf", "anyOf"):
        options = [faults(value, part, root, folder, at) for part in schema.get(key, ())]
        found += [f"{at}: none of {key}: {options}"] if options and all(options) else []
    return found


@pytest.fixture
def schemas(interchange: Path) -> Path:
    """Folder of the schemas of the specification."""
    folder = interchange / "opf" / "schema"
    if not folder.is_dir():
        pytest.skip(f"schemas not present: {folder}")
    return folder


@pytest.mark.parametrize("frame", ["map", "local"])
def test_the_documents_are_valid_by_their_schemas(tmp_path: Path, schemas: Path, frame: str) -> None:
    block = made_block(FULL, UTM) if frame == "map" else made_block(FULL)
    write_opf(OrientedBlock(block), tmp_path)
    for name in ("project", *(name for names in ITEMS.values() for name in names)):
        path = tmp_path / (f"{name}.json" if name != "project" else "project.opf")
        schema = json.loads((schemas / f"{name.replace('-', '_')}.schema.json").read_text())
        assert faults(json.loads(path.read_text()), schema, schema, schemas, name) == []


def test_the_validator_finds_what_is_wrong(schemas: Path) -> None:
    schema = json.loads((schemas / "input_control_points.schema.json").read_text())
    mark = {"camera_id": -1, "position_px": [1.0], "accuracy": "1"}
    wrong = {"format": "x", "version": "1.0", "gcps": [], "mtps": [{"id": 1, "marks": [mark]}]}
    told = " ".join(faults(wrong, schema, schema, schemas))
    for part in ("'x' is not", "lacks is_checkpoint", "1 is no string", "-1 is below 0", "1 items", "'1' is no number"):
        assert part in told


def test_pyopf_opens_every_document(tmp_path: Path) -> None:
    io = pytest.importorskip("pyopf.io", reason="pyopf is not installed")
    resolve = pytest.importorskip("pyopf.resolve")
    block = made_block(FULL, UTM)
    write_opf(OrientedBlock(block), tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of a document that it cannot decode it only warns
        project = resolve.resolve(io.load(str(tmp_path / "project.opf")))
    (sensor,) = project.input_cameras.sensors
    assert sensor.image_size_px.tolist() == [4000, 3000]
    assert sensor.internals.focal_length_px == pytest.approx(3500.0)
    assert len(project.camera_list.cameras) == len(project.input_cameras.captures) == len(block.images)
    gcps = {gcp.id: gcp for gcp in project.input_control_points.gcps}
    assert gcps["P0"].geolocation.coordinates.tolist() == pytest.approx(block.ground_points.xyz_m[0])
    assert [gcp for gcp in gcps if gcps[gcp].is_checkpoint] == ["P5", "P6"]
    cameras = project.calibration.calibrated_cameras.cameras
    shift = project.scene_reference_frame.base_to_canonical.shift
    positions = [camera.position - shift for camera in cameras]
    assert np.ravel(positions) == pytest.approx(np.ravel(block.exterior.position_m))
