"""The verbs for authors of stages: stages --local-plugins, new --plugin, schema."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from aatri.cli.main import app
from aatri.formats.merging.part import part_of
from aatri.pipeline.methods.registry import find_stages
from aatri.strict_yaml import load
from aatri.tables.schema import Artifact, attributes_of, columns_of, tables_of
from aatri.testing.check import check_stage
from aatri.testing.example_inputs import example_inputs
from tests.contract.test_every_variant import needed_inputs
from tests.json_schema import faults

DEMO = Path(__file__).parents[2] / "pipeline.yaml"


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def aatri(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


def _inputs(role: str) -> dict[str, Artifact]:
    """One example: what a new stage calls is tried on all of them by `tests/contract`."""
    if role in ("tie_points", "fiducial_marks"):
        return needed_inputs({"tie_points": "tie_points/sift", "fiducial_marks": "fiducial_marks/template"}[role])
    if role != "information":
        return example_inputs(role, find_stages().role(role))
    inputs = example_inputs(role, find_stages().role(role), "digital")
    block: Any = inputs["block"]
    return {**inputs, "other": part_of(block, block.images.strip == 0)}


@pytest.mark.slow
@pytest.mark.parametrize("role", sorted(find_stages().roles))
def test_a_new_stage_keeps_its_contract_from_the_start(role: str, tmp_path: Path) -> None:
    result = aatri("new", "--plugin", f"{role}/my_own", "project")
    assert result.exit_code == 0, result.stderr
    stages = Path("project") / "stages"
    assert result.stdout.split() == [
        str(stages / role / "my_own.py"),
        str(Path("project") / "tests" / "test_my_own.py"),
    ]
    check_stage(f"{role}/my_own", local=tmp_path / stages, inputs=_inputs(role))
    compile(Path("project/tests/test_my_own.py").read_text(), "test_my_own.py", "exec")


@pytest.mark.parametrize(
    ("name", "code", "said"),
    [
        ("mine", 2, "'mine' is not ROLE/NAME"),
        ("interior_orientation/Mine", 2, "is not ROLE/NAME"),
        ("interior_orientation/class", 2, "is not ROLE/NAME"),
        ("interior_orientatoin/mine", 9, "did you mean 'interior_orientation'?"),
        ("interior_orientation/affine", 2, "there is a stage interior_orientation/affine already"),
    ],
)
def test_a_new_stage_needs_a_name_of_its_own(name: str, code: int, said: str, tmp_path: Path) -> None:
    result = aatri("new", "--plugin", name)
    assert result.exit_code == code
    assert said in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_new_stage_replaces_nothing(tmp_path: Path) -> None:
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_mine.py").write_text("precious")
    result = aatri("new", "--plugin", "interior_orientation/mine")
    assert result.exit_code == 2
    assert "is there already" in result.stderr
    assert (tmp_path / "tests" / "test_mine.py").read_text() == "precious"
    assert not (tmp_path / "stages").exists()


def test_stages_tells_where_a_variant_comes_from(tmp_path: Path) -> None:
    aatri("new", "--plugin", "interior_orientation/mine")
    assert "interior_orientation/mine" not in aatri("stages").stdout
    text = aatri("stages", "--local-plugins").stdout
    place = str(Path("stages") / "interior_orientation" / "mine.py")
    assert f"interior_orientation/mine        [{place}] Interior orientation by a method of your own" in text
    assert f"project: {place}" in aatri("stages", "interior_orientation/mine", "--local-plugins").stdout
    told = json.loads(aatri("stages", "interior_orientation", "--local-plugins", "--json").stdout)
    variants = told["interior_orientation"]["variants"]
    assert variants["interior_orientation/mine"]["source"] == "project"
    assert variants["interior_orientation/affine"]["source"] == "built-in"
    assert aatri("stages", "interior_orientation/mine").exit_code == 9


@pytest.mark.slow
def test_a_broken_role_of_the_project_does_not_hide_the_others(tmp_path: Path) -> None:
    (tmp_path / "stages" / "odd_role").mkdir(parents=True)
    (tmp_path / "stages" / "odd_role" / "mine.py").write_text("")
    text = aatri("stages", "--local-plugins").stdout
    assert "odd_role: (broken)" in text
    assert "bundle_adjustment/bundle" in text
    assert aatri("stages", "odd_role", "--local-plugins").exit_code == 9


def test_local_plugins_without_a_folder_is_an_error() -> None:
    result = aatri("stages", "--local-plugins")
    assert result.exit_code == 9
    assert "no such folder" in result.stderr


@pytest.fixture(scope="module")
def pipeline_schema() -> dict[str, Any]:
    result = aatri("schema")
    assert result.exit_code == 0
    return json.loads(result.stdout)


def test_the_demo_is_valid_by_the_schema(pipeline_schema: dict[str, Any]) -> None:
    assert faults(load(DEMO).value, pipeline_schema, pipeline_schema) == []


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (("stages", "bundle", "with"), {"max_iterations": 0}, "/stages/bundle/with/max_iterations: anyOf"),
        (("stages", "bundle", "with"), {"max_iteration": 5}, "/stages/bundle/with/max_iteration: not allowed"),
        (("stages", "bundle", "from", "blok"), "block", "/stages/bundle/from/blok: not allowed"),
        (("stages", "models", "from"), {"block": None}, "/stages/models/from: required image_points"),
        (("stages", "bundle", "use"), "bundle_adjustment/none", "/stages/bundle/use: enum"),
        (("stages", "block"), {"use": "block/tables"}, "/stages/block: required with"),
        (("stages", "block"), {"use": "block/tables", "with": {}}, "/stages/block/with: required path"),
        (("stages", "block", "with"), {"flight": {"strips": 0}}, "/stages/block/with/flight/strips: minimum"),
        (("stages", "Block"), {"use": "block/simulate"}, "/stages/Block: pattern"),
        (("stages", "block"), None, "/stages/block: type"),
        (("seed",), -1, "/seed: minimum"),
        (("sed",), 1, "/sed: not allowed"),
        (("variants",), {"v": {"bundle": {"uses": "x"}}}, "/variants/v/bundle/uses: not allowed"),
        (("variants",), {"v": {"gates": {"bundle": {}}}}, "/variants/v/gates/bundle: minProperties"),
        (("gates",), {"bundle": {"sigma0": {}}}, "/gates/bundle/sigma0: oneOf"),
        (("gates",), {"bundle": {"sigma0": 1.5}}, "/gates/bundle/sigma0: oneOf"),
        (("gates",), {"bundle": {"sigma0": {"maxi": 1.5}}}, "/gates/bundle/sigma0: oneOf"),
    ],
)
def test_what_the_pipeline_refuses_the_schema_refuses(
    pipeline_schema: dict[str, Any], place: tuple[str, ...], value: Any, said: str
) -> None:
    pipeline = copy.deepcopy(load(DEMO).value)
    target = pipeline
    for key in place[:-1]:
        target = target[key]
    target[place[-1]] = value
    assert said in faults(pipeline, pipeline_schema, pipeline_schema)


def test_gates_are_valid_by_the_schema(pipeline_schema: dict[str, Any]) -> None:
    gates = {"bundle": {"sigma0": {"min": 0.5, "max": 1.5}, "suspects": "off"}}
    pipeline = load(DEMO).value | {"gates": gates, "variants": {"v": {"gates": gates}}}
    assert faults(pipeline, pipeline_schema, pipeline_schema) == []


def test_a_variant_may_leave_out_what_it_does_not_change(pipeline_schema: dict[str, Any]) -> None:
    pipeline = load(DEMO).value | {
        "variants": {"v": {"bundle": {"with": {"max_iterations": 3}}, "block": {"use": "block/tables"}}}
    }
    assert faults(pipeline, pipeline_schema, pipeline_schema) == []


def as_json(artifact: Artifact) -> dict[str, Any]:
    """An artifact as the schema tells it: NaN is null."""

    def plain(value: Any) -> Any:
        if isinstance(value, list):
            return [plain(part) for part in value]
        return None if isinstance(value, float) and np.isnan(value) else value

    told: dict[str, Any] = {"kind": artifact.kind, "schema_version": artifact.schema_version}
    told |= {name: plain(getattr(artifact, name)) for name in attributes_of(type(artifact))}
    for name, table in tables_of(type(artifact)).items():
        rows = getattr(artifact, name)
        if rows is not None:
            few = rows.take(np.arange(min(len(rows), 5)))
            told[name] = {column: plain(getattr(few, column).tolist()) for column in columns_of(table)}
    return told


@pytest.mark.slow
def test_every_artifact_of_the_chain_is_valid_by_the_schema() -> None:
    assert aatri("schema", "--artifacts", "--out", "artifacts.json").stdout == "artifacts.json\n"
    schema = json.loads(Path("artifacts.json").read_text(encoding="utf-8"))
    assert set(schema["$defs"]) >= {"Block", "ImagePoints", "Models", "Strips", "Solution", "Evaluation"}
    registry, checked = find_stages(), set()
    for role in registry.roles:
        for artifact in example_inputs(role, registry.role(role)).values():
            told = as_json(artifact)
            assert faults(told, schema, schema) == []
            assert faults({**told, "kind": "Nonsense"}, schema, schema)
            assert faults({**told, "extra": 1}, schema, schema)
            checked.add(artifact.kind)
    assert checked == {"Block", "ImagePoints", "Models", "Strips", "Solution"}
    position = schema["$defs"]["Solution"]["properties"]["images"]["properties"]["position_m"]
    assert (position["x-unit"], position["items"]["minItems"]) == ("m", 3)


def test_schema_says_where_it_cannot_write_and_what_excludes_what() -> None:
    assert aatri("schema", "--out", "nowhere/x.json").exit_code == 8
    assert aatri("schema", "--pipeline", "--artifacts").exit_code == 2
