"""Edit pipeline, data and code at random: exactly the stages that depend on the edit are made again.

    python -m tests.campaigns.edits 200 [--seed S] [--short]

A copy of `aatri/` and `stages/` and the small block as a folder of tables are edited, one thing at a time: options and
wiring of stages, order and comments of the YAML; values, comments and times of the CSV files; statements, comments and
docstrings of modules, also of modules that no stage reaches; and code is put back. After each edit `aatri run` must
make the stages that the model below says, no other; now and then all digests are compared with those of a clean run.

The model: a stage was made before if what it is written as, the content of its inputs, of its files and of all modules
it reaches were all together before. What a stage reaches is found by importing it, without the `__init__` files, and
looking at `sys.modules`, and by importing what the compiled code of the functions in there imports: not by the syntax
trees that aatri reads.

With `--short` the stages end before the bundle, whose kernels would have to be compiled for the copy.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import json
import os
import random
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from tests.campaigns import harness
from tests.campaigns.reached_modules import forget_aatri, inserted, reached_modules

ROOT = Path(__file__).resolve().parents[2]
WARM = ("numpy", "scipy.linalg", "scipy.stats", "scipy.sparse", "scipy.spatial", "h5py", "numba", "pydantic", "typer")
CLEAN_EVERY = 25
OPTIONS = {
    "interior": ("test_limit", 4.0),
    "models": ("snooping_limit", 4.0),
    "strips": ("snooping_limit", 4.0),
    "absolute": ("control_limit", 5.0),
    "strip_block": ("limit", 4.0),
    "bundle": ("max_iterations", 30),
    "accuracy_absolute": ("confidence", 0.95),
    "accuracy_strip_block": ("confidence", 0.95),
    "accuracy": ("confidence", 0.95),
}
DATA = "  block:       {use: block/tables, with: {path: block}}\n"


class Project:
    """The copy that is edited, and the model of what has been made from it."""

    def __init__(self, place: Path, chance: random.Random, *, short: bool) -> None:
        self.place, self.chance, self.tree = place, chance, place / "tree"
        self.pipeline, self.run = place / "pipeline.yaml", place / "run"
        self.spec: dict[str, Any] = yaml.safe_load("run: run\nseed: 1\nstages:\n" + DATA + harness.CHAIN)
        for stage in ("bundle", "accuracy") if short else ():
            del self.spec["stages"][stage]
        for stage in self.spec["stages"].values():
            stage["from"] = {port: source or port for port, source in (stage.get("from") or {}).items()}
        self.statements: dict[str, str] = {}
        self.originals: dict[str, str] = {}
        self.reached: dict[str, frozenset[str]] = {}
        self.known: set[str] = set()

    def aatri(self, *arguments: str | Path, into: Path | None = None) -> int:
        """Run the copy."""
        command = ["run", self.pipeline, "-q", "--into", into or self.run, *arguments]
        return harness.run(command, self.place / "output.txt", before=self.enter)

    def enter(self) -> None:
        """In a forked process: the copy is the aatri that is imported."""
        forget_aatri()
        sys.path.insert(0, str(self.tree))
        harness.without_report()

    def write_spec(self, remark: str = "") -> None:
        """Write the pipeline, options in any order."""
        for stage in self.spec["stages"].values():
            items = list(stage.items())
            self.chance.shuffle(items)
            stage.clear()
            stage.update(items)
        self.pipeline.write_text(f"# {remark}\n" + yaml.safe_dump(self.spec, sort_keys=False))

    def expected(self, after: dict[str, str]) -> list[str]:
        """The stages that had to be made, in order; they are known from now on."""
        made = []
        for name, stage in self.spec["stages"].items():
            inputs = {port: after[source] for port, source in stage["from"].items()}
            code = {module: self.statements.get(module) for module in sorted(self.reached[name])}
            default = dict([OPTIONS[name]]) if name in OPTIONS else {}
            options = {key: value for key, value in stage.get("with", {}).items() if value != default.get(key)}
            written = [stage["use"], sorted(options.items())]
            parts = json.dumps([name, written, inputs, code, _content(self.place / "block") if name == "block" else 0])
            if parts not in self.known:
                made.append(name)
                self.known.add(parts)
        return made


def main() -> None:
    parser = harness.arguments(__doc__, "edits")
    parser.add_argument("--short", action="store_true")
    given, begin = parser.parse_args(), time.monotonic()
    for name in WARM:
        importlib.import_module(name)
    counted: dict[str, int] = {}
    with harness.workplace() as place:
        project = Project(place, random.Random(given.seed), short=given.short)
        _prepare(project)
        for number in range(given.count):
            name, undo = _edit(project)
            made, wrong = _check(project, clean=number % CLEAN_EVERY == CLEAN_EVERY - 1 or number == given.count - 1)
            for what, how_many in ((name, 1), ("stages made again", made), ("WRONG edits" if wrong else "right", 1)):
                counted[what] = counted.get(what, 0) + how_many
            if wrong:
                sys.stderr.write(f"edit {number}, {name} {undo}:\n  " + "\n  ".join(wrong) + "\n")
    harness.conclude("edits", counted, begin)


def _prepare(project: Project) -> None:
    for name in ("aatri", "stages"):
        shutil.copytree(ROOT / name, project.tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    simulated = harness.PIPELINE.split("stages:\n")[1]
    first = project.place / "simulated.yaml"
    first.write_text("run: simulated\nstages:\n" + simulated)
    output = project.place / "output.txt"
    export = ["export", project.place / "simulated:block", "tables", project.place / "block"]
    for command in (["run", first, "-q"], export):
        assert harness.run(command, output, before=project.enter) == 0, output.read_text()
    project.write_spec()
    assert project.aatri() == 0, output.read_text()
    for name, stage in project.spec["stages"].items():
        project.reached[name] = reached_modules(project.tree, project.place, stage["use"])
    assert project.expected(harness.digests_of(project.run)) == list(project.spec["stages"])


def _check(project: Project, *, clean: bool) -> tuple[int, list[str]]:
    """Run after an edit; how many stages were made, and what is wrong."""
    events = project.run / "events.jsonl"
    size = events.stat().st_size
    if project.aatri() != 0:
        return 0, ["the run failed: " + (project.place / "output.txt").read_text()[-800:]]
    after = harness.digests_of(project.run)
    lines = events.read_bytes()[size:].splitlines()
    made = [event["stage"] for event in map(json.loads, lines) if event["event"] == "stage done"]
    expected = project.expected(after)
    wrong = [] if sorted(made) == sorted(expected) else [f"made {made}, expected {expected}"]
    wrong += harness.problems(project.run)
    if clean:
        assert project.aatri(into=project.place / "clean") == 0
        if harness.digests_of(project.place / "clean") != after:
            wrong.append("a clean run gives other digests")
        shutil.rmtree(project.place / "clean")
    return len(made), wrong


def _edit(project: Project) -> tuple[str, str]:
    """Make an edit; its kind and what it hit."""
    edits: list[tuple[Callable[[Project], str], int]] = [
        (option, 6), (wiring, 2), (order_of_the_yaml, 1), (value_in_a_table, 2), (comment_in_a_table, 1),
        (time_of_a_table, 1), (statement, 5), (comment, 2), (docstring, 2), (code_out_of_reach, 2), (undone_code, 2),
    ]  # fmt: skip
    (edit,) = project.chance.choices([e for e, _ in edits], [weight for _, weight in edits])
    return edit.__name__.replace("_", " "), edit(project)


def option(project: Project) -> str:
    """Another value, or the default again."""
    stage = project.chance.choice(sorted(OPTIONS.keys() & project.spec["stages"].keys()))
    name, default = OPTIONS[stage]
    values = project.spec["stages"][stage].setdefault("with", {})
    if name in values and project.chance.random() < 0.3:
        values[name] = default
    elif isinstance(default, int):
        values[name] = project.chance.randint(31, 10**6)
    else:
        values[name] = round(default + project.chance.uniform(-0.01, 0.01), 6)
    project.write_spec()
    return f"{stage}.{name}"


def wiring(project: Project) -> str:
    """Another initial Solution for the bundle, another Solution to be evaluated."""
    places = [("bundle", "initial"), ("accuracy_absolute", "solution"), ("accuracy_strip_block", "solution")]
    stage, port = project.chance.choice([place for place in places if place[0] in project.spec["stages"]])
    other = project.chance.choice(["absolute", "strip_block"])
    project.spec["stages"][stage]["from"][port] = other
    project.write_spec()
    return f"{stage}: {other}"


def order_of_the_yaml(project: Project) -> str:
    """Comments and the order of keys say nothing."""
    project.write_spec(f"remark {project.chance.random()}")
    return ""


def value_in_a_table(project: Project) -> str:
    """A micrometre more or less."""
    path = project.place / "block" / "fiducials.csv"
    header, *rows = path.read_text().splitlines()
    k = project.chance.randrange(len(rows))
    cells, column = rows[k].split(","), header.split(",").index("x")
    cells[column] = f"{float(cells[column]) + project.chance.choice([-1e-3, 1e-3]):.4f}"
    rows[k] = ",".join(cells)
    path.write_text("\n".join([header, *rows]) + "\n")
    return f"{path.name}:{k + 2}"


def comment_in_a_table(project: Project) -> str:
    """The file is another, the block may be the same."""
    path = project.chance.choice(sorted((project.place / "block").glob("*.csv")))
    with path.open("a") as file:
        file.write(f"# {project.chance.random()}\n")
    return path.name


def time_of_a_table(project: Project) -> str:
    """Times of files say nothing."""
    path = project.chance.choice(sorted((project.place / "block").glob("*.csv")))
    os.utime(path)
    return path.name


def statement(project: Project) -> str:
    """A statement more at the end of a module or in one of its functions: another code, the same numbers."""
    module = project.chance.choice(_modules(project))
    line = f"_edit = {project.chance.random()}"
    path = _file(project, module)
    text = path.read_text()
    project.originals.setdefault(module, text)
    inserted(path, line, project.chance)
    project.statements[module] = line  # random: no two states of a module with statements added are alike
    return module


def comment(project: Project) -> str:
    """A comment more."""
    module = project.chance.choice(_modules(project))
    inserted(_file(project, module), f"# {project.chance.random()}", project.chance)
    return module


def docstring(project: Project) -> str:
    """Another text in a docstring."""
    module = project.chance.choice(_modules(project))
    path = _file(project, module)
    path.write_text(path.read_text().replace('"""', f'"""{project.chance.randrange(10**6)} ', 1))
    return module


def code_out_of_reach(project: Project) -> str:
    """A statement more in a module that no stage reaches, or in a package's `__init__`."""
    reached = {_file(project, module) for module in set().union(*project.reached.values())}
    floors = [project.tree / "aatri" / name for name in ("report", "cli", "evaluation", "formats", "artifacts")]
    others = sorted(p for floor in floors for p in floor.rglob("*.py") if p not in reached)
    path = project.chance.choice(others)
    with path.open("a") as file:
        file.write(f"_edit = {project.chance.random()}\n")
    return str(path.relative_to(project.tree))


def undone_code(project: Project) -> str:
    """A module as it was at first."""
    if not project.originals:
        return "nothing yet"
    module = project.chance.choice(sorted(project.originals))
    _file(project, module).write_text(project.originals.pop(module))
    project.statements.pop(module, None)
    return module


def _modules(project: Project) -> list[str]:
    """The modules that stages reach; kernels are left out, for they would be compiled anew."""
    return sorted(m for m in frozenset().union(*project.reached.values()) if ".kernels." not in m)


def _content(folder: Path) -> str:
    lines = [f"{p.name} {hashlib.sha256(p.read_bytes()).hexdigest()}" for p in sorted(folder.iterdir())]
    return "\n".join(lines)


def _file(project: Project, module: str) -> Path:
    parts = module.split(".")
    top = project.tree / "stages" if parts[:2] == ["aatri", "stages"] else project.tree / "aatri"
    return top.joinpath(*parts[2 if parts[:2] == ["aatri", "stages"] else 1 :]).with_suffix(".py")


if __name__ == "__main__":
    main()
