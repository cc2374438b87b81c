"""The map of the house is true: rooms, what they may use, files, key classes."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
SMALL = {
    "arrays",
    "codes",
    "machine",
    "errors",
    "ids",
    "units",
    "progress",
    "notes",
    "options",
    "extras",
    "regular_file",
    "strict_yaml",
    "together",
}
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


@dataclass(frozen=True)
class Source:
    """What is asked of a file of code; its tree is let go, that of all takes 400 MB."""

    imported: tuple[list[str], ...]
    """Modules that it imports when it runs, also within functions."""
    numbers: tuple[tuple[str, str], ...]
    """Names of its numeric constants, with what is said of each."""
    names: tuple[tuple[int, str], ...]
    """Line and name of each variable, parameter and function."""
    self_referring: tuple[tuple[int, str], ...]
    """Line and name of each function within a function that refers to itself."""


@cache
def _source(path: Path) -> Source:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    nodes = list(ast.walk(tree))
    variables = [node for node in nodes if isinstance(node, ast.Name | ast.arg | ast.FunctionDef)]
    names = [(n.lineno, getattr(n, "id", getattr(n, "arg", getattr(n, "name", "")))) for n in variables]
    return Source(tuple(_imported(nodes)), tuple(_numbers(tree.body)), tuple(names), tuple(_self_referring(nodes)))


@cache
def _is_module(*names: str) -> bool:
    place = ROOT.joinpath(*names)
    return place.is_dir() or place.with_suffix(".py").exists()


def _imported(nodes: list[ast.AST]) -> Iterator[list[str]]:
    checks = [n for n in nodes if isinstance(n, ast.If) and getattr(n.test, "id", "") == "TYPE_CHECKING"]
    for_types = {id(inner) for check in checks for inner in ast.walk(check)}
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and node.module and not node.level and id(node) not in for_types:
            module = node.module.split(".")
            for name in node.names:
                yield [*module, name.name] if _is_module(*module, name.name) else module
        elif isinstance(node, ast.Import) and id(node) not in for_types:
            yield from (name.name.split(".") for name in node.names)


def _self_referring(nodes: list[ast.AST]) -> Iterator[tuple[int, str]]:
    functions = [n for n in nodes if isinstance(n, ast.FunctionDef)]
    methods = {id(n) for c in nodes if isinstance(c, ast.ClassDef) for n in c.body}
    within = {id(n): n for f in functions for n in ast.walk(f) if isinstance(n, ast.FunctionDef) and n is not f}
    for function in within.values():
        used = {n.id for n in ast.walk(function) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
        if id(function) not in methods and function.name in used:
            yield function.lineno, function.name


@cache
def _uses() -> list[tuple[str, str, Path]]:
    """Every use of a room by another."""
    uses = []
    for path in (path for top in ("aatri", "stages") for path in sorted((ROOT / top).rglob("*.py"))):
        parts = path.relative_to(ROOT).with_suffix("").parts
        room = "stages" if parts[0] == "stages" else _room(list(parts))
        modules = [module for module in _source(path).imported if module[0] == "aatri" and len(module) > 1]
        uses += [(room, _room(module), path) for module in modules]
    return uses


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


def test_no_two_rooms_use_each_other() -> None:
    used = {(room, other) for room, other, _ in _uses() if room != other}
    assert sorted(pair for pair in used if pair[::-1] in used and pair < pair[::-1]) == []


def test_a_role_imports_no_other_role() -> None:
    strays = [
        str(path.relative_to(ROOT))
        for path in sorted((ROOT / "stages").rglob("*.py"))
        for module in _source(path).imported
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


@cache
def _classes() -> list[str]:
    """Names of all classes at the top of files, each as often as it stands there."""
    paths = [path for top in ("aatri", "stages") for path in (ROOT / top).rglob("*.py")]
    return [name for path in paths for name in re.findall(r"^class (\w+)", path.read_text(encoding="utf-8"), re.M)]


def test_a_key_class_is_one_class_and_lies_where_the_page_says() -> None:
    table = PAGE.split("## Key classes")[1]
    count = Counter(_classes())
    rows = re.findall(r"^\| (`.*?) \|.*\| (`.*`) \|$", table, flags=re.M)
    assert len(rows) > 10
    for names, files in rows:
        sources = [(ROOT / "aatri" / file).read_text(encoding="utf-8") for file in re.findall(r"`([^`]+)`", files)]
        for name in re.findall(r"`(\w+)`", names):
            definition = re.compile(rf"^class {name}\b", re.M)
            assert sum(bool(definition.search(text)) for text in sources) == 1, name
            assert count[name] == 1, name


def test_no_class_name_stands_for_two_things() -> None:
    assert sorted(name for name, count in Counter(_classes()).items() if count > 1 and not name.startswith("_")) == []


_CHANCE = re.compile(r"ALARM|CHANCE|UNLIKELY|SIGNIFICAN|(^|_)SEPARABLE|(^|_)(LEVEL|POWER|SIGMAS)$")
_OF_CHANCE = re.compile(r"probability|by chance|false alarm|chi-square|of normal errors", re.I)
_NO_TESTS = {
    "aatri/measuring/session.py: SHOWN_SIGMAS": "the size of a drawn ellipse",
}
"""Numbers that speak of chance and are no limits of tests of an adjustment, with the reason."""


def _numbers(body: list[ast.stmt]) -> Iterator[tuple[str, str]]:
    for node, after in zip(body, [*body[1:], None]):
        if isinstance(node, ast.Assign) and not any(isinstance(n, ast.Call | ast.Name) for n in ast.walk(node.value)):
            values = [n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant)]
            told = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            if values and all(type(value) in (int, float) for value in values):
                yield ast.unparse(node.targets[0]), " ".join(str(after.value.value).split()) if told else ""


def _numbers_outside_limits() -> Iterator[tuple[str, str, str]]:
    """Place, name and docstring of the numbers at the top of files that are no `limits.py` and no kernels."""
    for top in ("aatri", "stages"):
        for path in sorted((ROOT / top).rglob("*.py")):
            if path.name != "limits.py" and not {"kernels", "simulation", "testing"} & set(path.parts):
                for name, text in _source(path).numbers:
                    yield f"{path.relative_to(ROOT)}: {name}", name, text


def test_chances_and_limits_of_tests_stand_in_limits_alone() -> None:
    """Where a threshold stands for a test its chance of an alarm is chosen once (`limits.py` of a floor or room)."""
    strays = {
        place for place, name, text in _numbers_outside_limits() if _CHANCE.search(name) or _OF_CHANCE.search(text)
    }
    assert sorted(strays ^ set(_NO_TESTS)) == []


_THRESHOLD = re.compile(
    r"^\(?(FEWEST|LEAST|WEAK|WEAKEST|CLEARLY|ALIKE|FLAT|WRONG|MISFIT|GROSS|OFF|BEYOND|SUSPICIOUS|UNDETERMINED|WARNED|HARDLY"
    r"|APART|STRONG|NOTHING)(_|\b)"
)
_OF_ARITHMETIC = {
    "aatri/adapters/ground/initial_solution.py: LEAST_SIGMA": "stands for exact",
    "aatri/adjustment/covariance/score.py: LEAST_SEEN": "rounding",
    "aatri/adjustment/iterative/preconditioner.py: (LEAST_PIECE, MOST_PIECE)": "size of work",
    "aatri/formats/lists/list_form.py: (FEWEST, MOST)": "columns of a file",
    "aatri/orientation/graph/differences.py: LEAST": "rounding",
    "aatri/orientation/relative/critical.py: CLEARLY": "bounds of work",
    "aatri/pipeline/run/workers.py: LEAST_BYTES": "memory",
    "aatri/pixels/least_squares_matching.py: ALIKE_PX": "reach of a filter",
    "aatri/report/drawing/charts.py: NOTHING": "drawing",
    "aatri/report/drawing/scales.py: LEAST_FOR_MAIN_PART": "drawing",
    "aatri/report/plotting.py: (LEAST_HEIGHT, MOST_HEIGHT)": "drawing",
}
"""Numbers with the name of a threshold that decide nothing of data."""


def test_thresholds_of_data_stand_in_limits_alone() -> None:
    """What is few, weak, wrong, far off or alike is said once, in `limits.py` of a floor or room, or in a kernel."""
    strays = {place for place, name, _ in _numbers_outside_limits() if _THRESHOLD.search(name)}
    assert sorted(strays ^ set(_OF_ARITHMETIC)) == []


PRIVATE_WORDS = {"found", "told", "heard", "mine", "gone", "tried", "said", "some", "given", "known", "held"}
PRIVATE_WORDS |= {"wanted", "whole", "nothing", "alone", "aside", "snooped", "how", "felt"}

FIELDS = {
    ("aatri/observations/control.py", "given"),
    ("aatri/observations/positions.py", "given"),
    ("aatri/orientation/bodies/datum_analysis.py", "given"),
    ("aatri/orientation/bundle/result.py", "given"),
    ("aatri/formats/results/exported_files.py", "known"),
    ("stages/block/simulate.py", "known"),
}
"""Which coordinates are stated, with a sentence of what that means beside the field."""


def test_variables_say_what_they_hold() -> None:
    """Residuals, rejections, rows, observations: not `found`, `told`, `whole`, by which a reader learns nothing."""
    strays = {
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for top in ("aatri", "stages")
        for path in sorted((ROOT / top).rglob("*.py"))
        if "kernels" not in path.parts
        for line, name in _source(path).names
        if name in PRIVATE_WORDS and (path.relative_to(ROOT).as_posix(), name) not in FIELDS
    }
    assert sorted(strays) == []


def test_no_function_within_a_function_refers_to_itself() -> None:
    """Such a cycle holds all arrays that it sees until the collector comes by: 1.5 GB of ties at 100,000 images.

    Two that name each other, and a lambda that is called by its variable, are not seen here.
    """
    strays = {
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for top in ("aatri", "stages")
        for path in sorted((ROOT / top).rglob("*.py"))
        for line, name in _source(path).self_referring
    }
    assert sorted(strays) == []


def test_no_test_takes_anything_from_one_that_is_skipped_without_an_extra() -> None:
    """Half imported it stays where it was when it was skipped, and what is taken from it is not there."""
    texts = {p: p.read_text(encoding="utf-8") for p in (ROOT / "tests").rglob("test_*.py")}
    skips = re.compile(r"^(?:\w+ = )?pytest\.importorskip|allow_module_level", re.M)
    skipped = {".".join(p.relative_to(ROOT).with_suffix("").parts) for p, text in texts.items() if skips.search(text)}
    imports = re.compile(r"^from (tests\.\S+) import", re.M)
    assert not [(p.name, name) for p, text in texts.items() for name in imports.findall(text) if name in skipped]
