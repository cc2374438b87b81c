"""The map of the house is true: rooms, what they may use, the words of its diffs."""

from __future__ import annotations

import ast
import importlib.util
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.observations import kinds
from aatri.pipeline.store import run_folder
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.testing.check import check_stage
from tests.made_solutions import made_block, made_solution

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
SMALL = {"arrays", "codes", "errors", "ids", "units", "progress", "notes", "options", "regular_file", "strict_yaml"}
ROOMS = {
    row[0]: set(re.findall(r"`([\w/]+)`", row[2]))
    for row in re.findall(r"^\| `([\w/]+)` \| (.*) \| (.*) \|$", PAGE.split("## The way of the data")[0], re.M)
}
MAX_LINES = 300


def _room(module: list[str]) -> str:
    """The room of a module under aatri/, its parts given: a folder of a floor, or the floor itself."""
    if len(module) > 2 and module[1] != "stages" and (ROOT / "aatri" / module[1] / module[2]).is_dir():
        return f"{module[1]}/{module[2]}"
    return module[1]


def _imported(path: Path) -> Iterator[list[str]]:
    """Modules of aatri that a file imports when it runs, also within functions."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    checks = [n for n in ast.walk(tree) if isinstance(n, ast.If) and getattr(n.test, "id", "") == "TYPE_CHECKING"]
    for_types = {id(inner) for check in checks for inner in ast.walk(check)}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level and id(node) not in for_types:
            module = node.module.split(".")
            for name in node.names:
                inner = ROOT.joinpath(*module, name.name)
                yield [*module, name.name] if inner.is_dir() or inner.with_suffix(".py").exists() else module
        elif isinstance(node, ast.Import) and id(node) not in for_types:
            yield from (name.name.split(".") for name in node.names)


def _uses() -> Iterator[tuple[str, str, Path]]:
    """Every use of a room by another."""
    for top in ("aatri", "stages"):
        for path in sorted((ROOT / top).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            room = "stages" if top == "stages" else _room(list(parts))
            for module in _imported(path):
                if module[0] == "aatri" and len(module) > 1:
                    yield room, _room(module), path


def test_every_room_and_every_floor_has_its_row() -> None:
    folders = {p.parent.relative_to(ROOT / "aatri") for p in (ROOT / "aatri").rglob("__init__.py")}
    rooms = {"/".join(folder.parts) for folder in folders if 0 < len(folder.parts) <= 2}
    rooms -= {room for room in rooms if room.startswith("stages/")}
    rooms |= {path.stem for path in (ROOT / "aatri").glob("[a-z]*.py")} - SMALL
    assert sorted(rooms - set(ROOMS)) == []
    assert sorted(set(ROOMS) - rooms) == []


def test_every_role_is_on_the_way_of_the_data() -> None:
    way = PAGE[PAGE.index("## The way of the data") : PAGE.index("## The adjustment core")]
    assert [
        p.parent.name for p in (ROOT / "stages").glob("*/__init__.py") if not re.search(rf"\b{p.parent.name}\b", way)
    ] == []


def test_a_room_uses_only_the_rooms_that_its_row_names() -> None:
    """Whoever needs one more names it in the row of docs/architecture.md; lint-imports says whether it lies below."""
    strays = {
        f"{path.relative_to(ROOT)}: {room} uses {used}"
        for room, used, path in _uses()
        if room in ROOMS and used != room and used not in SMALL and used not in ROOMS[room]
    }
    assert sorted(strays) == []


def test_a_role_imports_no_other_role() -> None:
    strays = [
        str(path.relative_to(ROOT))
        for path in sorted((ROOT / "stages").rglob("*.py"))
        for module in _imported(path)
        if module[:2] == ["aatri", "stages"] and len(module) > 2 and module[2] != path.parent.name
    ]
    assert strays == []


def test_no_file_is_longer_than_can_be_read() -> None:
    paths = [path for top in ("aatri", "stages", "tests") for path in (ROOT / top).rglob("*.py")]
    lines = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8").count("\n") for path in paths}
    assert {path: count for path, count in lines.items() if count > MAX_LINES} == {}


def test_no_file_is_named_as_its_room() -> None:
    paths = [path for top in ("aatri", "stages") for path in (ROOT / top).rglob("*.py")]
    assert [str(path.relative_to(ROOT)) for path in paths if path.stem == path.parent.name] == []


def _diffs(title: str) -> dict[str, str]:
    """Texts of the files that the diff under a heading makes or changes, applied to those of the tree."""
    section = PAGE[PAGE.index(f"### {title}") :]
    diff = section[section.index("```diff\n") + 8 :]
    diff = diff[: diff.index("\n```")]
    found = {}
    for part in re.split(r"^--- .*\n", diff, flags=re.M)[1:]:
        name, body = part.split("\n", 1)
        path = name.removeprefix("+++ b/")
        text = (ROOT / path).read_text(encoding="utf-8") if (ROOT / path).exists() else ""
        for hunk in re.split(r"^@@ .*\n", body, flags=re.M)[1:]:
            lines = hunk.rstrip("\n").split("\n")
            old = "".join(f"{line[1:]}\n" for line in lines if not line.startswith("+"))
            new = "".join(f"{line[1:]}\n" for line in lines if not line.startswith("-"))
            assert (text.count(old) == 1) if old else (text == ""), f"the diff no longer applies to {path}:\n{old}"
            text = text.replace(old, new) if old else new
        found[path] = text
    return found


def _module(path: str, text: str, folder: Path, monkeypatch: pytest.MonkeyPatch, name: str = "") -> ModuleType:
    """A text as the module that it would be, or under another name."""
    file = folder / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    name = name or path.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    return module


LEVELLED = {"AB": 1.503, "BC": -0.702, "AC": 0.806}
NETWORK = """aatri_block: 1
name: levelling
terrain_height: 10.0
frames: {local: {axes: [east, north, up], crs: local}}
earth_curvature: ignore
units: {ground: m, angle: deg, sigma_image: um, sigma_ground: m, sigma_angle: deg, time: s}
"""


def _levelling(folder: Path) -> Block:
    """A, B and C levelled in a loop that misses by 5 mm; no height is given."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "block.yaml").write_text(NETWORK)
    (folder / "ground_points.csv").write_text(
        "point,X,Y,Z,role\nA,,,10,approximate\nB,,,11,approximate\nC,,,9,approximate\n"
    )
    rows = [f"height_difference,{line[0]},{line[1]},{value},0.001" for line, value in LEVELLED.items()]
    (folder / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *rows]) + "\n")
    return tables(options=TablesOptions(path=folder))


def test_the_observation_is_one_file_and_one_line_and_is_adjusted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = _diffs("An observation")
    new = [path for path in files if not (ROOT / path).exists()]
    assert len(new) == 1
    assert set(files) == {*new, "aatri/observations/kinds.py"}
    _module(new[0], files[new[0]], tmp_path, monkeypatch)
    patched = _module(
        "aatri/observations/kinds.py", files["aatri/observations/kinds.py"], tmp_path, monkeypatch, "kinds_of_docs"
    )
    assert len(patched.KINDS) == len(kinds.KINDS) + 1
    monkeypatch.setattr(kinds, "KINDS", patched.KINDS)
    solution = bundle(_levelling(tmp_path / "block"), options=BundleOptions(tolerance=1e-8))
    heights = dict(zip(solution.points.id.tolist(), solution.points.xyz_m[:, 2].tolist()))
    misclosure = LEVELLED["AB"] + LEVELLED["BC"] - LEVELLED["AC"]
    assert heights["B"] - heights["A"] == pytest.approx(LEVELLED["AB"] - misclosure / 3, abs=1e-6)
    assert heights["C"] - heights["A"] == pytest.approx(LEVELLED["AC"] + misclosure / 3, abs=1e-6)
    assert sum(heights.values()) / 3 == pytest.approx(10.0, abs=1e-6)


@pytest.mark.slow
def test_the_variant_keeps_its_contract(tmp_path: Path) -> None:
    ((path, text),) = _diffs("A variant of a role").items()
    file = tmp_path / path
    file.parent.mkdir(parents=True)
    file.write_text(text, encoding="utf-8")
    _, role, name = Path(path).with_suffix("").parts
    check_stage(f"{role}/{name}", local=tmp_path / "stages")


BINGO = """\
P1 lens
A 1.5 2.5
B -1 0.25
C 4 5
-99

P2 lens
A -3.5 2.4
B -6 0.2
C -1 5.1
"""


def test_the_format_is_one_file_of_60_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ((path, text),) = _diffs("A format").items()
    assert text.count("\n") <= 60
    module = _module(path, text, tmp_path, monkeypatch)
    (tmp_path / "images.txt").write_text(BINGO)
    (tmp_path / "control.txt").write_text("A 100 200 30\nB 110 200 31\n")
    options = {"principal_distance": 153.0, "control": tmp_path / "control.txt", "control_sigma": 0.02}
    block = module.bingo(options=module.BingoOptions(path=tmp_path / "images.txt", **options))
    measured = block.image_points
    assert block.images.id[measured.image].tolist() == ["P1", "P1", "P1", "P2", "P2", "P2"]
    assert block.points.id[measured.point].tolist() == ["A", "B", "C", "A", "B", "C"]
    assert measured.xy[3].tolist() == [-3.5, 2.4]
    assert measured.line.tolist() == [2, 3, 4, 8, 9, 10]
    assert block.ground_points.xyz_m.tolist() == [[100.0, 200.0, 30.0], [110.0, 200.0, 31.0]]
    assert np.diagonal(block.ground_points.covariance_m2, axis1=1, axis2=2) == pytest.approx(0.02**2)
    for wrong, message in (("B -1 0,25", "images.txt:3"), ("B -1 0.25 7", "images.txt:3: 4 words")):
        (tmp_path / "images.txt").write_text(BINGO.replace("B -1 0.25", wrong))
        with pytest.raises(InputError, match=message):
            module.bingo(options=module.BingoOptions(path=tmp_path / "images.txt", **options))


def test_the_export_writes_the_points(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = _diffs("An export")
    contracts = files.pop("pyproject.toml")
    rooms = {Path(path).parent.name for path in files if path.startswith("aatri/formats/")}
    assert all(re.search(rf'^layers = \["[\w |]*\b{room}\b', contracts, re.M) for room in rooms)
    for path in (path for path in files if path.startswith("aatri/formats/")):
        _module(path, files[path], tmp_path, monkeypatch)
    export = _module("aatri/cli/export.py", files["aatri/cli/export.py"], tmp_path, monkeypatch, "export_of_docs")
    block = made_block()
    solution = made_solution(block)
    made = {Solution: solution, Block: block, ImagePoints: None}
    record = {"output": {"kind": "Solution"}, "inputs": {"block": {"stage": "block"}}}
    monkeypatch.setattr(run_folder, "load", lambda _run, _name, kind: made[kind])
    monkeypatch.setattr(export, "_record", lambda _run, _name: record)
    run = type("Run", (), {"folder": tmp_path})()
    export._write_model(run, "bundle", export.ExportForm("ply"), tmp_path / "out")
    head, _, rows = (tmp_path / "out" / "points.ply").read_text().partition("end_header\n")
    xyz_m = np.array([[float(word) for word in row.split()] for row in rows.splitlines()])
    assert f"element vertex {len(xyz_m)}\n" in head
    np.testing.assert_array_equal(xyz_m, solution.points.xyz_m[np.isfinite(solution.points.xyz_m).all(axis=1)])


def test_the_section_has_its_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = _diffs("A section of the report")
    *new, changed = sorted(files, key=lambda path: (ROOT / path).exists())
    for path in new:
        _module(path, files[path], tmp_path, monkeypatch)
    patched = _module(changed, files[changed], tmp_path, monkeypatch, "section_of_docs")
    made = patched.PageSection(stage=None, seconds="")
    patched.show(made, made_block(columns=5), None)
    (strips,) = (table for table in made.tables if table.caption.startswith("Strips"))
    assert [tuple(row) for row in strips.rows] == [("1", "5"), ("2", "5")]


def test_a_key_class_is_one_class_and_lies_where_the_page_says() -> None:
    table = PAGE.split("## Key classes")[1]
    tree = [file.read_text(encoding="utf-8") for part in ("aatri", "stages") for file in (ROOT / part).rglob("*.py")]
    rows = re.findall(r"^\| (`.*?) \|.*\| (`.*`) \|$", table, flags=re.M)
    assert len(rows) > 10
    for names, files in rows:
        sources = [(ROOT / "aatri" / file).read_text(encoding="utf-8") for file in re.findall(r"`([^`]+)`", files)]
        for name in re.findall(r"`(\w+)`", names):
            definition = re.compile(rf"^class {name}\b", re.M)
            assert sum(bool(definition.search(text)) for text in sources) == 1, name
            assert sum(len(definition.findall(text)) for text in tree) == 1, name
