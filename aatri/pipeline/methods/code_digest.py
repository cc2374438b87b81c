"""Which code a stage depends on: the static import closure of its module, and the digest of it.

Followed are modules of aatri, of the built-in stages and of the plugin's own package or folder; `__init__` files are
not (they re-export nothing), nor imports under `TYPE_CHECKING`. Imports inside functions count, but are told apart. Per
file the syntax tree without docstrings is digested, with the version of Python that made it: comments, blank lines and
docstrings change nothing, any other edit does. Nothing is imported for this.
"""

import ast
import hashlib
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import aatri
from aatri.pipeline.store.cache import Cache, of_file

SHORT = 12
"""Hex digits that tell the versions of one module apart."""

PACKAGE = Path(aatri.__file__).resolve().parent
_STAGES = PACKAGE / "stages" if (PACKAGE / "stages" / "block").is_dir() else PACKAGE.parent / "stages"
BUILT_IN = {"aatri.stages": _STAGES, "aatri": PACKAGE}
_KINDS = ("imports", "at_once")
_PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"


@dataclass(frozen=True)
class Code:
    """The code of a stage: digest, the files it was taken over, and the digest of each, by module."""

    digest: str
    files: dict[str, str]
    modules: dict[str, str]
    at_once: frozenset[str] = frozenset()
    """Modules that are imported with it; the others by some function, when it is called."""


class CodeReader:
    """Reads code for one planning: every file and name is looked at once, however many stages reach it."""

    def __init__(self, cache: Cache) -> None:
        self._cache = cache
        self._files: dict[str, dict[str, Any]] = {}
        self._codes: dict[tuple[str, Path], Code] = {}
        self._imported: dict[tuple[str, str], dict[str, list[tuple[str, str]]]] = {}
        self._places: dict[str, dict[str, tuple[str, str] | None]] = {}  # by own root and dotted name
        self._folders: dict[str, frozenset[str]] = {}

    def code_of(self, module: str, path: Path) -> Code:
        """The code reached from a module.

        Parameters
        ----------
        module : str
            Dotted name.
        path : Path
            Its file.

        Raises
        ------
        OSError
            If a file cannot be read.
        """
        if (module, path) not in self._codes:
            self._codes[module, path] = self._code_of(module, path)
        return self._codes[module, path]

    def _code_of(self, module: str, path: Path) -> Code:
        own, folder = _own_root(module, path)
        roots = {name: str(place) for name, place in {**BUILT_IN, own: folder}.items()}
        root = str(folder)
        reached: dict[str, dict[str, str]] = {kind: {} for kind in _KINDS}
        for kind, files in reached.items():
            waiting = [(module, str(path))]
            while waiting:
                name, file = waiting.pop()
                if name not in files:
                    files[name] = file
                    waiting += self._imports(name, file, root, roots)[kind]
        files = dict(sorted(reached["imports"].items()))
        digests = {name: self._file(file)["digest"] for name, file in files.items()}
        lines = "".join(f"{name} {digest}\n" for name, digest in digests.items())
        of_all = hashlib.sha256(f"{_PYTHON}\n{lines}".encode()).hexdigest()
        short = {name: digest[:SHORT] for name, digest in digests.items()}
        return Code(of_all, files, short, frozenset(reached["at_once"]))

    def _file(self, file: str) -> dict[str, Any]:
        if file not in self._files:
            self._files[file] = of_file(Path(file), self._cache, _read)
        return self._files[file]

    def _imports(self, name: str, file: str, own: str, roots: Mapping[str, str]) -> dict[str, list[tuple[str, str]]]:
        """The modules of the roots that a file `imports`, and of these what it imports `at_once`."""
        if (file, own) not in self._imported:
            places, modules = self._places.setdefault(own, {}), dict[str, list[tuple[str, str]]]()
            for kind in _KINDS:
                pairs = self._file(file)[kind]
                names = [_absolute(level, imported, name) if level else imported for level, imported in pairs]
                places.update({unseen: self._locate(unseen, roots) for unseen in names if unseen not in places})
                located = dict.fromkeys(places[imported] for imported in names)
                modules[kind] = [module for module in located if module is not None]
            self._imported[file, own] = modules
        return self._imported[file, own]

    def _locate(self, name: str, roots: Mapping[str, str]) -> tuple[str, str] | None:
        """Module and file of a dotted name, or of the module that it is an attribute of; packages are not followed."""
        for root, place in roots.items():
            if root and name != root and not name.startswith(f"{root}."):
                continue
            head = root
            for part in name.removeprefix(root).strip(".").split("."):
                head = f"{head}.{part}" if head else part
                if f"{part}.py" in self._names_in(place):
                    return head, f"{place}{os.sep}{part}.py"
                if part not in self._names_in(place):
                    break
                place = f"{place}{os.sep}{part}"
            return None
        return None

    def _names_in(self, folder: str) -> frozenset[str]:
        """Names in a folder, listed once; none where it is no folder."""
        if folder not in self._folders:
            try:
                self._folders[folder] = frozenset(one.name for one in os.scandir(folder))
            except OSError:
                self._folders[folder] = frozenset()
        return self._folders[folder]


def _own_root(module: str, path: Path) -> tuple[str, Path]:
    """Name and folder of the top package of a plugin, by going up from its file as deep as its name is."""
    parts = module.split(".")
    if parts[0] == "aatri":
        return "aatri", PACKAGE
    depth = len(parts) - 1 + (path.name == "__init__.py")
    return (parts[0], path.parents[depth - 1]) if depth else ("", path.parent)


def _absolute(level: int, name: str, module: str) -> str:
    """The dotted name of a relative import; `level` dots go up from the module that has it."""
    return ".".join([*module.split(".")[:-level], name])


def _read(path: Path) -> dict[str, Any]:
    """Digest and imports of one file; a file that does not parse is taken as it is."""
    text = path.read_bytes()
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError):
        return {"digest": hashlib.sha256(text).hexdigest(), "imports": [], "at_once": []}
    imports: set[tuple[int, str]] = set()
    at_once: set[tuple[int, str]] = set()
    _look_through(tree, imports, at_once)
    digest = hashlib.sha256(ast.dump(tree, include_attributes=False).encode()).hexdigest()
    return {"digest": digest, **{k: [list(one) for one in sorted(of)] for k, of in zip(_KINDS, (imports, at_once))}}


def _look_through(node: ast.AST, imports: set[tuple[int, str]], at_once: set[tuple[int, str]]) -> None:
    """Collect the imports of a statement and those within it, and take docstrings out; expressions have neither.

    Those outside functions are collected in `at_once` too.

    An import is (level, dotted name); of `from x import y` the name is `x.y`, which may be a module.
    """
    if isinstance(node, ast.Import | ast.ImportFrom):
        level, module = (node.level, node.module) if isinstance(node, ast.ImportFrom) else (0, None)
        names = {(level, f"{module}.{alias.name}" if module else alias.name) for alias in node.names}
        imports |= names
        at_once |= names
    elif isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
        _strip_docstring(node)
    outside = set() if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) else at_once
    type_checking = isinstance(node, ast.If) and _is_type_checking(node.test)
    for field in ("orelse",) if type_checking else ("body", "orelse", "handlers", "finalbody", "cases"):
        below = getattr(node, field, ())
        for child in below if isinstance(below, list) else ():
            _look_through(child, imports, outside)


def _strip_docstring(node: ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) -> None:
    first = node.body[0] if node.body else None
    if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str):
        node.body = node.body[1:] or [ast.Pass()]


def _is_type_checking(test: ast.expr) -> bool:
    name = test.attr if isinstance(test, ast.Attribute) else test.id if isinstance(test, ast.Name) else ""
    return name == "TYPE_CHECKING"
