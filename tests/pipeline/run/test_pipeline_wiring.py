from __future__ import annotations

import sys
from pathlib import Path

import pytest

from aatri.errors import AatriError, Errors, PluginError, SpecError
from aatri.pipeline.methods.catalogue import Catalogue
from aatri.pipeline.methods.registry import find_stages, first_line
from aatri.pipeline.plan.graph import downstream, wire
from aatri.pipeline.spec.overrides import with_set, with_use, with_variant
from aatri.pipeline.spec.pipeline_file import load_spec
from tests.made_up_stages import made_up_registry, write_pipeline

GOOD = "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: a}}\n"


def spec_errors(path: Path, *, wired: bool = False) -> list[AatriError]:
    try:
        spec = load_spec(path)
        if wired:
            wire(spec, made_up_registry())
    except AatriError as error:
        return list(error.errors) if isinstance(error, Errors) else [error]
    pytest.fail("no error")


def places(path: Path, errors: list[AatriError]) -> list[str]:
    return [error.where.removeprefix(f"{path}:") for error in errors]


def test_the_demo_has_the_stages_of_the_chain() -> None:
    spec = load_spec(Path(__file__).parents[3] / "pipeline.yaml")
    assert list(spec.stages)[:4] == ["block", "interior", "refined", "models"]
    assert spec.stages["interior"].inputs == {"block": "block"}
    assert spec.run == spec.base / "runs/demo"


def test_every_error_of_shape_is_reported_at_once_with_its_place(tmp_path: Path) -> None:
    path = write_pipeline(
        tmp_path,
        "  a: {use: source/fixed, form: {x: y}}\n"
        "  B: {use: nonsense, with: 3}\n"
        "  c: [1]\n"
        "  d: {use: sum/add, from: a}\n"
        "  e: {use: sum/add, from: {numbers: 3}}\n",
        head="run: out\nseed: -1\nvariants: {v: {aa: {use: x}}}\n",
    )
    errors = spec_errors(path)
    text = "\n".join(error.what for error in errors)
    assert "unknown key 'form' - did you mean 'from'?" in text
    assert places(path, errors) == [
        "2:7",
        "5:26",
        "6:3",
        "6:12",
        "6:28",
        "7:6",
        "7:6",
        "8:27",
        "9:37",
        "3:16",
        "3:26",
    ]
    assert all(error.exit_code == 2 for error in errors)


def test_a_file_without_run_or_stages_says_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "pipeline.yaml"
    path.write_text("seed: 3\n")
    errors = spec_errors(path)
    assert "run is missing" in errors[0].what
    path.write_text("run: out\n")
    assert "no stages" in spec_errors(path)[0].what


def test_stages_run_in_the_order_of_data_and_else_of_the_file(tmp_path: Path) -> None:
    lines = "  s: {use: sum/add, from: {numbers: b, more: a}}\n  b: {use: source/fixed}\n  a: {use: source/random}\n"
    nodes = wire(load_spec(write_pipeline(tmp_path, lines)), made_up_registry())
    assert [node.name for node in nodes] == ["b", "a", "s"]
    lines = "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: a}}\n  b: {use: source/fixed}\n"
    kept = wire(load_spec(write_pipeline(tmp_path, lines)), made_up_registry())
    assert [node.name for node in kept] == ["a", "s", "b"]
    assert downstream(nodes, "a") == ("s",)
    assert downstream(nodes, "s") == ()


@pytest.mark.parametrize(
    ("line", "token", "message"),
    [
        ("{use: sum/add, from: {numbres: a}}", "numbres", "no port 'numbres' - did you mean 'numbers'?"),
        ("{use: sum/add, from: {numbers: aa}}", "aa}", "no stage 'aa' - did you mean 'a'?"),
        ("{use: sum/add, from: {numbers: s}}", "s}", "wants a Numbers, but s gives Total"),
        ("{use: sum/add}", "{use", "needs port numbers"),
        ("{use: sum/ad, from: {numbers: a}}", "sum/ad", "no stage 'sum/ad' - did you mean 'sum/add'?"),
        ("{use: sums/add, from: {numbers: a}}", "sums/add", "no role 'sums' - did you mean 'sum'?"),
        ("{use: sum/stranger, from: {numbers: a}}", "sum/str", "asks for port 'figures'"),
        ("{use: source/fixed, with: {cuont: 2}}", "cuont", "unknown option 'cuont' - did you mean 'count'?"),
        ("{use: source/fixed, with: {count: 0}}", "0", "option count is 0: Input should be greater"),
        ("{use: source/fixed, with: {count: '3'}}", "'3'", "option count is '3': Input should be a valid integer"),
        ("{use: source/fixed, with: {shape: left}}", "left", "option shape is 'left': Input should be 'up' or"),
        ("{use: source/fixed, with: {inner: {depht: 1}}}", "depht", "'inner.depht' - did you mean 'depth'?"),
        ("{use: sum/add, from: {numbers: a}, with: {offset: .nan}}", ".nan", "finite number"),
        ("{use: source/random, with: {count: 1}}", "count", "takes no options"),
    ],
)
def test_wrong_wires_and_options_are_found_before_anything_runs(
    tmp_path: Path, line: str, token: str, message: str
) -> None:
    path = write_pipeline(tmp_path, f"  a: {{use: source/fixed}}\n  s: {line}\n")
    errors = spec_errors(path, wired=True)
    found = [error for error in errors if message in error.what]
    assert found, [str(error) for error in errors]
    assert places(path, found)[0] == f"5:{len('  s: ') + line.rindex(token) + 1}"
    of_plugin = "'sum/ad'" in message or "no role" in message or "asks" in message
    assert found[0].exit_code == (9 if of_plugin else 2)


def test_a_cycle_is_named_from_its_first_stage(tmp_path: Path) -> None:
    lines = (
        "  a: {use: source/fixed}\n"
        "  s: {use: sum/add, from: {numbers: l}}\n"
        "  l: {use: loop/report_size, from: {numbers: a, total: s}}\n"
    )
    path = write_pipeline(tmp_path, lines)
    (error,) = spec_errors(path, wired=True)
    assert isinstance(error, SpecError)
    assert error.what.endswith("s -> l -> s")
    assert error.where == f"{path}:5:37"


def test_paths_in_options_are_relative_to_the_file(tmp_path: Path) -> None:
    path = write_pipeline(tmp_path, "  a: {use: source/fixed, with: {file: data/x.csv}}\n")
    (node,) = wire(load_spec(path), made_up_registry())
    assert node.options["file"] == str(tmp_path / "data/x.csv")
    assert node.files == {"file": str(tmp_path / "data/x.csv")}


def test_set_reaches_nested_options_and_its_errors_name_the_command_line(tmp_path: Path) -> None:
    spec = load_spec(write_pipeline(tmp_path, GOOD))
    nodes = wire(with_set(spec, ["a.count=5", "a.inner.depth=2", "s.offset=1e-6"]), made_up_registry())
    options = nodes[0].options
    assert (options["count"], options["inner"]["depth"], nodes[1].options["offset"]) == (5, 2, 1e-6)
    with pytest.raises(SpecError, match="greater than or equal to 1") as caught:
        wire(with_set(spec, ["a.count=0"]), made_up_registry())
    assert caught.value.where == "--set a.count=0"
    for wrong in ("a=1", "a.count", "b.count=1", "a.count=[", "a..count=1"):
        with pytest.raises(SpecError):
            with_set(spec, [wrong])


@pytest.mark.slow
def test_use_keeps_what_the_new_variant_knows_and_names_the_rest(tmp_path: Path) -> None:
    spec = load_spec(write_pipeline(tmp_path, "  a: {use: source/fixed, with: {count: 2}}\n"))
    catalogue = Catalogue(registry=made_up_registry())
    swapped, notes = with_use(spec, ["a=source/random"], catalogue)
    assert wire(swapped, catalogue)[0].method.name == "source/random"
    assert notes == ["a: source/random has no option count; not used"]
    with pytest.raises(PluginError, match="no stage"):
        with_use(spec, ["a=source/nothing"], catalogue)


def test_built_in_stages_keep_to_their_roles() -> None:
    registry = find_stages()
    assert {"block", "bundle_adjustment", "accuracy"} <= set(registry.roles)
    for name in registry.variants:
        assert registry.card(name).name == name
        assert first_line(registry, name)


def test_listing_stages_imports_none_of_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    role = tmp_path / "odd_role"
    role.mkdir()
    (role / "__init__.py").write_text("")
    (role / "broken.py").write_text('"""A broken stage."""\nraise RuntimeError("imported")\n')
    (role / "empty.py").write_text('"""No function."""\n')
    import aatri.stages

    monkeypatch.setattr(aatri.stages, "__path__", [*aatri.stages.__path__, str(tmp_path)])
    registry = find_stages()
    assert first_line(registry, "odd_role/broken") == "A broken stage."
    assert "aatri.stages.odd_role.broken" not in sys.modules
    with pytest.raises(PluginError, match="declares no ROLE"):
        registry.card("odd_role/broken")
    (role / "__init__.py").write_text(
        "from aatri.artifacts.block import Block\nfrom aatri.plugin import Role\nROLE = Role(ports={}, kind=Block)\n"
    )
    sys.modules.pop("aatri.stages.odd_role")
    with pytest.raises(PluginError, match="RuntimeError: imported"):
        registry.card("odd_role/broken")
    with pytest.raises(PluginError, match="no function empty"):
        registry.card("odd_role/empty")


def test_a_variant_sets_single_options_within_options_and_leaves_the_others(tmp_path: Path) -> None:
    given = "{camera: {kind: digital, brown: {k1: 1.0, k2: 2.0}}, seed: null, list: [1, 2]}"
    head = (
        "run: out\nseed: 1\nvariants:\n  v: {a: {with: {camera: {brown: {k1: 3.0}, format: [1, 2]}, seed: {x: 1}, "
        "list: [3]}}}\n  none: {a: {with: {camera: null}}}\n"
    )
    spec = load_spec(write_pipeline(tmp_path, f"  a: {{use: source/fixed, with: {given}}}\n", head=head))
    expected = {"kind": "digital", "brown": {"k1": 3.0, "k2": 2.0}, "format": [1, 2]}
    assert dict(with_variant(spec, "v").stages["a"].options) == {"camera": expected, "seed": {"x": 1}, "list": [3]}
    assert with_variant(spec, "none").stages["a"].options["camera"] is None
    assert spec.stages["a"].options["camera"]["brown"]["k1"] == 1.0
