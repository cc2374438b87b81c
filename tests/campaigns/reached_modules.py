"""Modules of a copy of the tree: which a stage needs, by importing them in another process; lines put into them."""

from __future__ import annotations

import ast
import dis
import importlib
import importlib.util
import json
import os
import random
import sys
import traceback
import types
from collections.abc import Iterator
from pathlib import Path


def inserted(path: Path, line: str, chance: random.Random) -> None:
    """Put a line at the end of a module, or at the beginning of one of its functions, after its docstring."""
    text = path.read_text()
    lines = text.splitlines()
    places = [(len(lines), 0)]
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef) and len(node.body) > 1 and node.body[0].lineno > node.lineno:
            first = node.body[1 if ast.get_docstring(node, clean=False) is not None else 0]
            above = getattr(first, "decorator_list", None)
            places.append(((above[0].lineno if above else first.lineno) - 1, first.col_offset))
    at, indent = chance.choice(places)
    path.write_text("\n".join([*lines[:at], " " * indent + line, *lines[at:]]) + "\n")


def forget_aatri() -> None:
    """Let aatri be imported anew: the campaign itself has modules of its own tree."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "aatri"]:
        del sys.modules[name]


def reached_modules(tree: Path, place: Path, use: str) -> frozenset[str]:
    """Names of the modules; `place` is a folder for the answer of that process."""
    answer = place / "reached.json"

    def look() -> None:
        import numba

        os.environ["NUMBA_DISABLE_JIT"] = "1"  # modules are looked for, nothing is called
        numba.config.DISABLE_JIT = 1
        forget_aatri()
        _enter_without_packages(tree)
        importlib.import_module("aatri.stages." + use.replace("/", "."))
        done: set[str] = set()
        while new := {name for name in sys.modules if name.startswith("aatri.")} - done:
            for name in sorted(new):
                for target in _imports_in_functions(sys.modules[name]):
                    importlib.import_module(target)
            done |= new
        files = {name: getattr(sys.modules[name], "__file__", None) for name in done}
        assert all(file is None or file.startswith(str(tree)) for file in files.values()), files
        answer.write_text(json.dumps([name for name, file in files.items() if file is not None]))

    child = os.fork()
    if child == 0:
        try:
            look()
            os._exit(0)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)
    assert os.waitpid(child, 0)[1] == 0
    return frozenset(json.loads(answer.read_text()))


def _enter_without_packages(tree: Path) -> None:
    """Let the copy be imported without what `__init__` files import: a role names all its ports there."""
    folders = [tree / "aatri", *sorted(p.parent for p in (tree / "aatri").rglob("*/__init__.py"))]
    places = {".".join(folder.relative_to(tree).parts): folder for folder in folders}
    places["aatri.stages"] = tree / "stages"
    places |= {f"aatri.stages.{p.parent.name}": p.parent for p in (tree / "stages").glob("*/__init__.py")}
    for name, folder in places.items():
        sys.modules[name] = types.ModuleType(name)
        sys.modules[name].__path__ = [str(folder)]


def _imports_in_functions(module: types.ModuleType) -> Iterator[str]:
    """Modules of aatri that the functions of a module import when they are called."""
    file = getattr(module, "__file__", None)
    if not file or not file.endswith(".py"):
        return
    waiting = [c for c in compile(Path(file).read_text(), file, "exec").co_consts if isinstance(c, types.CodeType)]
    while waiting:
        code = waiting.pop()
        waiting += [constant for constant in code.co_consts if isinstance(constant, types.CodeType)]
        steps = list(dis.get_instructions(code))
        for k, step in enumerate(steps):
            if step.opname != "IMPORT_NAME":
                continue
            level, names = steps[k - 2].argval, steps[k - 1].argval or ()
            parents = module.__name__.split(".")[:-level] if level else []
            base = ".".join([*parents, *filter(None, [step.argval])])
            if base.split(".")[0] == "aatri":
                yield base
                yield from (f"{base}.{name}" for name in names if _is_module(base, name))


def _is_module(base: str, name: str) -> bool:
    spec = importlib.util.find_spec(base)
    is_package = spec is not None and spec.submodule_search_locations is not None
    return is_package and importlib.util.find_spec(f"{base}.{name}") is not None
